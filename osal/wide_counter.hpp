// Extends a hardware counter of 32 bits to a Time, for ports to microcontrollers.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

class WideCounter {
  public:
    // `hertz`: how often the counter counts in a second, not 0.
    explicit constexpr WideCounter(std::uint32_t hertz) noexcept
        : hertz_(hertz), whole_nanoseconds_(kSecond % hertz == 0 ? static_cast<std::uint32_t>(kSecond / hertz) : 0) {}

    // The time of a counter that counts up from 0 to 2^32 − 1 and begins again. `count` is its present value. Must be
    // called at least once in the time in which the counter counts through all its values: every 172 s at 25 MHz, every
    // 8 s at 500 MHz. Not callable from two threads or from an interrupt at the same time. The sum has no rounding
    // error that grows: after a day it is as exact as after a second.
    [[nodiscard]] constexpr Time extend(std::uint32_t count) noexcept {
        const std::uint32_t ticks = count - last_;
        last_ = count;
        if (whole_nanoseconds_ != 0) {
            time_ += Duration(static_cast<std::int64_t>(std::uint64_t{ticks} * whole_nanoseconds_));
            return time_;
        }
        const std::uint64_t scaled = ticks * kSecond + rest_;
        rest_ = scaled % hertz_;
        time_ += Duration(static_cast<std::int64_t>(scaled / hertz_));
        return time_;
    }

  private:
    static constexpr std::uint64_t kSecond = 1'000'000'000;
    std::uint32_t hertz_;
    std::uint32_t whole_nanoseconds_;  // of one tick; 0: a tick is not a whole number of nanoseconds
    std::uint32_t last_ = 0;
    std::uint64_t rest_ = 0;  // in 1/hertz ns
    Time time_{};
};

}  // namespace margay
