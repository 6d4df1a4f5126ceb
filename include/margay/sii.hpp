// The checksum of an SII.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// The low octet of word 7 that belongs to the words 0 to 6 (ETG.1000.6, table of the slave information interface area):
// a CRC with the polynomial x⁸ + x² + x + 1 and the start value 0xFF. The ESC compares it when it is switched on.
// Callable from anywhere.
[[nodiscard]] constexpr std::uint8_t sii_checksum(std::span<const std::byte, 14> words) {
    unsigned crc = 0xFF;
    for (const auto octet : words) {
        crc ^= std::to_integer<unsigned>(octet);
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80) != 0 ? ((crc << 1) ^ 0x07) & 0xFF : crc << 1;
    }
    return static_cast<std::uint8_t>(crc);
}

}  // namespace margay
