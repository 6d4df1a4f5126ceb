// Typed (little-endian) access to ESC registers through EscAccess.
#pragma once

#include "subdevice/esc_access.hpp"
#include "wire/esc.hpp"

#include <array>

namespace margay::subdevice {

template <class T>
[[nodiscard]] T read_register(EscAccess& esc, std::uint16_t address) {
    std::array<std::byte, sizeof(T)> bytes{};
    esc.read(address, bytes);
    return load_le<T>(bytes);
}

template <class T>
void write_register(EscAccess& esc, std::uint16_t address, T value) {
    std::array<std::byte, sizeof(T)> bytes{};
    store_le(MutableBytes(bytes), 0, value);
    esc.write(address, bytes);
}

}  // namespace margay::subdevice
