// The clock of the master and the reference clock of the slaves: the frames of the cycle pass the reference clock at a
// chosen time before each SYNC0. Either the cycle follows the reference clock (master shift), or the reference clock
// follows the cycle (bus shift).
//
//     MasterClock clock({.mode = MasterClock::Mode::master_shift, .set_value = -200us, .phase = {.cycle = 1ms}});
//     CyclicRunner runner({.period = 1ms});
//     for (;;) {
//         const CyclicTick tick = runner.wait();
//         send_processdata(ctx);
//         receive_processdata(ctx, timeout);
//         runner.shift(-clock.update(ctx, tick.lateness));
//         …
//     }
#pragma once

#include <margay/context.hpp>
#include <margay/phase_controller.hpp>

#include <cstdint>
#include <string_view>

namespace margay {

struct MasterClockSettings {
    enum class Mode : std::uint8_t {
        off,           // only measures the phase, and corrects nothing
        master_shift,  // the master's cycle follows the reference clock: update() returns the adjustment
        bus_shift,     // the reference clock follows the master's cycle: update() steers its offset (0x0920)
        // The reference clock follows the time of the master without a controller: update() writes the time to its
        // register 0x0910, and the chip's own control loop follows. The cycle must be accurate.
        master_reference,
    };
    Mode mode = Mode::master_shift;
    std::uint8_t group = 0;  // whose cycle carries the time of the reference clock
    // The phase that the cycle has when it is in sync: when the frame passes the reference clock, against the whole
    // multiples of the cycle in system time (SYNC0 without a shift); negative: before.
    Duration set_value{0};
    PhaseSettings phase;
};

class MasterClock {
  public:
    using Mode = MasterClockSettings::Mode;
    using Settings = MasterClockSettings;

    explicit MasterClock(const Settings& settings);

    // Call it after each receive_processdata(). `lateness`: how much later than due the cycle was sent; the library
    // takes it out of the reading, so that the jitter of the wake-up does not disturb. Returns by how much the next
    // cycle must come earlier (negative: later); 0 unless the mode is master_shift. An application with a timer of its
    // own applies it itself. Callable from the cycle, by the owner; never waits.
    [[nodiscard]] Duration update(Context& ctx, Duration lateness);

    [[nodiscard]] PhaseState state() const { return controller_.state(); }
    // The last error, the mean and the greatest magnitude since the start or reset_statistics(), in ns: positive when
    // the frames pass the reference clock too late.
    [[nodiscard]] std::int64_t error_ns() const { return controller_.error_ns(); }
    [[nodiscard]] std::uint64_t average_ns() const { return controller_.average_ns(); }
    [[nodiscard]] std::uint64_t most_ns() const { return controller_.most_ns(); }
    void reset_statistics() { controller_.reset_statistics(); }
    // The drift of the master's clock against the reference clock, in parts per thousand million.
    [[nodiscard]] std::int32_t drift_ppb() const { return controller_.drift_ppb(); }
    [[nodiscard]] const Settings& settings() const { return settings_; }

  private:
    Settings settings_;
    PhaseController controller_;
};

// The state in words. A static string, callable from anywhere.
[[nodiscard]] std::string_view to_text(PhaseState state);

}  // namespace margay
