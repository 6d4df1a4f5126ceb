// A check value of settings, to notice that the application has changed them (Fowler, Noll and Vo, 32 bits).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class CheckValue {
  public:
    void add(unsigned octet) { value_ = (value_ ^ (octet & 0xFF)) * 0x01000193; }
    void add(std::span<const std::byte> octets) {
        for (const std::byte octet : octets) add(std::to_integer<unsigned>(octet));
    }
    void add_word(std::uint32_t word) {
        for (unsigned shift = 0; shift < 32; shift += 8) add(word >> shift);
    }
    [[nodiscard]] std::uint32_t get() const { return value_; }
    [[nodiscard]] std::uint16_t folded() const { return static_cast<std::uint16_t>(value_ ^ value_ >> 16); }

  private:
    std::uint32_t value_ = 0x811C'9DC5;
};

}  // namespace margay
