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
    Result<std::uint32_t> last;      // result of the last cycle
    CycleFigures figures;            // "incomplete" counts cycles in which frames were missing
    std::deque<std::string> events;  // newest last
};

// A slave at each end of a cable counts the interruptions of the cable, so the library reports an interruption twice.
class CableReports {
  public:
    // `window`: within this time both ends report the same interruption; less than SuperviseRequest::line_interval.
    explicit CableReports(Duration window) : window_(window) {}
    // Whether this event is the report of the other end of a cable that one end has reported already.
    [[nodiscard]] bool repeats(const Event& event);

  private:
    Duration window_;
    std::vector<Event> last_;  // the last report of each cable
};

// Returns at most `height` lines of at most `width` columns: the head, the slaves from number `scroll` + 1, and the
// newest events.
[[nodiscard]] std::vector<std::string> monitor_lines(const MonitorModel& model, std::size_t width, std::size_t height,
                                                     std::size_t scroll);

// A histogram in one line: a character for each doubling from 64 ns to 16 ms. A higher character means a larger count.
[[nodiscard]] std::string spark_line(const DurationHistogram& histogram);

}  // namespace margay::samples
