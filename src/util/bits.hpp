// Copies bits from any bit on to any bit. Bit 0 is the least significant bit of the first octet.
#pragma once

#include "util/bytes.hpp"

#include <algorithm>
#include <cstdint>

namespace margay {

// The ranges must be inside their spans and must not overlap.
inline void copy_bits(MutableBytes to, std::uint64_t to_bit, Bytes from, std::uint64_t from_bit, std::uint64_t bits) {
    while (bits > 0) {
        const auto to_at = static_cast<unsigned>(to_bit % 8);
        const auto from_at = static_cast<unsigned>(from_bit % 8);
        const auto count = static_cast<unsigned>(std::min<std::uint64_t>(bits, 8U - std::max(to_at, from_at)));
        const unsigned mask = (0xFFU >> (8 - count)) << to_at;
        const unsigned source = (std::to_integer<unsigned>(from[static_cast<std::size_t>(from_bit / 8)]) >> from_at)
                                << to_at;
        std::byte& octet = to[static_cast<std::size_t>(to_bit / 8)];
        octet = static_cast<std::byte>((std::to_integer<unsigned>(octet) & ~mask) | (source & mask));
        to_bit += count;
        from_bit += count;
        bits -= count;
    }
}

}  // namespace margay
