// Intel HEX, the text form of an EEPROM's content: records of an address, octets and a checksum.
#pragma once

#include "util/bytes.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

struct HexContent {
    std::vector<std::byte> octets;  // from address 0 on; what no record tells is 0xFF, as in an erased EEPROM
    std::string error;              // a sentence with the line; empty when all is well
};

// Reads data, end, extended segment and extended linear address records; start addresses are ignored. Strict:
// a wrong checksum, an octet that comes twice, a missing end record and what is behind it are errors.
[[nodiscard]] HexContent parse_intel_hex(std::string_view text);

// Records of 16 octets, an extended linear address wherever the upper half of the address changes, and the
// end record.
[[nodiscard]] std::string to_intel_hex(Bytes octets);

// Whether a file's content is meant to be Intel HEX: it begins like a record.
[[nodiscard]] bool looks_like_intel_hex(std::string_view content);

}  // namespace margay::samples
