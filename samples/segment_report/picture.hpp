// The topology as SVG: boxes for slaves, lines for cables.
#pragma once

#include "segment_report/cables.hpp"
#include "segment_report/markup.hpp"
#include "segment_report/report.hpp"

namespace margay::segment_report {

// A line of slaves extends to the right and continues in the next row. A branch begins in a row below its slave. The
// colour of a cable is that of its health; cables with errors have the number of damaged frames beside them.
[[nodiscard]] Markup topology_picture(const Report& report, const std::vector<Cable>& cables);

}  // namespace margay::segment_report
