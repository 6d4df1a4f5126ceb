// Draws curves by gnuplot (Debian package gnuplot-nox), which is started as a program of its own.
#pragma once

#include <string>
#include <vector>

namespace margay::samples {

// One diagram. All curves of a drawing have the same times.
struct Diagram {
    std::string title;
    std::string unit;  // of the vertical axis
    struct Curve {
        std::string name;
        std::vector<double> values;  // one for each time
    };
    std::vector<Curve> curves;
};

// Writes the diagrams, one below the other, as SVG into the file `path`. `times_s`: the horizontal axis in seconds.
// Returns a sentence about the failure, or an empty text.
[[nodiscard]] std::string draw_svg(const std::string& path, const std::vector<double>& times_s,
                                   const std::vector<Diagram>& diagrams);

}  // namespace margay::samples
