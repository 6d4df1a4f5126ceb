// The data types of SDO entries, registers and drive parameters by the names that users of `ethercat` write.
#pragma once

#include "ethercat/session.hpp"

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace margay::ethercat {

struct DataType {
    enum class Kind : std::uint8_t { boolean, integer, cardinal, sign_magnitude, real, text, octets, unicode };
    std::string_view name;
    std::uint16_t code = 0;  // of CoE (ETG.1000.6); 0: none
    std::uint8_t bytes = 0;  // 0: any number
    Kind kind = Kind::octets;
};

// All types in the order of --help. nullptr: there is no such type.
[[nodiscard]] std::span<const DataType> data_types();
[[nodiscard]] const DataType* type_by_name(std::string_view name);
[[nodiscard]] const DataType* type_by_code(std::uint16_t code);
// "uint32", or "type 0x0022" for a code without a name.
[[nodiscard]] std::string type_text(std::uint16_t code);

// The octets of a value that the user has written. The problem names the type and its limits.
[[nodiscard]] Answer<Octets> parse_value(const DataType& type, std::string_view text);
// A value as text: an integer in hexadecimal and decimal ("0x00000002 2"), a text as it is, octets in hexadecimal. A
// problem if the value has another size than the type.
[[nodiscard]] Answer<std::string> value_text(const DataType& type, std::span<const std::byte> value);
[[nodiscard]] nlohmann::ordered_json value_json(const DataType& type, std::span<const std::byte> value);

// "0x12 0xab"
[[nodiscard]] std::string octets_text(std::span<const std::byte> value);
// "12ab"
[[nodiscard]] std::string hex(std::span<const std::byte> value);

}  // namespace margay::ethercat
