// Time in Margay: a monotonic count of nanoseconds that the caller passes to the library. The library reads no clock;
// only an osal does.
#pragma once

#include <margay/detail/chrono.hpp>

namespace margay {

using Duration = std::chrono::nanoseconds;

// A clock type without now(). A Time comes from an osal (see osal/osal.hpp) or from a test.
struct MonotonicClock {
    using rep = Duration::rep;
    using period = Duration::period;
    using duration = Duration;
    using time_point = std::chrono::time_point<MonotonicClock>;
    static constexpr bool is_steady = true;
};

using Time = MonotonicClock::time_point;

// No deadline: later than every other time.
inline constexpr Time kNever = Time::max();

// Inline where GCC optimizes for size, too: the comparisons of <chrono> would be calls, with both operands in memory.
// Comparisons with other units are those of <chrono>.
// clang-format off
[[gnu::always_inline]] constexpr bool operator<(Duration a, Duration b) { return a.count() < b.count(); }
[[gnu::always_inline]] constexpr bool operator>(Duration a, Duration b) { return a.count() > b.count(); }
[[gnu::always_inline]] constexpr bool operator<=(Duration a, Duration b) { return a.count() <= b.count(); }
[[gnu::always_inline]] constexpr bool operator>=(Duration a, Duration b) { return a.count() >= b.count(); }
[[gnu::always_inline]] constexpr bool operator<(Time a, Time b) {
    return a.time_since_epoch() < b.time_since_epoch();
}
[[gnu::always_inline]] constexpr bool operator>(Time a, Time b) {
    return a.time_since_epoch() > b.time_since_epoch();
}
[[gnu::always_inline]] constexpr bool operator<=(Time a, Time b) {
    return a.time_since_epoch() <= b.time_since_epoch();
}
[[gnu::always_inline]] constexpr bool operator>=(Time a, Time b) {
    return a.time_since_epoch() >= b.time_since_epoch();
}
// clang-format on

// `from` plus `duration`; kNever if the sum exceeds the range of Time. A negative duration counts as zero.
[[nodiscard]] constexpr Time later(Time from, Duration duration) {
    if (duration <= Duration{0}) return from;
    return from > Time{} && duration >= kNever - from ? kNever : from + duration;
}

}  // namespace margay
