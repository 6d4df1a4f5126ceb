// The log of MasterClock as CSV.
#include "util/text_writer.hpp"

#include <margay/master_clock.hpp>

#include <algorithm>

namespace margay {
namespace {

void write_signed(TextWriter& out, std::int64_t value) {
    if (value < 0) out << "-";
    out << (value < 0 ? 0U - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value));
}

// Writes `value`, which is in thousandths.
void write_thousandths(TextWriter& out, std::int64_t value) {
    const std::uint64_t magnitude =
        value < 0 ? 0U - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
    const std::uint64_t rest = magnitude % 1000;
    out << (value < 0 ? "-" : "") << magnitude / 1000 << (rest < 10 ? ".00" : rest < 100 ? ".0" : ".") << rest;
}

std::int64_t tenths_of_permil(const ClockRecord& record) {
    constexpr std::int64_t kMost = INT64_MAX / 10'000;
    return record.cycle_ns <= 0 ? 0 : std::clamp(record.error_ns, -kMost, kMost) * 10'000 / record.cycle_ns;
}

// The drift in one cycle, in thousandths of a nanosecond.
std::int64_t drift_of_cycle(const ClockRecord& record) {
    constexpr std::int64_t kMillion = 1'000'000;
    constexpr std::int64_t kMost = INT64_MAX / kMillion / 2;
    const std::int64_t cycle_ns = std::clamp(record.cycle_ns, -kMost, kMost);
    return record.drift_ppb / kMillion * cycle_ns + record.drift_ppb % kMillion * cycle_ns / kMillion;
}

}  // namespace

std::string_view write_clock_log_head(std::span<char> out) {
    TextWriter writer(out);
    writer << "Time[ms],SyncSetVal [ns],BusTime [ns],BusTimeOff [ns],CtlAdj [ns],CtlErr [ns],CtlErrFilt [ns],Drift "
              "[ppm],CtlErr [1/10 pmil],CtlOutSum [ns],CtlOutTot [ns],DCStartTime [ns],DCMErrorCode,DCMInSync,DCInSync,"
              "SystemTimeDifference [ns]\n";
    return writer.text();
}

std::string_view write_clock_log(const ClockRecord& record, std::span<char> out) {
    TextWriter writer(out);
    write_thousandths(writer, (record.at - Time{}).count() / 1000);
    const auto next = [&writer](std::int64_t value) {
        writer << ",";
        write_signed(writer, value);
    };
    next(record.set_value_ns);
    writer << "," << record.bus_time_ns << "," << record.bus_time_off_ns;
    next(record.adjust_ns);
    next(record.error_ns);
    next(record.filtered_ns);
    writer << ",";
    write_thousandths(writer, record.drift_ppb);
    next(tenths_of_permil(record));
    writer << ",";
    write_thousandths(writer, drift_of_cycle(record));
    next(record.adjusted_ns);
    writer << "," << record.start_time_ns << "," << static_cast<std::uint64_t>(record.state);
    writer << "," << (record.state == PhaseState::in_sync ? "1" : "0") << "," << (record.clocks_in_sync ? "1" : "0");
    writer << "," << std::uint64_t{record.difference_ns} << "\n";
    return writer.text();
}

}  // namespace margay
