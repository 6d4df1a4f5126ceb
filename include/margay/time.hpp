// Time as Margay sees it: a monotonic count of nanoseconds that the caller hands in. The library reads no
// clock; only an osal does.
#pragma once

#include <margay/detail/chrono.hpp>

namespace margay {

using Duration = std::chrono::nanoseconds;

// The clock is a tag: it has no now(). A Time comes from an osal (see osal/osal.hpp) or from a test.
struct MonotonicClock {
    using rep = Duration::rep;
    using period = Duration::period;
    using duration = Duration;
    using time_point = std::chrono::time_point<MonotonicClock>;
    static constexpr bool is_steady = true;
};

using Time = MonotonicClock::time_point;

// "No deadline": later than anything.
inline constexpr Time kNever = Time::max();

// `from` and `duration` later; kNever where that is past the end of all times. A negative duration counts as none.
[[nodiscard]] constexpr Time later(Time from, Duration duration) {
    if (duration <= Duration{0}) return from;
    return from > Time{} && duration >= kNever - from ? kNever : from + duration;
}

}  // namespace margay
