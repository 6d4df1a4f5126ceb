// Deadlines of a periodic task on a fixed grid of the clock, independent of how late the task was. This class only
// calculates; CyclicRunner (osal/linux/cyclic_runner.hpp) does the waiting.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// The result of one wait: the deadline that has passed.
struct CyclicTick {
    std::uint64_t cycle = 0;    // number of the deadline, from 1; skipped deadlines are counted too
    Time deadline{};            // the deadline that has passed
    Duration lateness{};        // time from the deadline until the task continued
    std::uint64_t skipped = 0;  // deadlines skipped since the previous tick because the task took too long
};

class CyclicSchedule {
  public:
    // Deadlines are the times that are `phase` after a multiple of `period`. `period` must not be zero.
    constexpr CyclicSchedule(Duration period, Duration phase) : period_(period), phase_(phase % period) {}

    // Sets the first deadline at least half a period after `now`.
    constexpr void start(Time now) {
        const Duration since = (now - Time{}) - phase_ + period_ / 2;
        deadline_ = Time{} + phase_ + (since / period_ + 1) * period_;
        cycle_ = 0;
    }

    [[nodiscard]] constexpr Time deadline() const { return deadline_; }
    [[nodiscard]] constexpr Duration period() const { return period_; }

    // Moves all further deadlines: a positive time makes them later, a negative one earlier.
    constexpr void shift(Duration by) { deadline_ += by; }

    // The task continues at `now`, which must not be before deadline(). Deadlines that are a whole period old or older
    // are skipped: the result is the newest deadline that has passed.
    constexpr CyclicTick wake(Time now) {
        CyclicTick tick;
        tick.skipped = static_cast<std::uint64_t>((now - deadline_) / period_);
        deadline_ += static_cast<Duration::rep>(tick.skipped) * period_;
        tick.deadline = deadline_;
        tick.lateness = now - deadline_;
        tick.cycle = cycle_ += tick.skipped + 1;
        deadline_ += period_;
        return tick;
    }

  private:
    Duration period_;
    Duration phase_;
    Time deadline_{};
    std::uint64_t cycle_ = 0;
};

// A phase that keeps deadlines away from the kernel's timer tick. Ticks occur at multiples of 1, 2, 4 or 10 ms of the
// monotonic clock, and the work of the kernel at a tick delays threads that wake up at the same time. The farthest time
// from all ticks is halfway between two milliseconds, or halfway between two deadlines when the period is shorter.
[[nodiscard]] constexpr Duration phase_off_the_tick(Duration period) {
    constexpr Duration kFinestTick = std::chrono::milliseconds(1);
    return (period < kFinestTick ? period : kFinestTick) / 2;
}

}  // namespace margay
