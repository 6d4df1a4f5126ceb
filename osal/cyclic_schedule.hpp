// Deadlines of a periodic task on a fixed grid of the clock, independent of how late the task was. This class only
// calculates; CyclicRunner (osal/linux/cyclic_runner.hpp) does the waiting.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// What happens after an overrun: the task continues a whole period after a deadline, or later, because its work took
// too long or because the system did not wake it up.
enum class OverrunPolicy : std::uint8_t {
    skip,      // the missed deadlines are left out, and the task continues with the newest one
    catch_up,  // the missed deadlines follow each other without waiting, up to a limit; earlier deadlines are left out
    stop       // the task ends: CyclicTick::stopped is true, and no further deadline comes until start()
};

// The result of one wait: the deadline that has passed.
struct CyclicTick {
    std::uint64_t cycle = 0;    // number of the deadline, from 1; skipped deadlines are counted too
    Time deadline{};            // the deadline that has passed
    Duration lateness{};        // time from the deadline until the task continued
    std::uint64_t skipped = 0;  // deadlines skipped since the previous tick because the task took too long
    bool caught_up = false;     // OverrunPolicy::catch_up: this deadline was missed, and its cycle is executed now
    bool stopped = false;       // OverrunPolicy::stop: do not execute the cycle
};

// Counters of the overruns. The counters only grow until start().
struct OverrunCounters {
    std::uint64_t overruns = 0;   // times that the task continued a whole period late or later
    std::uint64_t skipped = 0;    // deadlines left out
    std::uint64_t caught_up = 0;  // missed cycles that were executed later
};

class CyclicSchedule {
  public:
    // Deadlines are the times that are `phase` after a multiple of `period`. `period` must be positive.
    constexpr CyclicSchedule(Duration period, Duration phase) : period_(period), phase_(phase % period) {}

    // The default limit of OverrunPolicy::catch_up. After a stop of the whole program (a debugger, a suspended machine)
    // thousands of cycles without a pause between them are of no use.
    static constexpr std::uint64_t kCatchUpLimit = 10;
    // `limit`: how many missed cycles OverrunPolicy::catch_up executes later.
    constexpr void set_policy(OverrunPolicy policy, std::uint64_t limit = kCatchUpLimit) {
        policy_ = policy;
        limit_ = limit;
    }

    // Sets the first deadline at least half a period after `now`.
    constexpr void start(Time now) {
        const Duration since = (now - Time{}) - phase_ + period_ / 2;
        deadline_ = Time{} + phase_ + (since / period_ + 1) * period_;
        cycle_ = 0;
        counters_ = {};
        behind_ = stopped_ = false;
    }

    [[nodiscard]] constexpr Time deadline() const { return deadline_; }
    [[nodiscard]] constexpr Duration period() const { return period_; }

    // Moves all further deadlines: a positive time makes them later, a negative one earlier.
    constexpr void adjust(Duration by) { deadline_ += by; }

    // Ends the task, as OverrunPolicy::stop does: CyclicTick::stopped is true until start().
    constexpr void stop() { stopped_ = true; }

    // The task continues at `now`, which must not be before deadline(), unless it has stopped. With
    // OverrunPolicy::skip, deadlines that are a whole period old or older are skipped: the result is the newest
    // deadline that has passed.
    constexpr CyclicTick wake(Time now) {
        if (stopped_) return {.cycle = cycle_, .deadline = deadline_, .lateness = now - deadline_, .stopped = true};
        const auto missed = static_cast<std::uint64_t>((now - deadline_) / period_);
        if (missed != 0 && !behind_) ++counters_.overruns;
        CyclicTick tick;
        tick.skipped = policy_ == OverrunPolicy::catch_up ? missed - (missed < limit_ ? missed : limit_) : missed;
        tick.caught_up = missed > tick.skipped;
        tick.stopped = stopped_ = missed != 0 && policy_ == OverrunPolicy::stop;
        behind_ = tick.caught_up;
        counters_.caught_up += tick.caught_up ? 1 : 0;
        counters_.skipped += tick.skipped;
        deadline_ += static_cast<Duration::rep>(tick.skipped) * period_;
        tick.deadline = deadline_;
        tick.lateness = now - deadline_;
        tick.cycle = cycle_ += tick.skipped + 1;
        deadline_ += period_;
        return tick;
    }

    [[nodiscard]] constexpr const OverrunCounters& counters() const { return counters_; }
    [[nodiscard]] constexpr bool stopped() const { return stopped_; }

  private:
    Duration period_;
    Duration phase_;
    Time deadline_{};
    std::uint64_t cycle_ = 0;
    OverrunPolicy policy_ = OverrunPolicy::skip;
    std::uint64_t limit_ = kCatchUpLimit;
    OverrunCounters counters_;
    bool behind_ = false;   // the last cycle was a missed one that was executed later
    bool stopped_ = false;  // by OverrunPolicy::stop, or by stop()
};

// A phase that keeps deadlines away from the kernel's timer tick. Ticks occur at multiples of 1, 2, 4 or 10 ms of the
// monotonic clock, and the work of the kernel at a tick delays threads that wake up at the same time. The farthest time
// from all ticks is halfway between two milliseconds, or halfway between two deadlines when the period is shorter.
[[nodiscard]] constexpr Duration phase_off_the_tick(Duration period) {
    constexpr Duration kFinestTick = std::chrono::milliseconds(1);
    return (period < kFinestTick ? period : kFinestTick) / 2;
}

}  // namespace margay
