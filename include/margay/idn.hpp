// The terms of the servo drive profile (IEC 61800-7-204, ETG.1000.6 "Servo drive profile over EtherCAT") for a
// parameter: its identification number (IDN), its elements, and its attribute. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace margay {

// An identification number, for example S-0-0015 or P-0-0100: standard (S) or product-specific (P), the parameter set,
// and the number in the set.
struct Idn {
    std::uint16_t value = 0;  // bit 15: product-specific; bits 12–14: parameter set; bits 0–11: number

    [[nodiscard]] static constexpr Idn standard(unsigned number, unsigned set = 0) {
        return {static_cast<std::uint16_t>((set & 7U) << 12 | (number & 0x0FFFU))};
    }
    [[nodiscard]] static constexpr Idn product(unsigned number, unsigned set = 0) {
        return {static_cast<std::uint16_t>(0x8000U | standard(number, set).value)};
    }
    [[nodiscard]] constexpr bool of_product() const { return (value & 0x8000) != 0; }
    [[nodiscard]] constexpr unsigned set() const { return (value >> 12) & 7U; }
    [[nodiscard]] constexpr unsigned number() const { return value & 0x0FFFU; }
    friend constexpr bool operator==(const Idn&, const Idn&) = default;
};

// Writes the IDN in the notation "S-0-0047" into `out` (cut if it does not fit, without a terminating zero) and returns
// the written part.
std::string_view to_text(Idn idn, std::span<char> out);
// Parses this notation: "S-0-0047", "p-0-100", also "S-0-47" and "S-0047" (set 0). Empty if `text` is no IDN.
[[nodiscard]] std::optional<Idn> parse_idn(std::string_view text);

// The elements of a parameter, as bits. A request may combine several; they follow each other in this order.
namespace soe_element {
inline constexpr std::uint8_t kDataState = 0x01;
inline constexpr std::uint8_t kName = 0x02;
inline constexpr std::uint8_t kAttribute = 0x04;
inline constexpr std::uint8_t kUnit = 0x08;
inline constexpr std::uint8_t kMinimum = 0x10;
inline constexpr std::uint8_t kMaximum = 0x20;
inline constexpr std::uint8_t kValue = 0x40;
inline constexpr std::uint8_t kDefault = 0x80;
}  // namespace soe_element

// How to display a value.
enum class SoeType : std::uint8_t {
    binary = 0,
    unsigned_decimal = 1,
    signed_decimal = 2,
    hexadecimal = 3,
    text = 4,
    idn = 5,
    floating = 6
};

// The attribute of a parameter (its element 3): the type and format of its value.
struct SoeAttribute {
    std::uint16_t scale = 1;  // factor from the value to the displayed value
    std::uint8_t bytes = 2;   // size of the value, or of each element of a list: 1, 2, 4 or 8
    bool list = false;  // of variable length: two octets present length and two octets maximum length in octets, then
                        // the elements
    bool command = false;  // a procedure command
    SoeType type = SoeType::binary;
    std::uint8_t decimals = 0;     // decimal places of the displayed value, 0 to 15
    bool protected_preop = false;  // cannot be written in this state
    bool protected_safeop = false;
    bool protected_op = false;
    friend constexpr bool operator==(const SoeAttribute&, const SoeAttribute&) = default;
};
[[nodiscard]] constexpr SoeAttribute soe_attribute(std::uint32_t bits) {
    return {.scale = static_cast<std::uint16_t>(bits),
            .bytes = static_cast<std::uint8_t>(1U << ((bits >> 16) & 3U)),
            .list = (bits & 0x0004'0000) != 0,
            .command = (bits & 0x0008'0000) != 0,
            .type = static_cast<SoeType>((bits >> 20) & 7U),
            .decimals = static_cast<std::uint8_t>((bits >> 24) & 15U),
            .protected_preop = (bits & 0x1000'0000) != 0,
            .protected_safeop = (bits & 0x2000'0000) != 0,
            .protected_op = (bits & 0x4000'0000) != 0};
}
[[nodiscard]] constexpr std::uint32_t soe_attribute_bits(const SoeAttribute& a) {
    const std::uint32_t length = a.bytes >= 8 ? 3 : a.bytes >= 4 ? 2 : a.bytes >= 2 ? 1 : 0;
    return a.scale | length << 16 | (a.list ? 0x0004'0000U : 0U) | (a.command ? 0x0008'0000U : 0U) |
           (static_cast<std::uint32_t>(a.type) & 7U) << 20 | (a.decimals & 15U) << 24 |
           (a.protected_preop ? 0x1000'0000U : 0U) | (a.protected_safeop ? 0x2000'0000U : 0U) |
           (a.protected_op ? 0x4000'0000U : 0U);
}

// The bits of a procedure command: of its data state, and of the value that the master writes.
namespace soe_command {
inline constexpr std::uint16_t kSet = 0x0001;      // state and value
inline constexpr std::uint16_t kEnable = 0x0002;   // state and value: enabled, not interrupted
inline constexpr std::uint16_t kRunning = 0x0004;  // state: not finished yet
inline constexpr std::uint16_t kFailed = 0x0008;   // state: error, the command cannot be executed
inline constexpr std::uint16_t kInvalid = 0x0100;  // state, of any parameter: the value is invalid
}  // namespace soe_command

}  // namespace margay
