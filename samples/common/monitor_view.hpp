// Writes the view of segment_monitor as lines of text, the same lines for a terminal and for a log.
#pragma once

#include "common/cycle_report.hpp"

#include <margay/context.hpp>
#include <margay/supervision.hpp>

#include <deque>
#include <span>
#include <string>
#include <vector>

namespace margay::samples {

struct MonitorModel {
    std::string source;
    std::span<const Slave> slaves;
    std::span<const LineErrors> line_errors;  // slave 1 first
    std::uint32_t expected_wkc = 0;
    Result<std::uint32_t> last;  // result of the last cycle
    CycleFigures figures;
    std::deque<std::string> events;  // newest last
};

// Returns at most `height` lines of at most `width` columns: the head, the slaves from number `scroll` + 1, and the
// newest events.
[[nodiscard]] std::vector<std::string> monitor_lines(const MonitorModel& model, std::size_t width, std::size_t height,
                                                     std::size_t scroll);

// A histogram in one line: a character for each doubling from 64 ns to 16 ms. A higher character means a larger count.
[[nodiscard]] std::string spark_line(const DurationHistogram& histogram);

}  // namespace margay::samples
