// The RUN and ERR indicators of a device whose processor switches the lamps (ETG.1300 "EtherCAT Indicator and
// Labeling"). A device whose ESC has outputs for the lamps does not need this file.
//
//     struct Pins final : IndicatorPins {
//         void show(bool run, bool error) override { … }
//     } pins;
//     Indicators indicators(esc, &pins);
//     for (;;) {
//         const Time next = device.step(now);  // first: it changes the AL status
//         sleep_until(std::min(next, indicators.step(now, device.al_status())));
//     }
//
// A program without IndicatorPins asks run_lit() and error_lit() after each step.
#pragma once

#include "subdevice/esc_access.hpp"

#include <margay/al_state.hpp>

namespace margay::subdevice {

// How a lamp flashes. The values are as in the override registers (0x0138, 0x0139): 1 to 12 are the number of flashes
// before a pause.
enum class Flashing : std::uint8_t { off = 0, single = 1, twice = 2, blinking = 13, flickering = 14, on = 15 };

// Whether a lamp is lit at the time `since` after the start of the flashing, and the time until the next change
// (kNever: no change).
struct Lamp {
    bool lit = false;
    Duration lasts = Duration::max();
};
[[nodiscard]] Lamp lamp(Flashing flashing, Duration since);

// The signal of the RUN indicator in a state.
[[nodiscard]] Flashing run_flashing(AlState state);

// The signal of the ERR indicator after the AL status has changed from `before` to `now`: off without an error; twice
// for an expired process data watchdog; single if the device has left its state by itself; blinking if it has refused a
// state; flickering for an error while the device starts.
[[nodiscard]] Flashing error_flashing(const AlStatus& before, const AlStatus& now);

// The lamps of the board. The author of a device implements this class.
class IndicatorPins {
  public:
    // Switches both lamps. Called from Indicators::step(): at its first call, and when a lamp changes.
    virtual void show(bool run_lit, bool error_lit) = 0;

  protected:
    ~IndicatorPins() = default;
};

class Indicators {
  public:
    // `esc`, and `pins` if it is given, must outlive the object.
    explicit Indicators(EscAccess& esc, IndicatorPins* pins = nullptr) : esc_(esc), pins_(pins) {}

    // Call it after Device::step(), with the AL status of the device. Returns the latest time for the next call. Reads
    // the override registers at most once in 50 ms: the master can set a lamp by these registers, until the AL status
    // changes (RUN) or a new error occurs (ERR).
    Time step(Time now, const AlStatus& status);

    // The PDI watchdog has expired, or the processor cannot continue: the ERR indicator is on until the AL status
    // changes.
    void controller_failed() { error_.own = Flashing::on; }

    [[nodiscard]] bool run_lit() const { return run_.lit; }
    [[nodiscard]] bool error_lit() const { return error_.lit; }

  private:
    struct Light {
        Flashing own = Flashing::off;  // without an override
        Flashing shown = Flashing::off;
        Time begin{};
        bool lit = false;
        void show(Flashing flashing, Time now);
        [[nodiscard]] Time update(Time now);
    };
    void read_overrides(Time now);

    void show();

    EscAccess& esc_;
    IndicatorPins* pins_;
    bool has_shown_ = false;  // the present signal of `pins_` is known
    bool run_shown_ = false;
    bool error_shown_ = false;
    AlStatus status_{};
    Light run_;
    Light error_;
    Time overrides_at_{};
};

}  // namespace margay::subdevice
