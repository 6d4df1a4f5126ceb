// Servo drive profile over EtherCAT: the data of a mailbox message of type SoE (ETG.1000.6 "Servo drive profile over
// EtherCAT coding"). Offsets count from the SoE header. The user of a layout must check the length of the data.
#pragma once

#include "util/bytes.hpp"

#include <margay/idn.hpp>

#include <array>
#include <string_view>

namespace margay::wire::soe {

enum class Opcode : std::uint8_t {
    read_request = 1,
    read_response = 2,
    write_request = 3,
    write_response = 4,
    notification = 5,  // a command has been executed
    slave_info = 6,    // emergency
};

struct Header {
    Opcode opcode{};
    bool incomplete = false;    // more fragments follow
    bool error = false;         // only an error code follows
    std::uint8_t drive = 0;     // 0 to 7
    std::uint8_t elements = 0;  // bits of soe_element
    std::uint16_t number = 0;   // the IDN; in an incomplete message: the number of fragments that follow
    [[nodiscard]] constexpr Idn idn() const { return {number}; }
    friend constexpr bool operator==(const Header&, const Header&) = default;
};
inline constexpr std::size_t kHeaderBytes = 4;
inline constexpr std::uint8_t kDrives = 8;

[[nodiscard]] constexpr Header load_header(Bytes at) {
    const auto first = load_le<std::uint8_t>(at, 0);
    return {.opcode = static_cast<Opcode>(first & 0x07),
            .incomplete = (first & 0x08) != 0,
            .error = (first & 0x10) != 0,
            .drive = static_cast<std::uint8_t>(first >> 5),
            .elements = load_le<std::uint8_t>(at, 1),
            .number = load_le<std::uint16_t>(at, 2)};
}
constexpr void store_header(MutableBytes at, const Header& h) {
    store_le<std::uint8_t>(
        at, 0,
        static_cast<std::uint8_t>((static_cast<unsigned>(h.opcode) & 7U) | (h.incomplete ? 0x08U : 0U) |
                                  (h.error ? 0x10U : 0U) | (h.drive & 7U) << 5));
    store_le<std::uint8_t>(at, 1, h.elements);
    store_le<std::uint16_t>(at, 2, h.number);
}

// The header of a list, of a name and of a unit.
struct ListLayout {
    using current_bytes = Field<std::uint16_t, 0>;  // octets after the header
    using most_bytes = Field<std::uint16_t, 2>;
};
inline constexpr std::size_t kListHeadBytes = 4;
inline constexpr std::size_t kAttributeBytes = 4;
inline constexpr std::size_t kDataStateBytes = 2;
inline constexpr std::size_t kErrorBytes = 2;

// ------------------------------------------------------------------ cyclic data (IEC 61800-7-204)

// IDNs of the parameters that define the cyclic data, and of the parameters in the standard telegrams.
namespace idn {
inline constexpr Idn kTelegramType = Idn::standard(15);
inline constexpr Idn kAtList = Idn::standard(16);
inline constexpr Idn kMdtList = Idn::standard(24);
inline constexpr Idn kVelocityCommand = Idn::standard(36);
inline constexpr Idn kVelocityFeedback = Idn::standard(40);
inline constexpr Idn kPositionCommand = Idn::standard(47);
inline constexpr Idn kPositionFeedback = Idn::standard(51);
inline constexpr Idn kTorqueCommand = Idn::standard(80);
inline constexpr Idn kControlWord = Idn::standard(134);
inline constexpr Idn kStatusWord = Idn::standard(135);
}  // namespace idn

// The telegram type is in the lowest three bits of S-0-0015.
inline constexpr unsigned kTelegramTypes = 8;
inline constexpr unsigned kConfigurable = 7;  // the content follows from the lists S-0-0016 and S-0-0024
// The content of a standard telegram, 0 to 6, after the control word (MDT) or the status word (AT). IDN 0: nothing.
[[nodiscard]] std::array<Idn, 2> telegram(unsigned type, bool mdt);

// ------------------------------------------------------------------ error codes

// By element: the IDN itself 0x1…, name, attribute, unit, minimum, maximum, value 0x7…; then the errors of the service.
enum class ErrorCode : std::uint16_t {
    none = 0,
    no_idn = 0x1001,
    invalid_access = 0x1009,
    no_name = 0x2001,
    name_too_short = 0x2002,
    name_too_long = 0x2003,
    name_read_only = 0x2004,
    name_protected = 0x2005,
    attribute_too_short = 0x3002,
    attribute_too_long = 0x3003,
    attribute_read_only = 0x3004,
    attribute_protected = 0x3005,
    no_unit = 0x4001,
    unit_too_short = 0x4002,
    unit_too_long = 0x4003,
    unit_read_only = 0x4004,
    unit_protected = 0x4005,
    no_minimum = 0x5001,
    minimum_too_short = 0x5002,
    minimum_too_long = 0x5003,
    minimum_read_only = 0x5004,
    minimum_protected = 0x5005,
    no_maximum = 0x6001,
    maximum_too_short = 0x6002,
    maximum_too_long = 0x6003,
    maximum_read_only = 0x6004,
    maximum_protected = 0x6005,
    value_too_short = 0x7002,
    value_too_long = 0x7003,
    value_read_only = 0x7004,
    value_protected = 0x7005,  // protected in this state
    value_too_small = 0x7006,
    value_too_large = 0x7007,
    value_invalid = 0x7008,
    value_password = 0x7009,
    value_cyclic = 0x700A,
    invalid_indirect = 0x700B,
    value_settings = 0x700C,
    value_reserved = 0x700D,
    value_parameterization = 0x700E,
    value_operation = 0x700F,
    command_active = 0x7010,
    command_not_interruptible = 0x7011,
    command_not_now = 0x7012,
    command_invalid = 0x7013,
    no_data_state = 0x7014,
    no_default = 0x8001,
    default_too_long = 0x8002,
    default_read_only = 0x8004,
    invalid_drive = 0x800A,
    general = 0x800B,
    no_element = 0x800C,
};

// Text of a code; unknown values have a text that says so. The strings are static. Callable from any thread and from
// the cycle.
[[nodiscard]] std::string_view to_text(ErrorCode code);

}  // namespace margay::wire::soe
