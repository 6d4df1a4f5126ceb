#include "common/cycle_report.hpp"

#include "common/counted.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

namespace margay::samples {
namespace {

std::string time_text(Duration time) {
    const auto ns = static_cast<double>(time.count());
    if (ns < 1e3) return fmt::format("{:.0f} ns", ns);
    if (ns < 1e6) return fmt::format("{:.3g} µs", ns / 1e3);
    if (ns < 1e9) return fmt::format("{:.3g} ms", ns / 1e6);
    return fmt::format("{:.3g} s", ns / 1e9);
}

// Joins four buckets to one bar, from the first bucket with a count to the last one.
std::vector<DurationHistogram::Bucket> bars_of(const DurationHistogram& histogram) {
    constexpr std::size_t kJoined = 4;
    std::vector<DurationHistogram::Bucket> bars;
    for (std::size_t i = 0; i < DurationHistogram::kBuckets; i += kJoined) {
        auto bar = histogram.bucket(i);
        for (std::size_t n = 1; n < kJoined; ++n) {
            const auto next = histogram.bucket(i + n);
            bar.to = next.to;
            bar.count += next.count;
        }
        if (bar.count != 0 || !bars.empty()) bars.push_back(bar);
    }
    while (!bars.empty() && bars.back().count == 0) bars.pop_back();
    return bars;
}

// Logarithmic. A count of 1 gives 1, so that single outliers are visible beside thousands.
double height(std::uint64_t count) { return count == 0 ? 0 : 1 + std::log10(static_cast<double>(count)); }

std::uint64_t tallest(const std::vector<DurationHistogram::Bucket>& bars) {
    std::uint64_t most = 1;
    for (const auto& bar : bars) most = std::max(most, bar.count);
    return most;
}

std::string quantiles(const DurationHistogram& h) {
    if (h.count() == 0) return "none";
    return fmt::format("min {}, median {}, 99 % {}, 99.9 % {}, max {}", time_text(h.min()), time_text(h.quantile(0.5)),
                       time_text(h.quantile(0.99)), time_text(h.quantile(0.999)), time_text(h.max()));
}

std::string counts(const CycleFigures& f) {
    auto text = fmt::format("{}, {}, {} without all frames, {} with a wrong working counter",
                            counted(f.cycles, "cycle"), counted(f.overruns, "overrun"), f.no_frame, f.wrong_wkc);
    if (f.overruns + f.skipped + f.caught_up != 0)
        text += fmt::format("; after overruns {} left out, {} made up for", f.skipped, f.caught_up);
    if (f.missed != 0) text += "; " + counted(f.missed, "frame not sent at its time", "frames not sent at their time");
    if (f.wire.unstamped != 0) text += fmt::format("; {} without time stamps of the NIC", f.wire.unstamped);
    return text;
}

struct Named {
    std::string_view key;   // in JSON
    std::string_view name;  // for people
    const DurationHistogram& times;
};

constexpr std::string_view kWirePeriod = "time between cycles on the wire, by the NIC";
constexpr std::string_view kWireRoundTrip = "round trip on the wire, by the NIC";

std::vector<Named> histograms_of(const CycleFigures& f) {
    std::vector<Named> all{{"lateness", "wake-up after the deadline", f.lateness},
                           {"period", "time between wake-ups", f.period},
                           {"sent", "frames sent after the deadline", f.sent},
                           {"received", "frames back after the deadline", f.received},
                           {"round_trip", "round trip", f.round_trip}};
    if (!f.wire.any()) return all;
    all.push_back({"wire_period", kWirePeriod, f.wire.period});
    all.push_back({"wire_round_trip", kWireRoundTrip, f.wire.round_trip});
    return all;
}

std::string histogram_text(std::string_view name, const DurationHistogram& histogram) {
    constexpr double kColumns = 50;
    auto text = fmt::format("{}: {}\n", name, quantiles(histogram));
    const auto bars = bars_of(histogram);
    const double full = height(tallest(bars));
    bool gap = false;
    for (const auto& bar : bars) {
        if (bar.count == 0) {
            if (!gap) text += "  …\n";
            gap = true;
            continue;
        }
        gap = false;
        const auto columns = static_cast<std::size_t>(std::lround(height(bar.count) / full * kColumns));
        text += fmt::format("  from {:>8}  {:>10}  {}\n", time_text(bar.from), bar.count, std::string(columns, '#'));
    }
    return text;
}

constexpr double kWidth = 800;
constexpr double kPanel = 240;
constexpr double kLeft = 70;
constexpr double kBars = 150;

std::string panel_svg(std::string_view name, const DurationHistogram& histogram, double top) {
    const auto bars = bars_of(histogram);
    const double base = top + 40 + kBars;
    auto svg = fmt::format("<text x=\"{}\" y=\"{}\" class=\"title\">{}</text>\n<text x=\"{}\" y=\"{}\">{}</text>\n",
                           kLeft, top + 14, name, kLeft, top + 32, quantiles(histogram));
    if (bars.empty()) return svg;
    const auto scale = [](Duration time) { return std::log2(std::max(1.0, static_cast<double>(time.count()))); };
    const double from = scale(bars.front().from);
    const double per_unit = (kWidth - kLeft - 20) / std::max(0.25, scale(bars.back().to) - from);
    const double full = height(tallest(bars));
    for (const auto& bar : bars) {
        if (bar.count == 0) continue;
        const double x = kLeft + (scale(bar.from) - from) * per_unit;
        const double high = height(bar.count) / full * kBars;
        svg += fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"><title>{} to {}: {}</title></rect>\n",
            x, base - high, std::max(1.0, (scale(bar.to) - scale(bar.from)) * per_unit - 1), high, time_text(bar.from),
            time_text(bar.to), bar.count);
    }
    for (std::uint64_t count = 1; height(count) <= full; count *= 10) {
        const double y = base - height(count) / full * kBars;
        svg += fmt::format(
            "<line x1=\"{}\" y1=\"{:.1f}\" x2=\"{}\" y2=\"{:.1f}\"/><text x=\"{}\" y=\"{:.1f}\" "
            "class=\"count\">{}</text>\n",
            kLeft, y, kWidth - 20, y, kLeft - 6, y + 4, count);
    }
    constexpr std::size_t kLabels = 8;
    const std::size_t every = (bars.size() + kLabels - 1) / kLabels;
    for (std::size_t i = 0; i < bars.size(); i += every)
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n",
                           kLeft + (scale(bars[i].from) - from) * per_unit, base + 16, time_text(bars[i].from));
    return svg;
}

}  // namespace

std::string cycle_text(const CycleFigures& figures) {
    auto text = counts(figures) + "\n";
    for (const Named& one : histograms_of(figures)) text += histogram_text(one.name, one.times);
    return text;
}

std::string wire_text(const WireFigures& wire) {
    auto text = fmt::format("{}: {}\n{}: {}\n", kWirePeriod, quantiles(wire.period), kWireRoundTrip,
                            quantiles(wire.round_trip));
    if (wire.unstamped != 0) text += counted(wire.unstamped, "cycle") + " without time stamps of the NIC\n";
    return text;
}

std::string cycle_svg(const CycleFigures& figures) {
    const auto all = histograms_of(figures);
    const double panels = static_cast<double>(all.size()) * kPanel;
    auto svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"cycle-figures\" width=\"{0}\" height=\"{1}\" "
        "viewBox=\"0 0 {0} {1}\">\n"
        "<style>.cycle-figures text{{font:12px sans-serif;fill:var(--cycle-ink,#333)}}.cycle-figures .title"
        "{{font-weight:bold}}.cycle-figures .count{{text-anchor:end}}.cycle-figures "
        "rect{{fill:var(--cycle-bar,#3a7ca5)}}"
        ".cycle-figures line{{stroke:var(--cycle-grid,#ccc)}}</style>\n",
        kWidth, panels + 40);
    double top = 10;
    for (const Named& one : all) {
        svg += panel_svg(one.name, one.times, top);
        top += kPanel;
    }
    svg += fmt::format("<text x=\"{}\" y=\"{}\">{}</text>\n</svg>\n", kLeft, panels + 25, counts(figures));
    return svg;
}

std::string cycle_json(const CycleFigures& figures) {
    nlohmann::ordered_json json{{"cycles", figures.cycles},
                                {"overruns", figures.overruns},
                                {"skipped", figures.skipped},
                                {"caught_up", figures.caught_up},
                                {"without_all_frames", figures.no_frame},
                                {"wrong_working_counter", figures.wrong_wkc}};
    if (figures.missed != 0) json["not_sent_at_their_time"] = figures.missed;
    if (figures.wire.unstamped != 0) json["without_stamps"] = figures.wire.unstamped;
    for (const Named& one : histograms_of(figures)) {
        const auto& times = one.times;
        auto& part = json[std::string(one.key) + "_ns"];
        part["count"] = times.count();
        if (times.count() != 0) {  // there is no minimum without a value
            part["min"] = times.min().count();
            part["mean"] = times.mean().count();
            part["median"] = times.quantile(0.5).count();
            part["p99"] = times.quantile(0.99).count();
            part["p99.9"] = times.quantile(0.999).count();
            part["p99.99"] = times.quantile(0.9999).count();
            part["max"] = times.max().count();
        }
        part["buckets"] = nlohmann::ordered_json::array();
        for (std::size_t i = 0; i < DurationHistogram::kBuckets; ++i)
            if (const auto bucket = times.bucket(i); bucket.count != 0)
                part["buckets"].push_back(
                    {{"from", bucket.from.count()}, {"to", bucket.to.count()}, {"count", bucket.count}});
    }
    return json.dump(2) + "\n";
}

}  // namespace margay::samples
