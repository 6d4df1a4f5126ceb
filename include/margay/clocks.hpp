// Distributed clocks: the clocks of the slaves run synchronously with the clock of one slave, the reference clock, and
// generate the SYNC signals of the slaves (ETG.1000.4 "Distributed clock").
//
//     config_init(ctx);
//     configdc(ctx, {.cycle = 1ms});   // slaves in PREOP: delays, offsets, and the drift until all clocks are in sync
//     config_map(ctx, image);          // activates SYNC for the slaves whose SlaveSetup::dc says so, before SAFEOP
//     …
//     SuperviseRequest                 // watches the clocks; gives clock and SYNC back to a slave that was lost
//
// The time of the reference clock is sent to all slaves behind it in the ring with each cycle of one group
// (Group::dc_time). System time is the time that all clocks show: nanoseconds since an origin that ClockSettings sets.
#pragma once

#include <margay/context.hpp>
#include <margay/request.hpp>

#include <cstdint>

namespace margay {

// The clock of a slave, as its registers show it. The features register of some chips shows a clock that is switched
// off, so the library does not use that register.
enum class ClockKind : std::uint8_t {
    unknown,        // configdc() has not examined the clock
    none,           // no clock, no receive times: delays at its branches assume that its cables are equally long
    receive_times,  // no clock that runs, but receive times: the delay behind the slave can be measured
    bits32,         // a clock of 32 bits: it wraps every 4.29 s
    bits64,
};
[[nodiscard]] std::string_view to_text(ClockKind kind);

// What is known about the clock of one slave.
struct SlaveClock {
    ClockKind kind = ClockKind::unknown;
    // Delay and offset are written: the slave follows the reference clock, or is that clock. False for a clock before a
    // chosen reference (ClockSettings::reference).
    bool synchronised = false;
    // The difference has stayed within ClockSettings::limit_ns for ClockSettings::settle, measured after the slave was
    // lost last. While no time reaches a clock (after a break, or when the slave with the reference clock is lost), the
    // clock stays in sync for a second at most; with cycles of 4 ms and more, for 1.5 s. A supervision updates this
    // member. Without a supervision, or with a watch_interval of zero, the member becomes false when the slave is seen
    // to be lost, and stays false. While bus shift moves the reference clock faster than the other clocks can follow,
    // the other clocks are not in sync. Behind a break of a ring with two NICs: see redundancy.hpp.
    bool in_sync = false;
    bool sync_active = false;  // SYNC signals were activated
    // How long a SYNC signal stays active: ESC register 0x0982, which the chip loads from the SII. The library reads
    // the register in configdc() and when it activates SYNC signals. 0: the signal stays active until the slave's
    // program acknowledges it by reading register 0x098E or 0x098F; without the acknowledgement there is no second
    // edge. Negative: the slave has no such register.
    std::int32_t pulse_ns = -1;
    std::uint32_t delay_ns = 0;  // from the first clock in the ring (ESC register 0x0928)
    // The difference between this clock and the reference clock, as read last (0x092C); negative: this clock is behind.
    // A supervision reads one slave in each watch_interval while all clocks are in sync, and all slaves otherwise.
    // Behind a break of a ring with two NICs: the difference to the second reference clock, plus the difference of both
    // reference clocks.
    std::int32_t difference_ns = 0;
    std::uint64_t offset_ns = 0;      // system time minus the slave's own time (0x0920)
    std::uint64_t sync_start_ns = 0;  // system time of the first SYNC0
    // The delay is assumed and not measured: a slave with branches and without receive times is between the first clock
    // and this clock. The delay is wrong by the difference between the delays of the cables of that slave, or by these
    // delays themselves where no slave before it has receive times (EventKind::delays_assumed). `in_sync` does not
    // include this error.
    bool delay_assumed = false;
};

struct ClockSettings {
    // The slave whose clock is the reference clock; 0: the first slave in the ring whose clock runs. The time of the
    // reference clock does not reach the slaves before it in the ring: their clocks are not synchronised
    // (EventKind::clock_not_reached names them), never become the reference, and get no SYNC signals
    // (Errc::clock_not_reached). The cycle brings these slaves the time that the master expects.
    std::uint16_t reference = 0;
    // The group whose cycle carries the time, unless GroupConfiguration::dc_reference of a group says otherwise.
    std::uint8_t group = 0;
    // How often the receive times are latched and read; the delays are the mean. 1 to 255.
    std::uint8_t measurements = 16;
    // Before the clocks are compared, this number of frames brings them the time of the reference clock, for 2 s at
    // most, so that each clock learns its drift ("static drift compensation"). `burst_bulk` of these frames may be on
    // the wire at the same time.
    std::uint16_t burst_frames = 10000;
    std::uint8_t burst_bulk = 12;
    // The datagrams that carry the time address the reference clock by its position in the ring (ARMW), and not by its
    // station address (FRMW). While a slave is missing or lost, they use the station address nevertheless. When a slave
    // before the reference clock is lost, another slave is at this position; until the supervision has seen the loss,
    // the datagrams use the clock of that other slave as the reference clock. So leave this false where a branch
    // without clocks before the reference clock may be disconnected.
    bool by_position = false;
    // The cycle of the SYNC signals of slaves whose SyncSettings do not set a cycle. The library compares each SYNC0
    // cycle with the cycle of the bus: that of the MasterClock, or, without a MasterClock, the cycle that the
    // supervision measures. A SYNC0 cycle that is neither a whole multiple nor a whole part of the bus cycle is an
    // error in Context::errors().
    Duration cycle = std::chrono::milliseconds(1);
    // SYNC0 starts at a whole multiple of this time (of system time), plus the shift of the slave: the same phase for
    // all slaves, also for a slave that comes back. A whole multiple of the cycle of every slave's SYNC signals. Zero:
    // the slave's own cycle; `cycle` for a single pulse.
    Duration start_grid{0};
    // How far in the future SYNC0 starts at least. If the slave is not activated before the start, because a frame was
    // lost or the time is short for cycles that are long, the library tries again with a later start.
    Duration start_delay = std::chrono::milliseconds(100);
    // System time is the time of the osal plus this time, at the moment of configdc().
    Duration system_time_at_zero{0};
    // A clock is in sync when its difference stays within `limit_ns` for `settle`; for configdc() also in 32
    // comparisons, or as many as fit into `timeout`.
    std::uint32_t limit_ns = 200;
    Duration settle = std::chrono::milliseconds(10);
    Duration timeout = std::chrono::seconds(3);  // for all clocks to be in sync
    // How often a supervision reads the differences. Zero: never.
    Duration watch_interval = std::chrono::milliseconds(10);
    // How often a supervision measures the delays again and corrects them ("continuous propagation delay
    // compensation"). Zero: never. In a ring with two NICs the measurement opens the ring, and the cycles bring no time
    // meanwhile (some 20 to 100 cycles): there at least eight times as long passes until the next measurement. A break
    // in this time cuts off the slaves behind the break for about a second (redundancy.hpp).
    Duration delay_interval{0};
    // When the slave with the reference clock is lost while a supervision runs: the next clock that is synchronised and
    // not behind the lost slave takes over with the same time and rate (true), or no time is sent until the slave is
    // back, and all clocks go on at their rates (false; also where the cycles that carry the time overlap).
    // EventKind::reference_lost and reference_clock report it. The last frame that was sent for the lost clock brings
    // the other clocks a time that the master has predicted. This time is wrong by the jitter of the cycle, and by the
    // propagation delay to a branch that is lost together with the clock. Where this is more than 50 µs (3 µs with two
    // NICs), the rate of the new reference begins anew, and the other clocks need about half a second to follow it:
    // they are not in sync, and events report that. When a slave with a clock returns to a place before the reference
    // clock in the ring, the clock of this slave learns the rate and becomes the reference again, without a step of the
    // other clocks (EventKind::reference_clock). If a branch with several clocks returns, its first clock becomes the
    // reference. This takes less than a second with cycles of 1 ms, and some seconds with longer cycles. If the clock
    // has not learned the rate after some seconds, as with cycles of 20 ms and one poll() in each, it has its own rate,
    // and the other clocks are not in sync until they have learned that rate.
    bool replace_lost_reference = true;
    // poll() calls this function with the start time of SYNC0 that the library proposes for a slave, in system time,
    // and writes the result of the function instead. nullptr: the proposed time is written. As a hook, the function
    // must neither wait nor call the library.
    std::uint64_t (*start_time)(std::uint16_t slave, std::uint64_t proposed_ns, void* user) = nullptr;
    void* start_time_user = nullptr;
};

// All clocks together, as configdc() or the supervision has seen them last.
struct ClockStatus {
    std::uint16_t reference = 0;  // the slave with the reference clock; 0: none
    bool in_sync = false;         // every present clock is in sync, except the clocks before a chosen reference
    // Less than twice the greatest difference of any of these clocks (ESC registers 0x092C, OR), or the difference of
    // both references of a ring with two NICs.
    std::uint32_t greatest_ns = 0;
    // The system time at the moment of the call: the time of the reference clock that the supervision has read last,
    // continued by the master's clock. With cycles of 10 ms and more, this may be half a second ago. All 64 bits, also
    // where the reference clock has 32.
    std::uint64_t system_time_ns = 0;
};

// A SuperviseRequest keeps SlaveClock::in_sync up to date. It also restores clocks: a slave that was reset gets its
// delay and its offset again before SAFEOP. A slave that was disconnected, has kept its power, and has a clock that
// differs by more than 100 µs is started again, because the control loop of its clock would need a long time. But if
// this slave has also kept its state, and is before the reference clock in the ring, the library sets its clock and
// starts its SYNC signals again. A reference clock to which another program has written a time gets its own rate again.

// Synchronises the clocks of all slaves; see configdc().
struct ClockRequest : Request {
    ClockRequest();
    ClockSettings settings;
    std::uint16_t reference = 0;  // result: number of the reference clock
};

// Finds out which slaves have a clock, measures the propagation delays, writes delays and offsets, and sends the time
// of the reference clock until all clocks are in sync. SYNC signals that are active are switched off. Returns the
// number of the slave with the reference clock. Call it in PREOP, after config_init() and before config_map(). Waits.
//
// Errors: no_clock (no slave has a clock that runs, or the chosen reference has none), missing_slave (the chosen
// reference), wrong_state (slave: the slave is in OP with SYNC signals; slave 0: there are no slaves yet), not_in_sync
// (slave: the clock with the greatest difference, expected: the limit, actual: the difference in ns; all other work is
// done, and a cycle may bring the clock into sync later), unstable (slave: the slave was lost or came back meanwhile;
// slave 0: the slaves in the ring have changed), invalid_argument, working_counter, no_frame, capacity, unsupported
// (slave: in a ring with two NICs the reference clock is at a branch that only the second NIC reaches; or the receive
// times of the slave do not show what is behind it).
Result<std::uint16_t> configdc(Context& ctx, const ClockSettings& settings = {});

// Activates or switches off the SYNC signals of one slave now; see dcsync0().
struct SyncRequest : SlaveRequest {
    SyncRequest();
    SyncSettings sync;  // as SlaveSetup::dc; source `none`: off
};

// Activates SYNC0 (dcsync01(): SYNC0 and SYNC1) of one slave with this cycle, or switches the signals off. The first
// SYNC0 occurs at least ClockSettings::start_delay later, at a whole multiple of the grid plus `shift`, which may be
// negative. A cycle of 0: one pulse only. The setting replaces SlaveSetup::dc until the next config_init(); it is used
// again when the slave starts again. Both functions wait. If the setting is refused before a register is written, the
// active signals continue. Errors: wrong_state (configdc() was not called), no_clock, clock_not_reached (the clock is
// before a chosen reference clock, or the slave with the reference clock is lost; expected: the slave with the
// reference clock), unknown_slave, invalid_argument (a cycle that is negative, does not fit 32 bits, does not fit
// ClockSettings::start_grid or is not longer than the pulse, SlaveClock::pulse_ns; a start that has passed, or is over
// 4.29 s ahead of a clock of 32 bits), working_counter, no_frame.
Result<> dcsync0(Context& ctx, std::uint16_t slave, bool active, Duration cycle0, Duration shift = Duration{0});
Result<> dcsync01(Context& ctx, std::uint16_t slave, bool active, Duration cycle0, Duration cycle1,
                  Duration shift = Duration{0});

// What is known about the clock of a slave; for a slave that does not exist, a clock of kind `unknown`. For the thread
// that owns the context; callable from the cycle.
[[nodiscard]] const SlaveClock& slave_clock(Context& ctx, std::uint16_t slave);
// `now`: the time of the osal. For the thread that owns the context; callable from the cycle.
[[nodiscard]] ClockStatus clock_status(Context& ctx, Time now);
// The slave with the reference clock; 0: none.
[[nodiscard]] std::uint16_t reference_clock(Context& ctx);

}  // namespace margay
