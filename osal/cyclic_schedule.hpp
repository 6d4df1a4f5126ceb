// When a periodic task is due: deadlines on a fixed grid of the clock, however late the task was. Arithmetic only; who
// waits, and how, is another matter (osal/linux/cyclic_runner.hpp).
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// One time that the task was let go on.
struct CyclicTick {
    std::uint64_t cycle = 0;    // 1 the first; counts deadlines, also those that were skipped
    Time deadline{};            // the one that has come
    Duration lateness{};        // how long ago
    std::uint64_t skipped = 0;  // deadlines passed over since the tick before: the work took too long
};

class CyclicSchedule {
  public:
    // Deadlines are those times of the clock that are `phase` after a multiple of `period`, which is not zero.
    constexpr CyclicSchedule(Duration period, Duration phase) : period_(period), phase_(phase % period) {}

    // The first deadline is at least half a period ahead of `now`.
    constexpr void start(Time now) {
        const Duration since = (now - Time{}) - phase_ + period_ / 2;
        deadline_ = Time{} + phase_ + (since / period_ + 1) * period_;
        cycle_ = 0;
    }

    [[nodiscard]] constexpr Time deadline() const { return deadline_; }
    [[nodiscard]] constexpr Duration period() const { return period_; }

    // The task goes on at `now`, which is not before deadline(). A deadline that is a whole period ago or more is
    // skipped: the task answers to the newest one.
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

// A phase that keeps deadlines away from the kernel's timer tick. Ticks come at multiples of 1, 2, 4 or 10 ms of the
// monotonic clock, and what they do delays whoever wants to wake up then: halfway between two milliseconds, or between
// two deadlines where those come more often, is farthest from all of them.
[[nodiscard]] constexpr Duration phase_off_the_tick(Duration period) {
    constexpr Duration kFinestTick = std::chrono::milliseconds(1);
    return (period < kFinestTick ? period : kFinestTick) / 2;
}

}  // namespace margay
