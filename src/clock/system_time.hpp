// Offsets of clocks, and start times of SYNC signals.
#pragma once

#include <cstdint>

namespace margay {

// The value of ESC register 0x0920 (System Time Offset): then the clock, which showed `local_ns` when the frame passed
// the slave, agrees with a reference clock that showed `system_ns` when the frame passed the reference clock `delay_ns`
// before. For a clock of 32 bits, the low half counts.
[[nodiscard]] constexpr std::uint64_t clock_offset_ns(std::uint64_t system_ns, std::int64_t delay_ns,
                                                      std::uint64_t local_ns) {
    return system_ns + static_cast<std::uint64_t>(delay_ns) - local_ns;
}

// The system time of 64 bits whose low half is `low`, nearest to `near_ns`.
[[nodiscard]] constexpr std::uint64_t extend_time_ns(std::uint32_t low, std::uint64_t near_ns) {
    return near_ns + static_cast<std::uint64_t>(
                         std::int64_t{static_cast<std::int32_t>(low - static_cast<std::uint32_t>(near_ns))});
}

// The same for a time that has passed: up to 4.02 s before `now_ns`. `now_ns` is an estimate: the time may be up to
// 268 ms after it.
[[nodiscard]] constexpr std::uint64_t extend_past_time_ns(std::uint32_t low, std::uint64_t now_ns) {
    constexpr std::uint32_t kAhead = 0x1000'0000;
    const std::uint64_t latest_ns = now_ns + kAhead;
    return latest_ns - (static_cast<std::uint32_t>(latest_ns) - low);
}

// The first time at or after `earliest_ns` that is a whole multiple of `grid_ns`, plus `shift_ns`. So all slaves with
// the same grid have the same phase, whenever they start. A grid of 0: `earliest_ns` itself, plus the shift where it is
// positive.
[[nodiscard]] constexpr std::uint64_t start_time_ns(std::uint64_t earliest_ns, std::uint64_t grid_ns,
                                                    std::int64_t shift_ns) {
    if (grid_ns == 0) return earliest_ns + static_cast<std::uint64_t>(shift_ns > 0 ? shift_ns : 0);
    const auto grid = static_cast<std::int64_t>(grid_ns);
    const std::int64_t shift = shift_ns % grid;
    const auto phase = static_cast<std::uint64_t>(shift < 0 ? shift + grid : shift);
    const std::uint64_t into = (earliest_ns % grid_ns + grid_ns - phase) % grid_ns;
    return into == 0 ? earliest_ns : earliest_ns + (grid_ns - into);
}

// The period of both SYNC signals together (ESC data sheets, "SyncSignal generation"): SYNC1 follows every
// (cycle1 / cycle0 + 1)th SYNC0.
[[nodiscard]] constexpr std::uint64_t sync_period_ns(std::uint32_t sync0_cycle_ns, std::uint32_t sync1_cycle_ns) {
    if (sync0_cycle_ns == 0) return 0;
    return (std::uint64_t{sync1_cycle_ns} / sync0_cycle_ns + 1) * sync0_cycle_ns;
}

}  // namespace margay
