#include <margay/phase_controller.hpp>

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint64_t magnitude(std::int64_t value) {
    return value < 0 ? 0U - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
}

struct Gains {
    std::int64_t phase_ppm;
    std::int64_t drift_ppm;
};

// The gains of the best line through the `n` errors so far (least squares): the first error corrects the whole phase,
// the second one the drift. They fall with every error, down to the gain of the settings; there the drift gain is a
// quarter of the square of the phase gain, which is critical damping.
Gains gains_after(std::uint32_t n, std::uint16_t gain_ppt) {
    constexpr std::int64_t kMillion = 1'000'000;
    const std::int64_t all = std::int64_t{n} * (n + 1);
    const std::int64_t least = std::int64_t{gain_ppt} * 1000;
    const std::int64_t phase = 2 * (2 * std::int64_t{n} - 1) * kMillion / all;
    if (n < 2) return {kMillion, 0};
    const std::int64_t drift = 6 * kMillion / all;
    return {std::min(std::max(phase, least), kMillion), std::max(drift, std::int64_t{gain_ppt} * gain_ppt / 4)};
}

constexpr std::uint32_t kMostSeen = 100'000;  // 4 / kMostSeen is below every gain

}  // namespace

void PhaseController::start(const PhaseSettings& settings) {
    *this = PhaseController{};
    settings_ = settings;
}

std::int32_t PhaseController::drift_ppb() const {
    const auto cycle_ns = settings_.cycle.count();
    return cycle_ns <= 0 ? 0 : static_cast<std::int32_t>(drift_ps_ * 1'000'000 / cycle_ns);
}

// The first errors show phase and drift, so none of them can be an outlier.
bool PhaseController::is_outlier(std::int64_t error_ns) {
    constexpr std::uint32_t kLearning = 16;
    if (settings_.outlier_ns == 0 || seen_ < kLearning || magnitude(error_ns) <= settings_.outlier_ns) {
        outliers_ = 0;
        return false;
    }
    if (++outliers_ < kMostOutliers) return true;
    outliers_ = 0;
    seen_ = 0;  // learns the phase again; the drift that was learned is the best guess
    pending_ps_ = 0;
    return false;
}

void PhaseController::watch(std::int64_t error_ns, Time now) {
    constexpr std::uint8_t kSaturatedTooOften = 32;
    if (magnitude(error_ns) > settings_.limit_ns) {
        within_since_ = kNever;
        if (state_ == PhaseState::in_sync) state_ = PhaseState::error_too_large;
    } else if (within_since_ == kNever) {
        within_since_ = now;
    }
    if (saturated_ >= kSaturatedTooOften) {
        state_ = PhaseState::drift_too_high;
        within_since_ = kNever;
        return;
    }
    if (state_ == PhaseState::idle || state_ == PhaseState::drift_too_high) state_ = PhaseState::busy;
    if (within_since_ != kNever && now >= later(within_since_, settings_.settle)) state_ = PhaseState::in_sync;
}

// Learns the drift, as far as a chip can follow it.
void PhaseController::learn_drift(std::int64_t change_ps) {
    const auto limit_ps = settings_.cycle.count() * std::int64_t{settings_.most_drift_ppm} / 1000;
    const std::int64_t wanted = drift_ps_ + change_ps;
    drift_ps_ = std::clamp(wanted, -limit_ps, limit_ps);
    if (magnitude(drift_ps_) < static_cast<std::uint64_t>(limit_ps))
        saturated_ = 0;
    else if (saturated_ < UINT8_MAX)
        ++saturated_;
}

void PhaseController::note(std::int64_t error_ns) {
    error_ns_ = error_ns;
    sum_ns_ += magnitude(error_ns);
    most_ns_ = std::max(most_ns_, magnitude(error_ns));
    ++count_;
}

std::int64_t PhaseController::whole(std::int64_t correction_ps) {
    if (settings_.most_step_ns != 0) {
        const std::int64_t most_ps = std::int64_t{settings_.most_step_ns} * 1000;
        correction_ps = std::clamp(correction_ps, -most_ps, most_ps);
    }
    // Of the drift, each cycle brings as much as its correction takes away.
    pending_ps_ = settings_.cycles_late == 0 ? 0 : correction_ps - drift_ps_;
    fraction_ps_ += correction_ps;
    const std::int64_t ns = fraction_ps_ / 1000;
    fraction_ps_ -= ns * 1000;
    return ns;
}

std::int64_t PhaseController::update(std::int64_t error_ns, Time now) {
    note(error_ns);
    const bool outlier = is_outlier(error_ns);
    watch(error_ns, now);
    if (outlier) return whole(drift_ps_);
    if (seen_ < kMostSeen) ++seen_;
    const Gains gains = gains_after(seen_, settings_.gain_ppt);
    const std::int64_t error_ps = error_ns * 1000 - pending_ps_;
    const std::int64_t phase_ps = error_ps / 1000 * gains.phase_ppm / 1000;
    if (settings_.most_step_ns != 0 && magnitude(phase_ps) > std::uint64_t{settings_.most_step_ns} * 1000) {
        seen_ = 0;  // on the way to the phase; the error does not show the drift
        return whole(phase_ps + drift_ps_);
    }
    learn_drift(error_ps / 1000 * gains.drift_ppm / 1000);
    return whole(phase_ps + drift_ps_);
}

std::int64_t PhaseController::coast() { return whole(drift_ps_); }

}  // namespace margay
