#include "common/clock_log_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

namespace margay::samples {
namespace {

std::string_view trimmed_cell(std::string_view text) {
    while (!text.empty() && (text.front() == ' ' || text.front() == '"')) text.remove_prefix(1);
    while (!text.empty() && (text.back() == ' ' || text.back() == '"' || text.back() == '\r')) text.remove_suffix(1);
    return text;
}

std::vector<std::string_view> cells_of(std::string_view line) {
    std::vector<std::string_view> cells;
    for (;;) {
        const std::size_t end = line.find_first_of(",;\t");
        cells.push_back(trimmed_cell(line.substr(0, end)));
        if (end == std::string_view::npos) return cells;
        line.remove_prefix(end + 1);
    }
}

std::string_view next_log_line(std::string_view& text) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return line;
}

std::optional<double> number_of(std::string_view cell) {
    double value = 0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

// The column whose name begins with `name`.
std::optional<std::size_t> column_of(const std::vector<std::string_view>& head, std::string_view name) {
    const auto at = std::ranges::find_if(head, [name](std::string_view cell) { return cell.starts_with(name); });
    if (at == head.end()) return std::nullopt;
    return static_cast<std::size_t>(at - head.begin());
}

// The columns that show whether the clocks are in sync. A log of another master may lack them.
class SyncColumns {
  public:
    explicit SyncColumns(const std::vector<std::string_view>& head)
        : master_(column_of(head, "DCMInSync")),
          slaves_(column_of(head, "DCInSync")),
          code_(column_of(head, "DCMErr")) {}
    // Returns the first text that is not a number; empty: all texts are numbers.
    std::string_view take(const std::vector<std::string_view>& cells, std::size_t line, ClockLog& log) const {
        if (!master_ || !slaves_ || !code_) return {};
        const auto cell = [&](std::size_t at) { return at < cells.size() ? number_of(cells[at]) : std::nullopt; };
        const auto master = cell(*master_);
        const auto slaves = cell(*slaves_);
        const auto code = cell(*code_);
        if (!master || !slaves || !code) return !master ? "DCMInSync" : !slaves ? "DCInSync" : "DCMErrorCode";
        log.tells_sync = true;
        if (*master != 0 && *slaves != 0) {
            if (log.first_in_sync == 0) log.first_in_sync = line;
        } else if (log.first_in_sync != 0 && log.out_of_sync++ == 0) {
            log.first_out = line;
            log.first_code = static_cast<unsigned>(std::clamp(*code, 0.0, 255.0));
        }
        return {};
    }

  private:
    std::optional<std::size_t> master_{}, slaves_{}, code_{};
};

}  // namespace

ClockLog parse_clock_log(std::string_view text) {
    ClockLog log;
    const auto head = cells_of(next_log_line(text));
    struct Wanted {
        std::string_view name;
        std::vector<double> ClockLog::*into;
        double scale = 1;
        std::size_t at = 0;
    };
    std::array<Wanted, 5> columns{{{"Time", &ClockLog::times_s, 1e-3},
                                   {"BusTimeOff", &ClockLog::offset_ns},
                                   {"Drift", &ClockLog::drift_ppm},
                                   {"CtlErr", &ClockLog::error_ns},
                                   {"SystemTimeDifference", &ClockLog::difference_ns}}};
    for (Wanted& wanted : columns) {
        const auto at = column_of(head, wanted.name);
        if (!at) {
            log.fault = fmt::format("the first line has no column {}", wanted.name);
            return log;
        }
        wanted.at = *at;
    }
    const SyncColumns sync(head);
    for (std::size_t line = 2; !text.empty(); ++line) {
        const auto cells = cells_of(next_log_line(text));
        if (cells.size() == 1 && cells[0].empty()) continue;
        if (cells.size() > head.size()) {  // such as decimal commas
            log.fault = fmt::format("line {} has {} cells, and the first line {}", line, cells.size(), head.size());
            return log;
        }
        for (const Wanted& wanted : columns) {
            const auto value = wanted.at < cells.size() ? number_of(cells[wanted.at]) : std::nullopt;
            if (!value) {
                log.fault = fmt::format("line {}: {} is no number", line, wanted.name);
                return log;
            }
            (log.*wanted.into).push_back(*value * wanted.scale);
        }
        const auto count = log.times_s.size();
        if (const auto odd = sync.take(cells, line, log); !odd.empty())
            log.fault = fmt::format("line {}: {} is no number", line, odd);
        else if (count > 1 && log.times_s[count - 1] < log.times_s[count - 2])
            log.fault = fmt::format("line {}: the time is before that of the line before", line);
        if (!log.fault.empty()) return log;
    }
    if (log.times_s.empty()) log.fault = "it has no lines";
    const double first = log.times_s.empty() ? 0 : log.times_s.front();
    for (double& time : log.times_s) time -= first;
    return log;
}

std::vector<Diagram> clock_diagrams(const ClockLog& log) {
    return {{"Time of the reference clock within its cycle", "ns", {{"offset", log.offset_ns}}},
            {"Drift between the master and the reference clock", "ppm", {{"drift", log.drift_ppm}}},
            {"Error of the phase", "ns", {{"error", log.error_ns}}},
            {"Greatest difference of the slaves' clocks (upper estimate)", "ns", {{"difference", log.difference_ns}}}};
}

}  // namespace margay::samples
