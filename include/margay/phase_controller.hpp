// A controller of a phase: the phase of the master's cycle against the reference clock (master shift), or the phase of
// the reference clock against the master's time (bus shift). The controller has a proportional part, and an integral
// part that learns the drift between both clocks.
#pragma once

#include <margay/time.hpp>

#include <array>
#include <cstdint>

namespace margay {

struct PhaseSettings {
    Duration cycle = std::chrono::milliseconds(1);
    // The part of the error that one cycle corrects, in parts per thousand, when the controller has settled. Before
    // that the controller corrects more, so that it learns phase and drift from few cycles.
    std::uint16_t gain_ppt = 2;
    // How strongly an error changes the drift that is learned: one cycle changes the correction of all further cycles
    // by drift_gain / 4 times the square of the gain. 1 is critical damping; more follows a changing drift faster.
    std::uint16_t drift_gain = 3;
    // The controller measures the jitter of the errors and chooses the gain itself, so that the jitter moves the phase
    // by `noise_ns` (root of the mean of the squares). The gain is high when the jitter is small, and the phase then
    // follows a changing drift fast. The gain is from 1 to 250 ppt, and gain_ppt until enough errors are known.
    bool automatic_gain = false;
    std::uint32_t noise_ns = 100;
    // An error that is greater is an outlier and corrects nothing; the first errors after a start are no outliers.
    // After kMostOutliers in succession the controller starts again. 0: no error is an outlier.
    std::uint32_t outlier_ns = 3000;
    std::uint32_t limit_ns = 4000;                      // in sync: every error is within this limit,
    Duration settle = std::chrono::milliseconds(1500);  // for this time
    std::uint32_t most_drift_ppm = 600;                 // the greatest drift that an ESC can follow
    std::uint32_t most_step_ns = 0;                     // the greatest correction of one cycle; 0: no limit
    // How many errors after a correction do not show the correction yet; 0: the next error shows it. At most kMostLate.
    std::uint8_t cycles_late = 0;
    static constexpr std::uint8_t kMostLate = 8;
};

// The settings for a controller that changes the offset of the reference clock. The offset is sent with the next cycle,
// behind the reading of the time, so each correction is seen one cycle later. No step is greater than the other clocks
// can follow.
[[nodiscard]] PhaseSettings for_bus_shift(const PhaseSettings& settings);

enum class PhaseState : std::uint8_t {
    idle,  // no error was given yet
    busy,  // not in sync yet, or was in sync and has had no reading for a second
    in_sync,
    drift_too_high,  // the clocks differ by more than PhaseSettings::most_drift_ppm
    // Was in sync, and an error has exceeded the limit; or the errors exceed PhaseSettings::outlier_ns again and again.
    error_too_large,
    set_value_wrong,  // of a clock: the set value is not less than a cycle, or there is no cycle
    cycle_wrong,      // of a clock: the application's cycle is not PhaseSettings::cycle
    mode_wrong,       // ExternalClock: the cycle steers the reference clock too
    not_reference,    // ExternalClock: the bridge is not the reference clock of its segment
};

class PhaseController {
  public:
    static constexpr std::uint8_t kMostOutliers = 8;

    // Starts again with these settings. The statistics are reset.
    void start(const PhaseSettings& settings);

    // One cycle: `error_ns` is positive when the phase is late. Returns the correction in ns: positive means that the
    // phase must come earlier. The fraction of a nanosecond is kept for the next cycle.
    [[nodiscard]] std::int64_t update(std::int64_t error_ns, Time now) {
        return update(error_ns, now, settings_.cycles_late);
    }
    // The same when the last `late` corrections are not visible in this error.
    [[nodiscard]] std::int64_t update(std::int64_t error_ns, Time now, std::uint8_t late);
    // One cycle without a reading: corrects the drift that is known. After a second (two cycles, if this is
    // more) without a reading, the phase is not known any more: state() is busy instead of in_sync, until a reading is
    // within the limit.
    [[nodiscard]] std::int64_t coast(Time now);
    // The same for a correction that is sent with frames that may be lost, as the reading was. When such corrections in
    // succession exceed the limit together, state() is busy, until a reading is within the limit.
    [[nodiscard]] std::int64_t coast_unsure(Time now);
    // The sum of the magnitudes of these corrections since the last reading.
    [[nodiscard]] std::uint64_t unsure_ns() const { return unsure_ns_; }
    // One cycle in which this controller corrects nothing: updates the state and the statistics, and measures the drift
    // by the change of the error from cycle to cycle (the mean of the last 256). A program calls either update() or
    // observe() of one controller.
    void observe(std::int64_t error_ns, Time now);
    // As observe(), for a cycle without a reading.
    void observe_nothing(Time now);

    [[nodiscard]] PhaseState state() const {
        return unknown_ && state_ == PhaseState::in_sync ? PhaseState::busy : state_;
    }
    // The drift between both clocks, in parts per thousand million: positive when the phase becomes later by itself.
    [[nodiscard]] std::int32_t drift_ppb() const;
    // The gain after the start, see PhaseSettings::gain_ppt; with automatic_gain, as the jitter allows it now.
    [[nodiscard]] std::uint16_t gain_ppt() const { return gain_ppt_; }
    // With automatic_gain: the jitter of the errors, in ns (root of the mean of the squares).
    [[nodiscard]] std::uint32_t jitter_ns() const;

    // The errors since start() or reset_statistics(): the last one, the mean of the magnitudes, the greatest magnitude.
    [[nodiscard]] std::int64_t error_ns() const { return error_ns_; }
    [[nodiscard]] std::uint64_t average_ns() const { return count_ == 0 ? 0 : sum_ns_ / count_; }
    [[nodiscard]] std::uint64_t most_ns() const { return most_ns_; }
    void reset_statistics() { sum_ns_ = most_ns_ = count_ = 0; }

  private:
    [[nodiscard]] bool is_outlier(std::int64_t error_ns);
    void watch(std::int64_t error_ns, Time now);
    void note(std::int64_t error_ns, Time now);
    [[nodiscard]] bool is_silent(Time now) const;
    void learn_drift(std::int64_t change_fs);
    void watch_limited(std::int64_t error_ns, std::uint8_t late);
    void measure_jitter(std::int64_t error_ns);
    [[nodiscard]] std::int64_t whole(std::int64_t correction_fs);

    PhaseSettings settings_;
    std::uint32_t seen_ = 0;  // errors since the start, at most the number after which the gains stay
    std::uint8_t outliers_ = 0;
    std::uint8_t saturated_ = 0;  // errors in succession that want a greater drift than the settings allow
    std::uint16_t gain_ppt_ = 0;
    std::uint16_t held_ = 0;        // errors whose correction is the greatest step, at most kManyHeld
    std::uint16_t pairs_ = 0;       // how many differences of two errors have been seen, at most kManyPairs
    bool has_last_ = false;         // the last cycle has brought an error that is no outlier
    bool unknown_ = false;          // see coast() and coast_unsure()
    std::int64_t last_ns_ = 0;      // that error
    std::uint64_t jitter_ = 0;      // the mean of the squares of the jitter, in ns², times kManyPairs
    std::int64_t drift_fs_ = 0;     // in a cycle, in femtoseconds
    std::int64_t fraction_fs_ = 0;  // not corrected yet
    std::int64_t held_fs_ = 0;      // the drift in a cycle while each correction is the greatest step
    std::int64_t held_ns_ = 0;      // the last error of them
    // The last corrections without their drift, the youngest first: the phase moves by them.
    std::array<std::int64_t, PhaseSettings::kMostLate> moved_fs_{};
    PhaseState state_ = PhaseState::idle;
    Time within_since_ = kNever;
    Time read_at_{};
    std::uint64_t unsure_ns_ = 0;
    std::int64_t error_ns_ = 0;
    std::uint64_t sum_ns_ = 0;
    std::uint64_t most_ns_ = 0;
    std::uint64_t count_ = 0;
};

// Whether the application's cycle is that of the settings: wrong when it is an eighth longer or shorter several times
// in succession.
class CycleCheck {
  public:
    // One cycle that was due at `due_ns`, after a cycle that was corrected by `earlier_ns`. Only the low 32 bits of the
    // time count, so `due_ns` may wrap. A cycle that does not fit these bits is never wrong.
    void add(std::uint64_t due_ns, std::int64_t cycle_ns, std::int64_t earlier_ns);
    // A cycle whose time is not known.
    void skip() { known_ = false; }
    void reset() { *this = CycleCheck{}; }
    [[nodiscard]] bool is_wrong() const { return odd_ >= kTooOften; }

  private:
    static constexpr std::uint8_t kTooOften = 16;
    std::uint64_t last_due_ns_ = 0;
    std::uint8_t odd_ = 0;  // in succession
    bool known_ = false;
};

// `time_ns` within a cycle of `cycle_ns`, less `wanted_ns`: from -cycle/2 to cycle/2.
[[nodiscard]] constexpr std::int64_t phase_error_ns(std::uint64_t time_ns, std::uint64_t cycle_ns,
                                                    std::int64_t wanted_ns) {
    if (cycle_ns == 0) return 0;
    const auto cycle = static_cast<std::int64_t>(cycle_ns);
    std::int64_t error = (static_cast<std::int64_t>(time_ns % cycle_ns) - wanted_ns) % cycle;
    if (error < 0) error += cycle;
    return error > cycle / 2 ? error - cycle : error;
}

}  // namespace margay
