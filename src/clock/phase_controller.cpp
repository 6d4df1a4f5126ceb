#include <margay/phase_controller.hpp>

#include <algorithm>
#include <utility>

namespace margay {
namespace {

constexpr std::uint64_t magnitude(std::int64_t value) {
    return value < 0 ? 0U - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
}

// An error beyond a limit is treated as the limit, so that all products below fit 64 bits.
constexpr std::int64_t kMostError_ns = 4'000'000'000;
constexpr std::int64_t kMostObserved_ns = 1'000'000'000'000;
constexpr std::int64_t kMostDrift_fs = 4'000'000'000'000'000;  // in a cycle

constexpr std::int64_t limited(std::int64_t value, std::int64_t limit) { return std::clamp(value, -limit, limit); }

// The greatest drift in a cycle, in femtoseconds.
constexpr std::int64_t greatest_drift_fs(const PhaseSettings& settings) {
    const std::int64_t cycle_ns = std::max<std::int64_t>(settings.cycle.count(), 0);
    const std::int64_t ppm = settings.most_drift_ppm;
    return ppm != 0 && cycle_ns > kMostDrift_fs / ppm ? kMostDrift_fs : cycle_ns * ppm;
}

struct Gains {
    std::int64_t phase_ppm;
    std::int64_t drift_ppb;
};

// The gains of the line that fits the `n` errors so far best (least squares): the first error corrects the whole phase,
// the second error corrects the drift. The gains decrease with each error, down to the gains of the settings.
Gains gains_after(std::uint32_t n, std::uint16_t gain_ppt, std::uint16_t drift_gain) {
    constexpr std::int64_t kMillion = 1'000'000;
    const std::int64_t all = std::int64_t{n} * (n + 1);
    const std::int64_t least = std::int64_t{gain_ppt} * 1000;
    const std::int64_t phase = 2 * (2 * std::int64_t{n} - 1) * kMillion / all;
    if (n < 2) return {kMillion, 0};
    const std::int64_t drift = 6 * 1000 * kMillion / all;
    const std::int64_t least_drift = std::int64_t{gain_ppt} * gain_ppt * 250 * drift_gain;
    return {std::min(std::max(phase, least), kMillion), std::min(std::max(drift, least_drift), 1000 * kMillion)};
}

constexpr std::uint32_t kMostSeen = 100'000;  // 4 / kMostSeen is below every gain
constexpr std::uint16_t kManyPairs = 256;
constexpr std::uint16_t kManyHeld = 1024;  // a jitter of 50 µs is then 70 ns in a cycle
constexpr std::uint8_t kSaturatedTooOften = 32;

// The square root, rounded down.
constexpr std::uint32_t root(std::uint64_t value) {
    std::uint64_t result = 0;
    for (std::uint64_t bit = std::uint64_t{1} << 31; bit != 0; bit >>= 1)
        if ((result | bit) * (result | bit) <= value) result |= bit;
    return static_cast<std::uint32_t>(result);
}

}  // namespace

PhaseSettings for_bus_shift(const PhaseSettings& settings) {
    PhaseSettings phase = settings;
    phase.cycles_late = 1;
    if (phase.most_step_ns == 0) phase.most_step_ns = static_cast<std::uint32_t>(greatest_drift_fs(phase) / 1'000'000);
    return phase;
}

void PhaseController::start(const PhaseSettings& settings) {
    *this = PhaseController{};
    settings_ = settings;
    gain_ppt_ = settings.gain_ppt;
}

std::int32_t PhaseController::drift_ppb() const {
    constexpr std::int64_t kLongCycle_ns = INT64_MAX / 1000;
    const std::int64_t cycle_ns = settings_.cycle.count();
    if (cycle_ns <= 0) return 0;
    const std::int64_t whole_ppm = limited(drift_fs_ / cycle_ns, INT32_MAX);
    const std::int64_t rest = drift_fs_ % cycle_ns;
    const std::int64_t rest_ppb = cycle_ns > kLongCycle_ns ? rest / (cycle_ns / 1000) : rest * 1000 / cycle_ns;
    return static_cast<std::int32_t>(limited(whole_ppm * 1000 + rest_ppb, INT32_MAX));
}

std::uint32_t PhaseController::jitter_ns() const { return root(jitter_ / kManyPairs); }

// The difference of two errors in succession shows the jitter of both: phase and drift change little between them. The
// mean of the squares is an arithmetic mean first, and an exponential mean later. The controller itself lets the jitter
// J (root of the mean of the squares) move the phase by J times the root of 7/8 of the gain: a second-order controller
// with a phase gain a and a drift gain b passes a/2 + b/2a of the mean of the squares, and b is 3/4 a².
void PhaseController::measure_jitter(std::int64_t error_ns) {
    constexpr std::uint64_t kMostDifference = 1'000'000;  // its square and the sums fit 64 bits
    const std::uint64_t difference = std::min(magnitude(error_ns - last_ns_), kMostDifference);
    const bool pair = has_last_;
    has_last_ = true;
    last_ns_ = error_ns;
    if (!pair) return;
    if (pairs_ < kManyPairs) ++pairs_;
    const std::uint64_t square = difference * difference / 2;
    jitter_ = jitter_ - jitter_ / pairs_ + square * kManyPairs / pairs_;
    constexpr std::uint16_t kEnough = 32;
    if (pairs_ < kEnough) return;
    const std::uint64_t noise = std::min<std::uint64_t>(settings_.noise_ns, kMostDifference);
    const std::uint64_t mean = std::max<std::uint64_t>(jitter_ / kManyPairs, 1);
    gain_ppt_ = static_cast<std::uint16_t>(std::clamp<std::uint64_t>(noise * noise * 1143 / mean, 1, 250));
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
    seen_ = 0;  // learns the phase again, and keeps the learned drift as the best estimate
    if (state_ == PhaseState::busy) state_ = PhaseState::error_too_large;  // the gate may be smaller than the jitter
    moved_fs_ = {};
    return false;
}

void PhaseController::watch(std::int64_t error_ns, Time now) {
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
void PhaseController::learn_drift(std::int64_t change_fs) {
    const std::int64_t limit_fs = greatest_drift_fs(settings_);
    const std::int64_t wanted = drift_fs_ + change_fs;
    drift_fs_ = std::clamp(wanted, -limit_fs, limit_fs);
    if (magnitude(drift_fs_) < static_cast<std::uint64_t>(limit_fs))
        saturated_ = 0;
    else if (saturated_ < UINT8_MAX)
        ++saturated_;
}

// Whether the phase may have left the limit since the last reading.
bool PhaseController::is_silent(Time now) const {
    constexpr Duration kLongest = std::chrono::seconds(1);
    const Duration silent = now - read_at_;
    return silent > kLongest && silent / 2 > settings_.cycle;
}

// The phase is being moved by the greatest step. The change of the error and the correction that it shows are together
// the drift: if it exceeds what an ESC can follow, the phase never arrives.
void PhaseController::watch_limited(std::int64_t error_ns, std::uint8_t late) {
    const std::int64_t cycle_ns = std::max<std::int64_t>(settings_.cycle.count(), 0);
    std::int64_t change_ns = error_ns - std::exchange(held_ns_, error_ns);
    if (change_ns > cycle_ns / 2) change_ns -= cycle_ns;
    if (change_ns < -cycle_ns / 2) change_ns += cycle_ns;
    if (held_ < kManyHeld) ++held_;
    const std::int64_t seen_fs = moved_fs_[std::min<std::size_t>(late, moved_fs_.size() - 1)] + drift_fs_;
    const std::int64_t drift_fs = held_ == 1 ? 0 : change_ns * 1'000'000 + seen_fs;
    held_fs_ = held_ == 1 ? 0 : held_fs_ + (drift_fs - held_fs_) / (held_ - 1);
    const std::uint64_t limit_fs = magnitude(greatest_drift_fs(settings_));
    saturated_ = held_ >= kManyHeld && magnitude(held_fs_) > limit_fs ? kSaturatedTooOften : std::uint8_t{0};
}

void PhaseController::note(std::int64_t error_ns, Time now) {
    if (is_silent(now) && state_ != PhaseState::in_sync) within_since_ = kNever;
    read_at_ = now;
    unknown_ = false;
    unsure_ns_ = 0;
    error_ns_ = error_ns;
    sum_ns_ += magnitude(error_ns);
    most_ns_ = std::max(most_ns_, magnitude(error_ns));
    ++count_;
}

std::int64_t PhaseController::whole(std::int64_t correction_fs) {
    constexpr std::int64_t kFsInNs = 1'000'000;
    if (settings_.most_step_ns != 0) {
        const std::int64_t most_fs = std::int64_t{settings_.most_step_ns} * kFsInNs;
        correction_fs = std::clamp(correction_fs, -most_fs, most_fs);
    }
    // Each cycle adds as much drift as this part of the correction removes: only the other part moves the phase.
    std::shift_right(moved_fs_.begin(), moved_fs_.end(), 1);
    moved_fs_.front() = correction_fs - drift_fs_;
    fraction_fs_ += correction_fs;
    const std::int64_t ns = fraction_fs_ / kFsInNs;
    fraction_fs_ -= ns * kFsInNs;
    return ns;
}

std::int64_t PhaseController::update(std::int64_t error_ns, Time now, std::uint8_t late) {
    note(error_ns, now);
    const bool outlier = is_outlier(error_ns);
    watch(error_ns, now);
    if (outlier) return coast(now);
    error_ns = limited(error_ns, kMostError_ns);
    if (settings_.automatic_gain) measure_jitter(error_ns);
    if (seen_ < kMostSeen) ++seen_;
    const Gains gains = gains_after(seen_, gain_ppt_, settings_.drift_gain);
    std::int64_t error_ps = error_ns * 1000;
    for (std::size_t n = 0; n < std::min<std::size_t>(late, moved_fs_.size()); ++n) error_ps -= moved_fs_[n] / 1000;
    error_ps = limited(error_ps, kMostError_ns * 1000);
    const std::int64_t phase_fs = error_ps * gains.phase_ppm / 1000;
    if (settings_.most_step_ns != 0 && magnitude(phase_fs) > std::uint64_t{settings_.most_step_ns} * 1'000'000) {
        seen_ = 0;  // the phase is being moved, so the error does not show the drift
        watch_limited(error_ns, late);
        // A drift that holds the phase back may be that of a clock that was steered before this one: it is forgotten.
        if ((phase_fs < 0) != (drift_fs_ < 0)) drift_fs_ -= drift_fs_ / 64;
        return whole(phase_fs + drift_fs_);
    }
    // The phase may cross its set value without staying there.
    if (held_ != 0) held_ = static_cast<std::uint16_t>(held_ - held_ / 16 - 1);
    learn_drift(error_ps / 1000 * gains.drift_ppb / 1000);
    return whole(phase_fs + drift_fs_);
}

void PhaseController::observe(std::int64_t error_ns, Time now) {
    constexpr std::int64_t kFsInNs = 1'000'000;
    note(error_ns, now);
    const std::int64_t seen_ns = error_ns;
    error_ns = limited(error_ns, kMostObserved_ns);
    const std::int64_t cycle_ns = std::max<std::int64_t>(settings_.cycle.count(), 0);
    if (has_last_) {
        // The error may wrap from half a cycle late to half a cycle early.
        std::int64_t change_ns = error_ns - last_ns_;
        if (change_ns > cycle_ns / 2) change_ns -= cycle_ns;
        if (change_ns < -cycle_ns / 2) change_ns += cycle_ns;
        if (pairs_ < kManyPairs) ++pairs_;
        drift_fs_ += (change_ns * kFsInNs - drift_fs_) / pairs_;
        const std::uint64_t limit_fs = magnitude(greatest_drift_fs(settings_));
        saturated_ = pairs_ >= kManyPairs && magnitude(drift_fs_) > limit_fs ? kSaturatedTooOften : std::uint8_t{0};
    }
    has_last_ = true;
    last_ns_ = error_ns;
    watch(seen_ns, now);
}

std::int64_t PhaseController::coast(Time now) {
    observe_nothing(now);
    return whole(drift_fs_);
}

std::int64_t PhaseController::coast_unsure(Time now) {
    const std::int64_t correction = coast(now);
    unsure_ns_ = std::min<std::uint64_t>(unsure_ns_ + magnitude(correction), UINT32_MAX);
    unknown_ |= unsure_ns_ > settings_.limit_ns;
    return correction;
}

void PhaseController::observe_nothing(Time now) {
    has_last_ = false;
    unknown_ |= is_silent(now);
}

void CycleCheck::add(std::uint64_t due_ns, std::int64_t cycle_ns, std::int64_t earlier_ns) {
    const auto passed = static_cast<std::int32_t>(static_cast<std::uint32_t>(due_ns - last_due_ns_));
    const std::int64_t expected = std::min<std::int64_t>(cycle_ns, INT32_MAX) - earlier_ns;
    const std::int64_t away = passed > expected ? passed - expected : expected - passed;
    last_due_ns_ = due_ns;
    if (!std::exchange(known_, true) || cycle_ns > INT32_MAX) return;
    if (away <= cycle_ns / 8)
        odd_ = 0;
    else if (odd_ < kTooOften)
        ++odd_;
}

}  // namespace margay
