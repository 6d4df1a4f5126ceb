#include "subdevice/indicators.hpp"

#include "subdevice/esc_registers.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>
#include <array>

namespace margay::subdevice {
namespace {

using std::chrono::milliseconds;

// Times of ETG.1300, table "Indicator states and flash rates".
constexpr Duration kFlicker = milliseconds(50);
constexpr Duration kFlash = milliseconds(200);
constexpr Duration kPause = milliseconds(1000);
constexpr Duration kOverrideInterval = milliseconds(50);

constexpr std::uint8_t kCode = 0x0F;    // of an override register
constexpr std::uint8_t kEnable = 0x10;  // the code is valid
constexpr std::uint8_t kMostFlashes = 12;

// since % period, without the division of 64 bits, which is large on a microcontroller. `since` is not negative.
Duration rest_of(Duration since, Duration period) {
    Duration step = period;
    while (since - step >= step) step += step;
    for (;; step /= 2) {
        if (since >= step) since -= step;
        if (step == period) return since;
    }
}

// Equal times with and without light.
Lamp alternating(Duration half, Duration since) {
    const Duration at = rest_of(since, 2 * half);
    return at < half ? Lamp{true, half - at} : Lamp{false, 2 * half - at};
}

Lamp flashes(unsigned count, Duration since) {
    const Duration all = (2 * count - 1) * kFlash;
    const Duration at = rest_of(since, all + kPause);
    if (at >= all) return {false, all + kPause - at};
    return alternating(kFlash, at);
}

}  // namespace

Lamp lamp(Flashing flashing, Duration since) {
    const auto code = static_cast<std::uint8_t>(flashing);
    if (code >= 1 && code <= kMostFlashes) return flashes(code, since);
    switch (flashing) {
        case Flashing::blinking: return alternating(kFlash, since);
        case Flashing::flickering: return alternating(kFlicker, since);
        case Flashing::on: return {.lit = true};
        default: return {};
    }
}

Flashing run_flashing(AlState state) {
    switch (state) {
        case AlState::preop: return Flashing::blinking;
        case AlState::safeop: return Flashing::single;
        case AlState::op: return Flashing::on;
        case AlState::boot: return Flashing::flickering;
        default: return Flashing::off;
    }
}

Flashing error_flashing(const AlStatus& before, const AlStatus& now) {
    if (!now.error) return Flashing::off;
    if (now.code == static_cast<std::uint16_t>(wire::AlStatusCode::sync_manager_watchdog)) return Flashing::twice;
    if (before.state == AlState::none) return Flashing::flickering;
    return now.state < before.state ? Flashing::single : Flashing::blinking;
}

void Indicators::Light::show(Flashing flashing, Time now) {
    if (flashing == shown) return;
    shown = flashing;
    begin = now;
}

Time Indicators::Light::update(Time now) {
    const Lamp state = lamp(shown, now - begin);
    lit = state.lit;
    return state.lasts == Duration::max() ? kNever : now + state.lasts;
}

void Indicators::read_overrides(Time now) {
    overrides_at_ = now + kOverrideInterval;
    const auto both = read_register<std::uint16_t>(esc_, wire::reg::kRunLedOverride.address);
    const std::array lights{&run_, &error_};
    for (unsigned n = 0; n < lights.size(); ++n) {
        const auto value = static_cast<std::uint8_t>(both >> (8 * n));
        lights[n]->show((value & kEnable) != 0 ? static_cast<Flashing>(value & kCode) : lights[n]->own, now);
    }
}

Time Indicators::step(Time now, const AlStatus& status) {
    const auto end_override = [&](Light& light, wire::Register r, Flashing own) {
        light.own = own;
        light.show(own, now);
        write_register<std::uint8_t>(esc_, r.address, 0);
    };
    if (status != status_) {
        end_override(run_, wire::reg::kRunLedOverride, run_flashing(status.state));
        const bool new_error = status.error && (!status_.error || status.code != status_.code);
        if (new_error)
            end_override(error_, wire::reg::kErrLedOverride, error_flashing(status_, status));
        else if (!status.error)
            error_.own = Flashing::off;
        status_ = status;
        overrides_at_ = now;
    }
    if (now >= overrides_at_) read_overrides(now);
    const Time next = std::min({run_.update(now), error_.update(now), overrides_at_});
    show();
    return next;
}

void Indicators::show() {
    if (pins_ == nullptr || (has_shown_ && run_shown_ == run_.lit && error_shown_ == error_.lit)) return;
    has_shown_ = true;
    run_shown_ = run_.lit;
    error_shown_ = error_.lit;
    pins_->show(run_.lit, error_.lit);
}

}  // namespace margay::subdevice
