// Writes text and numbers into a buffer of the caller. Text that does not fit is cut off.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

class TextWriter {
  public:
    explicit constexpr TextWriter(std::span<char> out) : out_(out) {}

    constexpr TextWriter& operator<<(std::string_view text) {
        for (const char c : text) put(c);
        return *this;
    }
    constexpr TextWriter& operator<<(std::uint64_t value) { return number(value, 10, 1); }
    constexpr TextWriter& hex(std::uint64_t value, int digits) {
        *this << "0x";
        return number(value, 16, digits);
    }
    [[nodiscard]] constexpr std::string_view text() const { return {out_.data(), size_}; }

  private:
    constexpr void put(char c) {
        if (size_ < out_.size()) out_[size_++] = c;
    }
    constexpr TextWriter& number(std::uint64_t value, unsigned base, int digits) {
        char reversed[20] = {};
        int n = 0;
        do {
            reversed[n++] = "0123456789abcdef"[value % base];
            value /= base;
        } while (value != 0 && n < 20);
        while (n < digits && n < 20) reversed[n++] = '0';
        while (n > 0) put(reversed[--n]);
        return *this;
    }

    std::span<char> out_;
    std::size_t size_ = 0;
};

}  // namespace margay
