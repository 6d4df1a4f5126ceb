// Little-endian loads and stores, and Field: a type at an offset. All Margay code accesses octets of the wire by these
// functions.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace margay {

using Bytes = std::span<const std::byte>;
using MutableBytes = std::span<std::byte>;

template <class T>
struct FieldValue {
    using Unsigned = std::make_unsigned_t<T>;
};
template <class T>
    requires std::is_enum_v<T>
struct FieldValue<T> {
    using Unsigned = std::make_unsigned_t<std::underlying_type_t<T>>;
};

// Loads an integer or enumeration, least significant octet first. The caller must have checked that sizeof(T) octets
// are available.
template <class T>
[[nodiscard]] constexpr T load_le(Bytes from, std::size_t offset = 0) {
    using U = typename FieldValue<T>::Unsigned;
    U value = 0;
    // A separate case, because compilers do not replace the loop below by a single load.
    if (std::endian::native == std::endian::little && !std::is_constant_evaluated()) {
        std::memcpy(&value, from.subspan(offset, sizeof(T)).data(), sizeof(T));
        return static_cast<T>(value);
    }
    for (std::size_t i = 0; i < sizeof(T); ++i)
        value = static_cast<U>(value | (static_cast<U>(std::to_integer<std::uint8_t>(from[offset + i])) << (8 * i)));
    return static_cast<T>(value);
}

template <class T>
constexpr void store_le(MutableBytes to, std::size_t offset, T value) {
    using U = typename FieldValue<T>::Unsigned;
    const auto bits = static_cast<U>(value);
    if (std::endian::native == std::endian::little && !std::is_constant_evaluated()) {
        std::memcpy(to.subspan(offset, sizeof(T)).data(), &bits, sizeof(T));
        return;
    }
    for (std::size_t i = 0; i < sizeof(T); ++i) to[offset + i] = static_cast<std::byte>(bits >> (8 * i));
}

// A named field of a layout: its type and its offset. Check the length of a layout once, against the `end` of its last
// field.
template <class T, std::size_t Offset>
struct Field {
    using Type = T;
    static constexpr std::size_t offset = Offset;
    static constexpr std::size_t end = Offset + sizeof(T);
    [[nodiscard]] static constexpr T load(Bytes from) { return load_le<T>(from, Offset); }
    static constexpr void store(MutableBytes to, T value) { store_le<T>(to, Offset, value); }
};

}  // namespace margay
