// Seeded pseudo-random numbers for the filters: the same seed gives the same sequence on every machine.
#pragma once

#include <cstdint>

namespace margay {

// Probability of an event in parts per million. It is an integer, so that results are equal with every compiler and
// FPU.
struct Rate {
    std::uint32_t per_million = 0;
    [[nodiscard]] static constexpr Rate percent(std::uint32_t value) noexcept { return {value * 10'000}; }
    [[nodiscard]] static constexpr Rate always() noexcept { return {1'000'000}; }
};

// SplitMix64 (Steele, Lea, Flood 2014). Every seed is suitable, including zero.
class Chance {
  public:
    explicit constexpr Chance(std::uint64_t seed) noexcept : state_(seed) {}

    [[nodiscard]] constexpr std::uint64_t next() noexcept {
        state_ += 0x9E3779B97F4A7C15u;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
        return z ^ (z >> 31);
    }
    // Returns 0 … bound − 1, and 0 for a bound of 0. The bias is below bound / 2⁶⁴.
    [[nodiscard]] constexpr std::uint64_t below(std::uint64_t bound) noexcept {
        return bound == 0 ? 0 : next() % bound;
    }
    // Uses one random number for every rate, so that another rate does not change the rest of the sequence.
    [[nodiscard]] constexpr bool happens(Rate rate) noexcept { return below(1'000'000) < rate.per_million; }

  private:
    std::uint64_t state_;
};

}  // namespace margay
