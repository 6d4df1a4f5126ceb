// Curves over time as SVG.
#pragma once

#include "segment_report/markup.hpp"

#include <string_view>
#include <vector>

namespace margay::segment_report {

// Long curves are drawn by the least and the greatest value of each step, so that no peak is lost.
[[nodiscard]] Markup curve_picture(std::string_view title, std::string_view unit, const std::vector<double>& times_s,
                                   const std::vector<double>& values);

}  // namespace margay::segment_report
