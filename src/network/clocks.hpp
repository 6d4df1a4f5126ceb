// The distributed clocks of the segment: measurement, offsets, drift, SYNC signals, and their supervision. The
// functions are reached through `Clocks::prepare` and `Clocks::watch`, which configure_clocks() sets: a program that
// does not use clocks does not link them.
#pragma once

#include "clock/delays.hpp"
#include "clock/port_times.hpp"
#include "clock/sync_watch.hpp"
#include "clock/system_time.hpp"
#include "util/task.hpp"

#include "wire/esc.hpp"

#include <margay/clocks.hpp>

#include <span>

namespace margay {

struct Network;
struct Station;
struct ProcessGroup;

// The register values of the SYNC signals.
struct SyncRegisters {
    std::uint16_t assign_activate = 0;  // 0: no SYNC signals
    bool misfit_told = false;           // the misfit with the cycle was reported: see note_sync_cycles()
    std::uint32_t sync0_cycle_ns = 0;
    std::uint32_t sync1_cycle_ns = 0;
    std::int64_t shift_ns = 0;
};

// The clock whose time the frames bring to a slave, as the ring is now.
struct FollowedClock {
    std::uint16_t slave = 0;    // the reference, or the second reference of a ring with two NICs; 0: no time arrives
    std::int64_t ahead_ns = 0;  // how far this clock is ahead of the reference; 0 also while the jitter hides it
    std::int64_t moves_ns = 0;  // by how much `ahead_ns` may change until the next round
    bool silent = false;        // the master has not seen the time of this clock since the last round
};

struct ClockEntry : SlaveClock {
    std::uint16_t follows = 0;      // the slave whose time arrives
    std::uint8_t times_seen = 0;    // frames that have brought this time since `follows` has changed
    std::uint8_t rounds_alone = 0;  // how often ClockSettings::watch_interval has passed without such a frame
    bool told_in_sync = false;      // no event has reported since then that the clock is out of sync
    std::uint64_t local_ns = 0;     // register 0x0918 of the last measurement
    SyncRegisters sync;             // from dcsync0(), where `sync_set` is true
    SyncWatch watch;
    [[no_unique_address]] PortTimes times;  // the small members behind it fill its last word
    bool sync_set : 1 = false;
    bool measured : 1 = false;     // its delay is known
    bool delay_waits : 1 = false;  // the register of the slave may have another delay (network/ring_ways.cpp)
    bool delay_old : 1 = false;    // measured for an earlier way of the frames, see find_old_delays()
    bool knows_rate : 1 = false;   // the clock was in sync since its control loop was started
    bool misled : 1 = false;   // the clock was in sync, but a frame may have brought a wrong time, see note_change()
    bool in_ring : 1 = false;  // this slave is a ring slave, see `ring_slave`
    bool beside : 1 = false;   // while the ring is whole, only the copy that the head does not send reaches the slave
    bool out_of_reach : 1 = false;  // see note_reach()
    // While delays are measured: the port at which the frame arrives first, and the port at which it arrives before the
    // processing unit. They differ behind a break of a ring with two NICs.
    std::uint8_t arrival_port = 0;
    std::uint8_t passing_port = 0;
    std::uint8_t entered_port = 0;  // with one NIC: the port with the earliest receive time of the last measurement
    std::int32_t passed_ns = 0;     // `delay_ns` without the part that compute_clock_delays() adds behind a break
    // In a ring with two NICs, as measured while it was whole (network/ring_ways.cpp). Ring slaves are the slaves
    // between both NICs, counted from 1 at the head.
    std::uint16_t ring_slave = 0;  // this slave, or the ring slave with the branch of this slave; 0: not known
    std::uint16_t way = 0;         // sum over the slaves before this slave when the delay was measured, see way_part()
    std::int32_t away_ns = 0;      // from when the frame leaves towards the next ring slave until it is back
    std::int32_t return_ns = 0;    // from when the frame passes the processing unit until it leaves towards the head
    // Register 0x092C shows a mean of 16 comparisons. After fewer comparisons it still shows old differences.
    static constexpr std::uint8_t kTimesOfMean = 32;
    // In sync, or in sync until a frame has perhaps misled the clock: other clocks may still follow it.
    [[nodiscard]] bool is_in_step() const { return in_sync || misled; }
    // The SYNC signals of the slave were switched off.
    void end_sync() {
        sync_active = false;
        sync_start_ns = 0;
    }
    // Forgets all but the setting of dcsync0().
    void reset() {
        const SyncRegisters kept = sync;
        const bool is_set = sync_set;
        *this = {};
        sync = kept;
        sync_set = is_set;
    }
    [[nodiscard]] bool knows_difference() const { return follows != 0 && times_seen >= kTimesOfMean; }
    // The clock is in sync again only after new comparisons.
    void lose_sync() {
        in_sync = misled = false;
        watch.reset();
        times_seen = 0;
    }
};

// The cycle of the bus as the rounds of the watch see it: how long a cycle takes, as a mean from round to round.
struct MeasuredCycle {
    Time begin = Time::min();     // when the first cycle was sent; min: not begun
    Time last{};                  // when the last cycle was sent that a round has seen
    std::uint32_t first = 0;      // number of the first cycle; the numbers wrap
    std::uint32_t seen = 0;       // number of the last cycle
    std::uint64_t likely_ns = 0;  // the cycle that most rounds have seen, if they agree
    std::uint32_t rounds = 0;
    std::int32_t votes = 0;  // rounds that have seen this cycle, minus rounds that have seen another one

    void note(Time sent_at, std::uint32_t number);
    // The mean cycle; 0: the cycles are too few, or too different.
    [[nodiscard]] std::uint64_t steady_ns() const;
};

struct Clocks {
    ClockSettings settings;
    std::uint16_t reference = 0;    // number of the slave; 0: configure_clocks() has chosen none
    std::uint16_t rate_of = 0;      // the slave whose oscillator sets the rate of all clocks: see take_own_rate()
    std::uint16_t returning = 0;    // the slave that return_to_first_clock() brings to the reference
    std::span<ClockEntry> entries;  // by slave number - 1
    std::span<DelayNode> nodes;     // by place
    Time latched_at{};              // when receive times were latched last
    std::uint64_t system_ns = 0;    // the last known system time
    Time system_at{};               // when it was the system time
    bool measuring = false;         // not all latched receive times are read yet: nothing else may latch
    bool watching = false;          // watch_clocks() is executing
    bool paused = false;            // the cycles carry no time, until carry_time_of() names a slave again
    bool watched_soon = false;      // the next round comes before the interval of the watch is over, see watch_soon()
    std::uint16_t rounds_soon = 0;  // such rounds since an interval was counted
    std::uint8_t without_time = 0;  // rounds of the watch in which the cycle did not carry the time
    std::uint8_t rounds_old = 0;    // rounds in which the delay of some clock was old
    Errc late_error = Errc::none;   // why the clock of a slave that came late was not set the last time
    std::uint16_t late_first = 0;   // index of the slave whose clock is tried first the next time
    std::uint8_t retry_rounds = 0;  // rounds until a clock may be brought to the reference, after this has failed
    bool all_in_sync = false;
    bool is_driven = false;        // times are written to the reference, which follows them
    bool is_paced = false;         // a MasterClock has set `paced_ns` since the last round of the watch
    std::uint64_t paced_ns = 0;    // the cycle of this MasterClock; 0: it is not in sync with the bus
    bool loss_reported = false;    // the loss of the reference was reported
    std::uint8_t odd_times = 0;    // how many times in succession note_seen_time() has left out
    bool trusts_next = false;      // see trust_times()
    bool ways_unknown = false;     // frames enter slaves at other ports, and find_ways() does not know how
    bool unknown_latched = false;  // the last latching has reached more slaves than are known to be in the ring
    std::uint16_t looked_at = 0;   // the slave whose difference was read last while all clocks were in sync
    std::uint16_t times_seen = 0;  // cycles_with_time() of the group that carries the time, in the last round
    std::uint16_t times_sent = 0;  // frames of send_time() since the last round
    std::uint8_t times_of_grace = ClockEntry::kTimesOfMean;  // see find_grace()
    MeasuredCycle cycle;
    // shift_reference(): by how much the reference was moved since the last round, apart from the rate that the clocks
    // have learned: `shift_mean` in 16 cycles.
    std::int32_t shifted_ns = 0;
    std::int32_t shift_mean = 0;
    std::uint32_t greatest_ns = 0;  // upper estimate of the differences, as read last
    bool shifted_far = false;       // moved since the last round, at a rate by which no two oscillators differ
    Time watch_at = Time::min();
    Time delays_at = Time::min();  // when the delays are measured again
    // Called before a slave is requested to enter SAFEOP; once in each round of the supervision.
    Task<Result<>> (*prepare)(Network& network, Slave& slave) = nullptr;
    Task<Result<>> (*watch)(Network& network) = nullptr;
    // Whether the clock of a slave that was away is so near that it follows by itself.
    Task<Result<bool>> (*is_near)(Network& network, Slave& slave) = nullptr;
    // Called when the frames of the group are prepared while a clock is out of reach; nullptr: no clock is out of
    // reach.
    void (*begin_cycles)(ProcessGroup& group) = nullptr;
    // Called when the supervision ends, perhaps while the cycles carry no time: they carry it again.
    void (*resume)(Network& network) = nullptr;

    // The system time at `now`, from the last one that is known.
    [[nodiscard]] std::uint64_t system_at_ns(Time now) const {
        return system_ns + static_cast<std::uint64_t>((now - system_at).count());
    }
    // The reference clock showed `time_ns` (`wide`: 64 bits of it) in a frame that was sent at `now`.
    void note_time(std::uint64_t time_ns, bool wide, Time now) {
        const std::uint64_t about = system_at_ns(now);
        system_ns = wide ? time_ns : extend_time_ns(static_cast<std::uint32_t>(time_ns), about);
        system_at = now;
    }
    // How far the reference clock, which showed `time_ns` (`wide`: 64 bits of it) at `now`, is ahead of the expected
    // time.
    [[nodiscard]] std::int64_t ahead_of_expected_ns(std::uint64_t time_ns, bool wide, Time now) const {
        const std::uint64_t about = system_at_ns(now);
        const std::uint64_t seen = wide ? time_ns : extend_time_ns(static_cast<std::uint32_t>(time_ns), about);
        return static_cast<std::int64_t>(seen - about);
    }
    // How far the rates of two clocks may have moved them apart since the last known system time.
    [[nodiscard]] std::int64_t drift_since_ns(Time now) const {
        constexpr std::int64_t kRateParts = 500;                  // 2000 ppm
        return std::abs((now - system_at).count()) / kRateParts;  // the system time may be newer
    }
    // Whether a reference clock that was not reset may show this time.
    [[nodiscard]] bool is_likely(std::uint64_t time_ns, bool wide, Time now) const {
        constexpr std::int64_t kNearest_ns = 20'000'000;
        const std::int64_t limit = kNearest_ns + drift_since_ns(now);
        const std::int64_t ahead = ahead_of_expected_ns(time_ns, wide, now);
        return ahead <= limit && ahead >= -limit;
    }
    // The same for a time that frames bring without a request. A time that no rate explains is left out, until a look
    // at the reference has shown that the reference was not reset: a slave that was reset answers with a time of its
    // own.
    void note_seen_time(std::uint64_t time_ns, bool wide, Time now) {
        if (now <= system_at) return;
        constexpr std::int64_t kNearest_ns = 100'000;
        const std::int64_t limit = kNearest_ns + drift_since_ns(now);
        const std::int64_t ahead = ahead_of_expected_ns(time_ns, wide, now);
        const bool odd = !trusts_next && (ahead > limit || ahead < -limit);
        odd_times =
            odd ? static_cast<std::uint8_t>(odd_times == UINT8_MAX ? odd_times : odd_times + 1) : std::uint8_t{0};
        if (odd) return;
        trusts_next = false;
        note_time(time_ns, wide, now);
    }
    // Times of frames that were sent before `now` are left out: the reference may have been reset then, and was set
    // since.
    void forget_times_before(Time now) {
        system_ns = system_at_ns(now);
        system_at = now;
        odd_times = 0;
    }
    // The reference was not reset: the next time that a frame brings is the time of the reference.
    void trust_times(Time now) {
        forget_times_before(now);
        trusts_next = true;
    }
    static constexpr std::uint8_t kManyOdd = 20;
    [[nodiscard]] ClockEntry& of(const Slave& slave) { return entries[slave.number - 1U]; }
    void lose_sync(const Slave& slave) {
        if (entries.empty()) return;
        of(slave).lose_sync();
        all_in_sync = false;
    }
    void forget();
};

[[nodiscard]] constexpr bool is_clock(ClockKind kind) { return kind == ClockKind::bits32 || kind == ClockKind::bits64; }

// See configdc(). Returns the number of the reference clock.
[[nodiscard]] Task<Result<std::uint16_t>> configure_clocks(Network& network, ClockSettings settings);

// Writes delay and offset of a slave whose clock was reset, and activates its SYNC signals. This is the function of
// Clocks::prepare.
[[nodiscard]] Task<Result<>> prepare_clock(Network& network, Slave& slave);
// The same for the SYNC signals alone, as the application or the SII wants them.
[[nodiscard]] Task<Result<>> prepare_sync(Network& network, Slave& slave);
[[nodiscard]] Task<Result<>> activate_sync(Network& network, Slave& slave, SyncRegisters sync);
// The registers for the settings, which the SII may contain.
[[nodiscard]] Task<Result<SyncRegisters>> find_sync(Network& network, Slave& slave, SyncSettings wanted);
// The registers for settings of the application; invalid_argument when a time does not fit.
[[nodiscard]] Result<SyncRegisters> sync_registers(const SyncSettings& settings, const ClockSettings& clocks);

[[nodiscard]] Task<Result<>> watch_clocks(Network& network);

// False when the clock differs by more than its control loop corrects in about a second. Its slave must be started
// again: a clock that is set makes a step, and SYNC signals that are active would stop.
[[nodiscard]] Task<Result<bool>> is_near(Network& network, Slave& slave);
inline constexpr std::int64_t kNear_ns = 100'000;

// ------------------------------------------------------------------ parts of the sequences

// The next cycles carry the time of this slave; nullptr: no time. False where cycles overlap: see redirect_time().
[[nodiscard]] bool carry_time_of(Network& network, const Slave* slave);
// From now on the slave is the reference. The cycles already carry its time. The error is the error of a request to a
// second reference, which the supervision repeats.
[[nodiscard]] Task<Result<>> set_reference(Network& network, const Slave& slave);
// The reference, or the slave that becomes the reference, runs at the rate of its own oscillator from now on: the other
// clocks are not in sync until they have learned this rate. take_own_rate(): only if they ran at another rate before.
void lose_sync_of_others(Network& network, const Slave& reference);
void take_own_rate(Network& network, const Slave& reference);
// With one NIC: the reference has not answered in the last cycle, or the cycle carries the time of the standby. The
// last frame for the reference may have misled the clocks, and the supervision has not seen the loss yet.
[[nodiscard]] bool is_reference_silent(Network& network);
// When a datagram that is queued now leaves: in a running cycle, with the next cycle.
[[nodiscard]] Time leaves_at(Network& network);
// Sends the time of the reference clock to all slaves once, in a frame of its own. unstable: the reference was reset,
// and shows a time of its own, which must reach no clock.
[[nodiscard]] Task<Result<>> send_time(Network& network);
// unstable if the offset that was written to the reference is gone: the reference was reset.
[[nodiscard]] Task<Result<>> check_offset(Network& network);
// An upper estimate of the differences of all clocks that are synchronised, by one broadcast. A clock that is not
// synchronised would hide these differences: where there is such a clock, the difference of each clock is read.
[[nodiscard]] Task<Result<std::uint32_t>> read_greatest_difference(Network& network);
// Reads register 0x092C of a slave into its entry.
[[nodiscard]] Task<Result<>> read_difference(Network& network, Slave& slave);
[[nodiscard]] Task<Result<>> probe_clock(Network& network, Slave& slave);
// Reads register 0x0982 of a slave into its entry.
[[nodiscard]] Task<Result<>> read_pulse_length(Network& network, Slave& slave);
// Latches the receive times of all slaves. read_receive_times() reads the local time of one slave, and with `yes` adds
// its receive times to the times from which the delays are computed.
enum class Keep : bool { no, yes };
[[nodiscard]] Task<Result<>> latch_receive_times(Network& network);
[[nodiscard]] Task<Result<>> read_receive_times(Network& network, Slave& slave, Keep keep);
// Fills Clocks::nodes with the ways of the frames as they are now, and the ports of the entries. Returns the number of
// nodes (network/clock_delays.cpp).
std::size_t find_frame_ways(Network& network);
// Finds the port at which the frames enter each slave, from the receive times. With two NICs, the ring shows this port.
void find_entry_ports(Network& network);
// What a slave that answers adds to the sums ClockEntry::way of all slaves behind it. The sums of two slaves differ as
// long as before if the same slaves are between them.
[[nodiscard]] constexpr std::uint16_t way_part(const Slave& slave) {
    constexpr std::uint32_t kSpread = 0x9E3779B1;
    if (slave.al.state == AlState::none) return 0;
    // Not linear: sets of slaves whose numbers have the same sum must have different sums.
    const std::uint32_t mixed = slave.number * kSpread;
    return static_cast<std::uint16_t>(((mixed ^ mixed >> 15) * kSpread) >> 16);
}
// Sets ClockEntry::delay_old. A slave that is lost, or that is back, changes the delays of all slaves behind it, unless
// the clock that they follow is behind it too. Returns whether some delay is old.
bool find_old_delays(Network& network);
// unstable or unsupported when the receive times of a slave contradict the ways of the frames.
[[nodiscard]] Error check_receive_times(Network& network);
// With one NIC: writes what compute_clock_delays() has found into the facts of the slaves where it differs from what
// the DL status tells.
void correct_topology(Network& network);
// Computes the delay of every slave from the measurements so far.
void compute_clock_delays(Network& network);
// How much later a frame passes `slave` than `reference`. If a break of the ring is between both slaves, the two copies
// of the frame are compared, as if both NICs had sent them at the same time. Errors: unstable (the ring has changed
// meanwhile).
[[nodiscard]] Task<Result<std::int64_t>> measure_way(Network& network, Slave& slave, const Slave& reference);
// Whether a break of the ring is between both, and the ways of both copies are not measured, because some clocks are
// beside the ring: neither clock can be set by the other one until the ring is whole.
[[nodiscard]] bool is_way_unknown(Network& network, const Slave& slave, const Slave& reference);
// How far the clock of `slave` is ahead of the clock of `reference`: both latch the same frame, or copies of the frame.
[[nodiscard]] Task<Result<std::int64_t>> measure_ahead(Network& network, Slave& slave, Slave& reference);
// Changes the offset of a clock that runs. The control loop of the clock goes on.
[[nodiscard]] Task<Result<>> move_clock(Network& network, Slave& slave, std::int64_t by_ns);
// The clock whose time reaches the slave now.
[[nodiscard]] FollowedClock followed_clock(Network& network, const Slave& slave);
// Once in each round of the watch, `rounds` intervals after the last one: which clock each clock follows, and which
// clocks are not in sync any more because their slave is lost, or because no time has reached it for a second.
void note_followed_clocks(Network& network, std::int64_t rounds);
// SYNC0 signals that are neither a whole multiple nor a whole part of the cycle have another phase to each frame: said
// once for each slave. `tolerance`: what part of the longer one of both times the difference from a whole multiple may
// be, for a cycle that was measured; UINT64_MAX: no difference at all.
void note_sync_cycles(Network& network, std::uint64_t cycle_ns, std::uint64_t tolerance);
// The same for the cycle of MasterClock, or for the cycle that was measured where no MasterClock is. Once in each round
// of the watch.
void note_cycle_time(Network& network);
// Makes the first slave in the ring that has its clock and its state the reference, where this slave is before the
// reference: such a slave takes the time that the master has sent. The clock of the slave is moved to the time of the
// old reference in small steps, so that no other clock sees a step. A clock that is too far away is set, and its SYNC
// signals start again.
[[nodiscard]] Task<Result<>> return_to_first_clock(Network& network);
// Sets the clock of a slave that was first seen, or was reset, while the reference was lost.
[[nodiscard]] Task<Result<>> set_late_clock(Network& network);
// Without a supervision that watches the clocks: notes the time that the last cycle has brought. Callable from the
// cycle.
void refresh_system_time(Network& network);
// See Clocks::resume.
void resume_time(Network& network);
// The slave becomes a reference, with the rate that its clock has learned. A wrong comparison with the time of the lost
// reference disturbs this rate, and no comparison corrects the rate of a reference. So the control loop starts again
// if the mean of the differences is not within the limit. True: the clocks that follow the slave are not in sync now.
[[nodiscard]] Task<Result<bool>> settle_rate(Network& network, Slave& slave);
// Sets the clock of the slave by the reference, while the cycles carry no time. Then the slave is the reference.
// `of_reference`: the slave first learns the rate of the old reference, which takes some tenths of a second.
enum class ClockRate : bool { own, of_reference };
[[nodiscard]] Task<Result<>> become_reference(Network& network, Slave& slave, ClockRate rate);
// Teaches a slave before the reference in the ring the rate of the reference. The clock of the slave was set by the
// reference, and the cycles carry no time. Single frames bring the slave the time that the master expects, until its
// clock runs at the rate of the reference. Then the clock is moved to the time of the reference.
// False: the slave has not learned the rate, and runs at its own rate.
[[nodiscard]] Task<Result<bool>> learn_rate(Network& network, Slave& slave, Slave& reference);
// Measures the delays again while all clocks run at the same rate, so that their drift falsifies no delay.
[[nodiscard]] Task<Result<>> improve_delays(Network& network);
// Writes offset and delay of the entry, and starts the control loop of the clock again.
[[nodiscard]] Task<Result<>> write_clock(Network& network, Slave& slave);

// Depths of the System Time Difference Filter (0x0934): while a clock is calmed, and of a clock that was left with it.
inline constexpr std::uint8_t kDeepestFilter = 15;
inline constexpr std::uint8_t kUsualFilter = 4;

// Writes `bytes` octets of a register. The error names the slave and the register.
[[nodiscard]] Task<Result<>> write_clock_register(Station station, wire::Register r, std::uint64_t value);

// Starts the control loop of a clock again: the control loop forgets the rate.
[[nodiscard]] Task<Result<>> reset_control_loop(Station station);

// Sets ClockEntry::out_of_reach: the slave is before the reference that the settings have chosen, so that no time of
// this reference reaches its clock. It is not synchronised, and never becomes the reference. Reports a change. Returns
// the new value.
bool note_reach(Network& network, Slave& slave);
// Whether a slave is there that may have a clock, and is not synchronised: the clock is out of reach, or the slave has
// come after configdc() and was not brought to SAFEOP.
[[nodiscard]] bool any_unsynchronised(Network& network);

// A slave before the reference in the ring that has a clock; 0: none.
[[nodiscard]] std::uint16_t clock_before(Network& network, std::uint16_t reference);

}  // namespace margay
