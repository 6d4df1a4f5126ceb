// Access to the ESC under the lock: typed (little-endian) access to registers, and access to memory in pieces. Only
// ProcessData uses EscAccess::read() and write() directly, because its caller holds the lock for a whole update.
#pragma once

#include "subdevice/esc_access.hpp"
#include "wire/esc.hpp"

#include <array>

namespace margay::subdevice {

// Pieces of EscAccess::kMostLockedBytes. Another context may execute between two pieces, so these two are for memory
// that only step() uses.
void read_memory(EscAccess& esc, std::uint16_t address, MutableBytes into);
void write_memory(EscAccess& esc, std::uint16_t address, Bytes data);

template <class T>
[[nodiscard]] T read_register(EscAccess& esc, std::uint16_t address) {
    std::array<std::byte, sizeof(T)> bytes{};
    read_memory(esc, address, bytes);
    return load_le<T>(bytes);
}

template <class T>
void write_register(EscAccess& esc, std::uint16_t address, T value) {
    std::array<std::byte, sizeof(T)> bytes{};
    store_le(MutableBytes(bytes), 0, value);
    write_memory(esc, address, bytes);
}

}  // namespace margay::subdevice
