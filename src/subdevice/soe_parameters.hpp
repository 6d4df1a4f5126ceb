// The parameters of a drive: constexpr tables that describe the parameters, and one image of octets that contains the
// values.
//
// A table is written once for a type of drive and is placed in flash. Values are stored in the image in the byte order
// of the wire (little-endian). Therefore an application accesses them through Field, and a message carries them without
// conversion:
//
//     struct Values {
//         using position = Field<std::int32_t, 0>;
//         static constexpr std::size_t telegram = 4;                           // a list: header and eight IDNs
//         static constexpr std::size_t reset = telegram + soe_list_bytes(16);  // a procedure command
//         static constexpr std::size_t bytes = reset + kSoeCommandBytes;
//     };
//     constexpr Idn kAtDefault[] = {Idn::standard(51)};
//     constexpr SoeParameter kParameters[] = {  // ascending
//         soe_idn_list(Idn::standard(16), "AT configuration list", Values::telegram, 16, kAtDefault),
//         soe_value<Values::position>(Idn::standard(51), "Position feedback value", "inc").read_only(),
//         soe_procedure(Idn::standard(99), "Reset class 1 diagnostic", Values::reset)};
//     static_assert(well_formed(kParameters, Values::bytes));
#pragma once

#include "util/bytes.hpp"
#include "wire/soe.hpp"

#include <type_traits>

namespace margay::subdevice {

enum class SoeStorage : std::uint8_t {
    image,         // the value is in the image of the drive
    constant,      // the value is SoeParameter::initial
    text,          // the value is SoeParameter::text
    all_idns,      // list of the IDNs of all parameters in the table
    all_commands,  // list of the IDNs of all procedure commands in the table
};

struct SoeParameter {
    Idn idn;
    SoeStorage storage = SoeStorage::image;
    SoeAttribute attribute{};
    std::string_view name{};
    std::string_view unit{};
    std::uint32_t offset = 0;      // in octets from the start of the image
    std::uint16_t most_bytes = 0;  // of a list in the image: maximum octets of its elements, without the list header
    bool limited = false;
    std::int64_t minimum = 0;  // valid if `limited`
    std::int64_t maximum = 0;
    std::uint64_t initial = 0;            // initial value of a number, or constant
    std::span<const Idn> initial_idns{};  // initial value of a list of IDNs
    std::string_view text{};              // constant, or initial value of a text

    // Return a copy of the parameter: within() with limits for writes, read_only() for a value that only the device
    // changes, protect() with write protection in the given states.
    [[nodiscard]] constexpr SoeParameter within(std::int64_t least, std::int64_t most) const {
        SoeParameter p = *this;
        p.limited = true;
        p.minimum = least;
        p.maximum = most;
        return p;
    }
    [[nodiscard]] constexpr SoeParameter read_only() const { return protect(true, true, true); }
    [[nodiscard]] constexpr SoeParameter protect(bool preop, bool safeop, bool op) const {
        SoeParameter p = *this;
        p.attribute.protected_preop = preop;
        p.attribute.protected_safeop = safeop;
        p.attribute.protected_op = op;
        return p;
    }
    [[nodiscard]] constexpr SoeParameter starts_with(std::uint64_t value) const {
        SoeParameter p = *this;
        p.initial = value;
        return p;
    }
    [[nodiscard]] constexpr bool never_written() const {
        return storage != SoeStorage::image ||
               (attribute.protected_preop && attribute.protected_safeop && attribute.protected_op);
    }
    // Octets that the parameter uses in the image.
    [[nodiscard]] constexpr std::size_t image_bytes() const;
};

// A procedure command in the image: the value that was written to it, and its data state.
inline constexpr std::size_t kSoeCommandBytes = 4;
[[nodiscard]] constexpr std::size_t soe_list_bytes(std::size_t most_bytes) {
    return wire::soe::kListHeadBytes + most_bytes;
}

constexpr std::size_t SoeParameter::image_bytes() const {
    if (storage != SoeStorage::image) return 0;
    if (attribute.command) return kSoeCommandBytes;
    return attribute.list ? soe_list_bytes(most_bytes) : attribute.bytes;
}

// ------------------------------------------------------------------ functions to build tables

template <class T>
inline constexpr SoeType kSoeTypeOf = std::is_signed_v<T> ? SoeType::signed_decimal : SoeType::unsigned_decimal;

// A number in the image.
template <class F>
[[nodiscard]] constexpr SoeParameter soe_value(Idn idn, std::string_view name, std::string_view unit = {},
                                               std::uint8_t decimals = 0) {
    using T = typename F::Type;
    return {.idn = idn,
            .attribute = {.bytes = sizeof(T), .type = kSoeTypeOf<T>, .decimals = decimals},
            .name = name,
            .unit = unit,
            .offset = F::offset};
}
template <class T>
[[nodiscard]] constexpr SoeParameter soe_constant(Idn idn, std::string_view name, T value, std::string_view unit = {}) {
    SoeParameter p{.idn = idn, .storage = SoeStorage::constant, .name = name, .unit = unit};
    p.attribute = {.bytes = sizeof(T), .type = kSoeTypeOf<T>};
    p.initial = static_cast<std::uint64_t>(value);
    return p.read_only();
}
[[nodiscard]] constexpr SoeParameter soe_text(Idn idn, std::string_view name, std::string_view text) {
    SoeParameter p{.idn = idn, .storage = SoeStorage::text, .name = name, .text = text};
    p.attribute = {.bytes = 1, .list = true, .type = SoeType::text};
    return p.read_only();
}
// A list of octets or numbers in the image.
[[nodiscard]] constexpr SoeParameter soe_list(Idn idn, std::string_view name, std::size_t offset,
                                              std::uint16_t most_bytes, std::uint8_t element_bytes, SoeType type) {
    return {.idn = idn,
            .attribute = {.bytes = element_bytes, .list = true, .type = type},
            .name = name,
            .offset = static_cast<std::uint32_t>(offset),
            .most_bytes = most_bytes};
}
[[nodiscard]] constexpr SoeParameter soe_idn_list(Idn idn, std::string_view name, std::size_t offset,
                                                  std::uint16_t most_bytes, std::span<const Idn> initial = {}) {
    SoeParameter p = soe_list(idn, name, offset, most_bytes, 2, SoeType::idn);
    p.initial_idns = initial;
    return p;
}
// A list of IDNs that never changes. It uses no memory of the image.
[[nodiscard]] constexpr SoeParameter soe_fixed_idns(Idn idn, std::string_view name, std::span<const Idn> list) {
    SoeParameter p = soe_idn_list(idn, name, 0, 0, list);
    p.storage = SoeStorage::constant;
    return p.read_only();
}
// The list of all parameters or of all procedure commands, generated from the table.
[[nodiscard]] constexpr SoeParameter soe_all(Idn idn, std::string_view name, SoeStorage which) {
    SoeParameter p = soe_fixed_idns(idn, name, {});
    p.storage = which;
    return p;
}
[[nodiscard]] constexpr SoeParameter soe_procedure(Idn idn, std::string_view name, std::size_t offset) {
    return {.idn = idn,
            .attribute = {.bytes = 2, .command = true},
            .name = name,
            .offset = static_cast<std::uint32_t>(offset)};
}

// Checks that the table is ascending and that all values are inside the image.
[[nodiscard]] constexpr bool well_formed(std::span<const SoeParameter> table, std::size_t image_bytes) {
    for (std::size_t n = 0; n < table.size(); ++n) {
        if (n != 0 && table[n].idn.value <= table[n - 1].idn.value) return false;
        if (table[n].image_bytes() != 0 && table[n].offset + table[n].image_bytes() > image_bytes) return false;
        if (table[n].initial_idns.size() * 2 > table[n].most_bytes && table[n].storage == SoeStorage::image)
            return false;
    }
    return true;
}

}  // namespace margay::subdevice
