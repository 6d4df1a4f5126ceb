// Extends a hardware counter of 32 bits to a Time, for ports to microcontrollers.
#pragma once

#include <margay/time.hpp>

#include <bit>
#include <cstdint>

namespace margay {

class WideCounter {
  public:
    // `hertz`: how often the counter counts in a second, not 0.
    explicit constexpr WideCounter(std::uint32_t hertz) noexcept
        : hertz_(hertz), nanoseconds_(kSecond / hertz), fraction_(kSecond % hertz) {}

    // The time of a counter that counts up from 0 to 2^32 − 1 and begins again. `count` is its present value. Must be
    // called at least once in the time in which the counter counts through all its values: every 172 s at 25 MHz, every
    // 8 s at 500 MHz. Not callable from two threads or from an interrupt at the same time. The sum has no rounding
    // error that grows: after a day it is as exact as after a second.
    [[nodiscard]] constexpr Time extend(std::uint32_t count) noexcept {
        const std::uint32_t ticks = count - last_;
        last_ = count;
        rest_ += std::uint64_t{ticks} * fraction_;
        std::uint64_t whole = std::uint64_t{ticks} * nanoseconds_;
        // No division of 64 bits: its code has 0.7 KiB on a processor without this instruction.
        while (rest_ >> 32 != 0) {
            const auto shift = static_cast<unsigned>(std::bit_width(rest_) - std::bit_width(hertz_) - 1);
            rest_ -= std::uint64_t{hertz_} << shift;
            whole += std::uint64_t{1} << shift;
        }
        const auto rest = static_cast<std::uint32_t>(rest_);
        rest_ = rest % hertz_;
        time_ += Duration(static_cast<std::int64_t>(whole + rest / hertz_));
        return time_;
    }

  private:
    static constexpr std::uint32_t kSecond = 1'000'000'000;
    std::uint32_t hertz_;
    std::uint32_t nanoseconds_;  // of one tick, rounded down
    std::uint32_t fraction_;     // the rest of nanoseconds_, in 1/hertz ns
    std::uint32_t last_ = 0;
    std::uint64_t rest_ = 0;  // in 1/hertz ns
    Time time_{};
};

}  // namespace margay
