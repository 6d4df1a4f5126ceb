// Reads the log of a MasterClock (CSV, see master_clock.hpp), and draws it.
#pragma once

#include "common/gnuplot.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

struct ClockLog {
    std::vector<double> times_s;    // since the first line
    std::vector<double> offset_ns;  // the reference clock within its cycle
    std::vector<double> drift_ppm;
    std::vector<double> error_ns;
    std::vector<double> difference_ns;  // of the slaves' clocks
    // Only for logs with the columns DCMInSync, DCInSync and DCMErrorCode.
    std::size_t first_in_sync = 0;  // line; 0: none, or no columns
    std::size_t out_of_sync = 0;    // later lines where the master's clock or the slaves' clocks are not in sync
    std::size_t first_out = 0;      // the first of these lines
    unsigned first_code = 0;        // PhaseState in this line
    bool tells_sync = false;        // the log has the columns
    std::string fault{};            // why the text is not a log; empty: it is a log
};

// The columns are found by their names in the first line, so that logs of other masters with the same columns can be
// drawn. Separators: comma, semicolon or tabulator. Times must not decrease.
[[nodiscard]] ClockLog parse_clock_log(std::string_view text);

[[nodiscard]] std::vector<Diagram> clock_diagrams(const ClockLog& log);

}  // namespace margay::samples
