// Writes to the reference clock beside the cycle, for the clocks that steer it.
#pragma once

#include "network/clocks.hpp"

#include <margay/phase_controller.hpp>

namespace margay {

struct Master;

// Whether the clock of the reference is set: the slave is not lost, and it is not being brought back. A write to a
// clock that was reset would hide the reset, and its time is not the system time.
[[nodiscard]] bool has_reference_clock(Network& network);

// Writes a register of the reference clock: all 8 octets, or 4 octets if the clock has 32 bits. A lost write is not
// repeated, because the next value follows. `waits`: the write is sent with the next cycle, otherwise now.
void send_to_reference(Master& master, wire::Register r, std::uint64_t value, bool waits);

// Whether a datagram that is queued now is sent with the next cycle. Then it changes the reference clock after the
// cycle has read its time. With long cycles, or if the cycle has no room for queued datagrams, the queue does not wait
// for the cycle. `sent`: when the last cycle was sent.
[[nodiscard]] bool waits_for_cycle(Network& network, Time sent, Duration cycle);

// Moves the system time of the reference clock back by `correction_ns` (register 0x0920) in this cycle. Without
// `waits`, the next reading shows it.
void shift_reference(Master& master, std::int64_t correction_ns, Duration cycle, bool waits);

// One cycle that has brought no error for `controller`, which steers the reference clock. Returns the correction.
// `read`: the cycle has read the time of the reference clock. Otherwise the corrections may be lost, too: the reference
// then loses the rate that the other clocks have learned, so they are not in sync soon.
[[nodiscard]] std::int64_t coast_reference(Master& master, PhaseController& controller, bool read, Time sent,
                                           Duration cycle);

// Whether there is a cycle, and the set value is less than a cycle.
[[nodiscard]] constexpr bool is_in_cycle(Duration set_value, Duration cycle) {
    return cycle > Duration{0} && set_value < cycle && set_value > -cycle;
}

// The time of the reference clock that the cycle of the group has brought, sent at `at`: all 64 bits, also where the
// clock has 32 and wraps. `last`: the time before that, at `last_at`; 0: none.
[[nodiscard]] std::uint64_t whole_bus_time(Network& network, const ProcessGroup& group, Time at, std::uint64_t last,
                                           Time last_at);

}  // namespace margay
