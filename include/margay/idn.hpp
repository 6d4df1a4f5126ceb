// What the servodrive profile (IEC 61800-7-204, ETG.1000.6 "Servo drive profile over EtherCAT") calls a parameter: its
// identification number, the elements it has, and its attribute. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace margay {

// An identification number: S-0-0015, P-0-0100 …: of the standard or of the product, the parameter set, the number in
// it.
struct Idn {
    std::uint16_t value = 0;  // bit 15: of the product; bits 12–14: set; bits 0–11: number

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

// Writes it as people do, "S-0-0047", into `out` (cut where it does not fit, no zero behind it) and returns the part
// that was written.
std::string_view to_text(Idn idn, std::span<char> out);
// Reads that notation: "S-0-0047", "p-0-100", also "S-0-47" and "S-0047" (set 0). Nothing when it is none.
[[nodiscard]] std::optional<Idn> parse_idn(std::string_view text);

// The elements of a parameter, as bits: a request may ask for several, which come one behind the other in this order.
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

// How a value is to be shown.
enum class SoeType : std::uint8_t {
    binary = 0,
    unsigned_decimal = 1,
    signed_decimal = 2,
    hexadecimal = 3,
    text = 4,
    idn = 5,
    floating = 6
};

// What kind of value a parameter has: its element 3.
struct SoeAttribute {
    std::uint16_t scale = 1;  // conversion factor to the value shown
    std::uint8_t bytes = 2;   // of the value, or of each element of a list: 1, 2, 4 or 8
    bool list =
        false;  // of variable length: two octets of present and two of largest length in octets, then the elements
    bool command = false;  // a procedure command
    SoeType type = SoeType::binary;
    std::uint8_t decimals = 0;     // places behind the point, 0 to 15
    bool protected_preop = false;  // cannot be written in that state
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

// The data state of a procedure command, and what is written to its value.
namespace soe_command {
inline constexpr std::uint16_t kSet = 0x0001;      // both
inline constexpr std::uint16_t kEnable = 0x0002;   // both: may be executed, is not interrupted
inline constexpr std::uint16_t kRunning = 0x0004;  // state: not executed yet
inline constexpr std::uint16_t kFailed = 0x0008;   // state: an error, it cannot be executed
inline constexpr std::uint16_t kInvalid = 0x0100;  // state, of any parameter: the value is not valid
}  // namespace soe_command

}  // namespace margay
