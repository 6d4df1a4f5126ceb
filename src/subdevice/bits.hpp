// Copies bit fields between two buffers. Bit 0 of an octet is its least significant bit.
#pragma once

#include "util/bytes.hpp"

#include <algorithm>

namespace margay::subdevice {

// `to` and `from` must contain all octets that the copied bits touch. Whole octets at octet boundaries are copied octet
// by octet.
constexpr void copy_bits(MutableBytes to, std::size_t to_bit, Bytes from, std::size_t from_bit, std::size_t bits) {
    if (bits >= 8 && to_bit % 8 == 0 && from_bit % 8 == 0) {
        const auto whole = bits / 8;
        std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(from_bit / 8), whole,
                    to.begin() + static_cast<std::ptrdiff_t>(to_bit / 8));
        to_bit += whole * 8;
        from_bit += whole * 8;
        bits -= whole * 8;
    }
    // The bits that lie in one octet on both sides, at once.
    while (bits > 0) {
        const auto count = std::min({bits, 8 - to_bit % 8, 8 - from_bit % 8});
        const auto low = static_cast<std::byte>((1u << count) - 1);
        const auto value = (from[from_bit / 8] >> (from_bit % 8)) & low;
        auto& octet = to[to_bit / 8];
        octet = (octet & ~(low << (to_bit % 8))) | (value << (to_bit % 8));
        to_bit += count;
        from_bit += count;
        bits -= count;
    }
}

}  // namespace margay::subdevice
