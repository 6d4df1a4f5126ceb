// The clock of the master and the reference clock of the slaves: the frames of the cycle pass the reference clock at a
// chosen time before each SYNC0. Either the cycle follows the reference clock (master shift), or the reference clock
// follows the cycle (bus shift).
//
//     MasterClock clock({.mode = MasterClock::Mode::master_shift, .set_value = -200us, .phase = {.cycle = 1ms}});
//     reach(ctx, AlState::op, 10s, {.period = 1ms, .clock = &clock});
//     run_cycle(ctx, {.period = 1ms, .clock = &clock}, [&](const CycleInfo&) { … return !stop; });
//
// In a loop of its own, the application applies the adjustment itself:
//
//     CyclicRunner runner({.period = 1ms});
//     for (;;) {
//         const CyclicTick tick = runner.wait();
//         send_processdata(ctx);
//         receive_processdata(ctx, timeout);
//         runner.adjust(-clock.update(ctx, tick.lateness));
//         …
//     }
#pragma once

#include <margay/context.hpp>
#include <margay/phase_controller.hpp>
#include <margay/run.hpp>

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

struct MasterClockSettings {
    enum class Mode : std::uint8_t {
        // Only measures the phase, and corrects nothing: record() shows the natural drift. The phase moves through the
        // cycle, so that state() is not in_sync for long.
        off,
        master_shift,  // the master's cycle follows the reference clock: update() returns the adjustment
        // The reference clock follows the master's cycle: update() steers its offset (0x0920). The other clocks follow
        // a change of its rate late, by some 30 ns for each ppm and each millisecond of the cycle. While the reference
        // clock moves to the phase (at up to 600 ppm), the other clocks differ from it by up to 20 µs for each
        // millisecond of the cycle, and are not in sync: by up to 20 µs with cycles of 1 ms, and up to 200 µs with
        // cycles of 10 ms. With cycles of 10 ms they are in sync only some 7 s after the reference clock. In sync, each
        // cycle moves the reference clock by its drift in one cycle, and the other clocks follow with the next cycle: a
        // drift of 28 ppm is 28 ns with cycles of 1 ms, and 560 ns with cycles of 20 ms. SlaveClock::in_sync does not
        // count such a step of up to 4 * ClockSettings::limit_ns; with a greater step the other clocks are not in sync.
        bus_shift,
        // The reference clock follows the time of the master without a controller: update() writes the time to its
        // register 0x0910, and the chip's own control loop follows. The cycle must be accurate, and no other group may
        // have shorter cycles: the time would leave with a cycle of the other group, and be wrong. state() is in_sync
        // when the phase that results is within the limit.
        master_reference,
    };
    Mode mode = Mode::master_shift;
    std::uint8_t group = 0;  // whose cycle carries the time of the reference clock
    // The phase of a cycle that is in sync: the time at which the frame passes the reference clock, from a whole
    // multiple of the cycle in system time (SYNC0 without a shift) on; negative: before it. The magnitude is less than
    // a cycle.
    Duration set_value{0};
    PhaseSettings phase{};
};

// The measurements and the correction of one update(). All times in ns unless the name says another unit.
struct ClockRecord {
    Time at{};  // when the cycle was sent
    std::int64_t set_value_ns = 0;
    std::uint64_t bus_time_ns = 0;      // the time of the reference clock when the frame passed it
    std::uint64_t bus_time_off_ns = 0;  // the same within its cycle
    std::int64_t adjust_ns = 0;         // the correction of this cycle
    std::int64_t error_ns = 0;          // positive: the frames pass the reference clock too late
    std::int64_t filtered_ns = 0;       // the mean of the last errors (1/16 of each)
    std::int32_t drift_ppb = 0;
    std::int64_t cycle_ns = 0;
    std::int64_t adjusted_ns = 0;  // the sum of all corrections
    PhaseState state = PhaseState::idle;
    bool read = false;  // the cycle has brought the time of the reference clock; otherwise the last values stay
    bool clocks_in_sync = false;      // ClockStatus::in_sync
    std::uint32_t difference_ns = 0;  // ClockStatus::greatest_ns
    std::uint64_t start_time_ns = 0;  // SlaveClock::sync_start_ns of the slave with the reference clock
};

// A log of records as CSV: the head line, and the line of one record, each with a line feed. Written into `out` (cut if
// it does not fit; 300 octets are enough). The columns are as in logs of other masters: Time[ms], SyncSetVal
// [ns], BusTime [ns], BusTimeOff [ns], CtlAdj [ns], CtlErr [ns], CtlErrFilt [ns], Drift [ppm], CtlErr [1/10 pmil] (the
// error in tenths of a thousandth of the cycle), CtlOutSum [ns] (the drift that is corrected in one cycle), CtlOutTot
// [ns] (the sum of all corrections), DCStartTime [ns], DCMErrorCode (PhaseState), DCMInSync, DCInSync,
// SystemTimeDifference [ns]. Callable from the cycle; the program writes the text to its file outside the cycle.
[[nodiscard]] std::string_view write_clock_log_head(std::span<char> out);
[[nodiscard]] std::string_view write_clock_log(const ClockRecord& record, std::span<char> out);

class MasterClock : public CycleClock {
  public:
    using Mode = MasterClockSettings::Mode;
    using Settings = MasterClockSettings;

    explicit MasterClock(const Settings& settings);

    // Call it after each receive_processdata(); run_cycle() and reach() do it for CycleSettings::clock. `lateness`: how
    // much later than due the cycle was sent. The library subtracts it from the reading, so that the jitter of the
    // wake-up has no effect. Returns by how much the next cycle must come earlier (negative: later); 0 unless the mode
    // is master_shift. An application with its own timer applies the result. When the phase comes into sync, or leaves
    // the limit, the library reports an event. Callable from the cycle, by the owner; never waits.
    [[nodiscard]] Duration update(Context& ctx, Duration lateness);

    // Forgets phase, drift, errors and statistics, and starts again.
    void restart();

    [[nodiscard]] PhaseState state() const { return fault_ == PhaseState::idle ? controller_.state() : fault_; }
    // The last error, the mean and the greatest magnitude since the start or reset_statistics(), in ns: positive when
    // the frames pass the reference clock too late.
    [[nodiscard]] std::int64_t error_ns() const { return controller_.error_ns(); }
    [[nodiscard]] std::uint64_t average_ns() const { return controller_.average_ns(); }
    [[nodiscard]] std::uint64_t most_ns() const { return controller_.most_ns(); }
    void reset_statistics() { controller_.reset_statistics(); }
    // The drift of the master's clock against the reference clock, in parts per thousand million.
    [[nodiscard]] std::int32_t drift_ppb() const { return controller_.drift_ppb(); }
    // The record of the last update().
    [[nodiscard]] const ClockRecord& record() const { return record_; }
    [[nodiscard]] const Settings& settings() const { return settings_; }

  private:
    [[nodiscard]] bool corrects() const {
        return settings_.mode == Mode::master_shift || settings_.mode == Mode::bus_shift;
    }
    Duration correct(Context& ctx, std::uint64_t due_ns, Time now);

    Settings settings_;
    PhaseController controller_;
    ClockRecord record_;
    PhaseState fault_ = PhaseState::idle;  // of the settings, or of the cycle
    bool was_in_sync_ = false;
    CycleCheck length_;
    Time read_at_{};  // of record_.bus_time_ns
    std::int64_t filtered_ps_ = 0;
    // Of master_reference: what is added to the master's time, so that the cycles have the phase of the set value.
    std::int64_t shift_ns_ = 0;
    bool has_shift_ = false;
};

// The state in words. A static string, callable from anywhere.
[[nodiscard]] std::string_view to_text(PhaseState state);

}  // namespace margay
