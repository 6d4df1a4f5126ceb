#include "common/gnuplot.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>

namespace margay::samples {
namespace {

// A string of gnuplot in single quotes, where only the quote itself is special.
std::string gnuplot_string(const std::string& text) {
    std::string out = "'";
    for (const char c : text) {
        if (c == '\'') out += '\'';
        if (c != '\n' && c != '\r') out += c;
    }
    return out + "'";
}

std::string gnuplot_script(const std::string& path, const std::vector<double>& times_s,
                           const std::vector<Diagram>& diagrams) {
    std::string text = "$rows << END_OF_ROWS\n";
    for (std::size_t row = 0; row < times_s.size(); ++row) {
        text += fmt::format("{:.6f}", times_s[row]);
        for (const Diagram& diagram : diagrams)
            for (const Diagram::Curve& curve : diagram.curves) text += fmt::format(" {}", curve.values[row]);
        text += '\n';
    }
    text += fmt::format("END_OF_ROWS\nset terminal svg size 1000,{} background rgb 'white'\nset output {}\n",
                        260 * diagrams.size(), gnuplot_string(path));
    text += fmt::format("set multiplot layout {},1\nset grid\nset xlabel 's'\n", diagrams.size());
    std::size_t column = 2;
    for (const Diagram& diagram : diagrams) {
        text += fmt::format("set title {} noenhanced\nset ylabel {} noenhanced\nplot ", gnuplot_string(diagram.title),
                            gnuplot_string(diagram.unit));
        for (std::size_t n = 0; n < diagram.curves.size(); ++n, ++column)
            text += fmt::format("{}$rows using 1:{} with lines title {} noenhanced", n == 0 ? "" : ", ", column,
                                gnuplot_string(diagram.curves[n].name));
        text += '\n';
    }
    return text + "unset multiplot\nset output\n";
}

}  // namespace

std::string draw_svg(const std::string& path, const std::vector<double>& times_s,
                     const std::vector<Diagram>& diagrams) {
    constexpr const char* kMissing = "gnuplot could not draw; is the package gnuplot-nox installed?";
    if (times_s.empty()) return "there is nothing to draw";
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    std::FILE* pipe = ::popen("gnuplot 2>/dev/null", "w");
    if (pipe == nullptr) return kMissing;
    const std::string text = gnuplot_script(path, times_s, diagrams);
    const bool written = std::fwrite(text.data(), 1, text.size(), pipe) == text.size();
    const bool ended = ::pclose(pipe) == 0;
    if (!written || !ended) return kMissing;
    const bool there = std::filesystem::exists(path, ignored) && std::filesystem::file_size(path, ignored) > 0;
    return there ? std::string() : "gnuplot could not write " + path;
}

}  // namespace margay::samples
