#include "segment_report/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace margay::segment_report {
namespace {

constexpr double kWidth = 860, kHeight = 190;
constexpr double kLeft = 76, kRight = 12, kTop = 26, kBottom = 24;
constexpr std::size_t kSteps = 600;

struct Range {
    double least = 0;
    double most = 1;
    [[nodiscard]] double part(double value) const { return (value - least) / (most - least); }
};

// Values that are no numbers are left out.
Range range_of(const std::vector<double>& values) {
    Range range{.least = INFINITY, .most = -INFINITY};
    for (const double value : values)
        if (std::isfinite(value)) range = {std::min(range.least, value), std::max(range.most, value)};
    if (!std::isfinite(range.least)) return {};
    if (range.most - range.least < 1e-9) return {range.least - 1, range.most + 1};
    return range;
}

double x_of(const Range& times, double time) { return kLeft + times.part(time) * (kWidth - kLeft - kRight); }
double y_of(const Range& range, double value) {
    return kHeight - kBottom - range.part(value) * (kHeight - kTop - kBottom);
}

std::string path_of(const std::vector<double>& times_s, const std::vector<double>& values, const Range& times,
                    const Range& range) {
    std::string path;
    const std::size_t count = std::min(times_s.size(), values.size());
    const std::size_t step = std::max<std::size_t>(1, count / kSteps);
    for (std::size_t n = 0; n < count; n += step) {
        double least = INFINITY, most = -INFINITY;
        for (std::size_t k = n; k < std::min(n + step, count); ++k)
            if (std::isfinite(values[k])) {
                least = std::min(least, values[k]);
                most = std::max(most, values[k]);
            }
        if (!std::isfinite(least) || !std::isfinite(times_s[n])) continue;
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x_of(times, times_s[n]), y_of(range, least));
        if (most > least) path += fmt::format("V{:.1f}", y_of(range, most));
    }
    return path;
}

// Enough digits to tell the ends of the range apart.
std::string tick_text(const Range& range, double value) {
    const double largest = std::max(std::abs(range.least), std::abs(range.most));
    const double needed = std::log10(std::max(largest, 1e-9) / (range.most - range.least)) + 2;
    return fmt::format("{:.{}g}", value, std::clamp(static_cast<int>(std::ceil(needed)), 4, 10));
}

Markup text_at(double x, double y, std::string_view anchor, std::string_view text) {
    return tag("text", fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"", x, y, anchor), text);
}

}  // namespace

Markup curve_picture(std::string_view title, std::string_view unit, const std::vector<double>& times_s,
                     const std::vector<double>& values) {
    const Range times = range_of(times_s), range = range_of(values);
    Markup content = text_at(kLeft, 14, "start", fmt::format("{}, {}", title, unit));
    for (const double part : {0.0, 0.5, 1.0}) {
        const double value = range.least + part * (range.most - range.least);
        const double y = y_of(range, value);
        content +=
            tag("path", fmt::format("class=\"axis\" d=\"M{:.1f} {:.1f}H{:.1f}\"", kLeft, y, kWidth - kRight), {});
        content += text_at(kLeft - 6, y + 4, "end", tick_text(range, value));
        const double time = times.least + part * (times.most - times.least);
        content += text_at(x_of(times, time), kHeight - 6,
                           part == 0   ? "start"
                           : part == 1 ? "end"
                                       : "middle",
                           tick_text(times, time) + " s");
    }
    content += tag("path", fmt::format("class=\"curve\" d=\"{}\"", path_of(times_s, values, times, range)), {});
    return tag("svg",
               fmt::format(
                   "xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" role=\"img\" viewBox=\"0 0 {:.0f} {:.0f}\"{}",
                   kWidth, kHeight, attribute("aria-label", title)),
               content) +
           Markup::raw("\n");
}

}  // namespace margay::segment_report
