// Copies bit fields between two buffers. Bit 0 of an octet is its least significant bit.
#pragma once

#include "util/bytes.hpp"

#include <algorithm>

namespace margay::subdevice {

// `to` and `from` must contain all octets that the copied bits touch. Whole octets at octet boundaries are copied octet
// by octet.
constexpr void copy_bits(MutableBytes to, std::size_t to_bit, Bytes from, std::size_t from_bit, std::size_t bits) {
    if (to_bit % 8 == 0 && from_bit % 8 == 0) {
        const auto whole = bits / 8;
        std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(from_bit / 8), whole,
                    to.begin() + static_cast<std::ptrdiff_t>(to_bit / 8));
        to_bit += whole * 8;
        from_bit += whole * 8;
        bits -= whole * 8;
    }
    for (; bits > 0; --bits, ++to_bit, ++from_bit) {
        const auto mask = std::byte{1} << (to_bit % 8);
        const bool set = ((from[from_bit / 8] >> (from_bit % 8)) & std::byte{1}) != std::byte{0};
        to[to_bit / 8] = set ? to[to_bit / 8] | mask : to[to_bit / 8] & ~mask;
    }
}

}  // namespace margay::subdevice
