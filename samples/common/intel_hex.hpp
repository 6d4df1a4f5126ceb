// Reads and writes Intel HEX, a text form of the EEPROM content. Each record has an address, octets and a checksum.
#pragma once

#include "util/bytes.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

struct HexContent {
    std::vector<std::byte> octets;  // from address 0; octets without a record are 0xFF, as in an erased EEPROM
    std::string error;              // a sentence that names the line; empty when there is no error
};

// Reads data, end, extended segment address and extended linear address records. Start address records are ignored.
// The parser is strict: a wrong checksum, an octet given twice, a missing end record and text behind the end record
// are errors.
[[nodiscard]] HexContent parse_intel_hex(std::string_view text);

// Writes records of 16 octets, an extended linear address record wherever the upper half of the address changes, and
// the end record.
[[nodiscard]] std::string to_intel_hex(Bytes octets);

// True when the content of a file begins like an Intel HEX record.
[[nodiscard]] bool looks_like_intel_hex(std::string_view content);

}  // namespace margay::samples
