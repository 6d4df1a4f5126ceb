// The register area of an ESC, 0x0000–0x0FFF: the octets, and access flags for each octet.
#pragma once

#include "sim/esc_description.hpp"
#include "util/bytes.hpp"
#include "wire/esc.hpp"

#include <array>
#include <cstdint>

namespace margay::sim {

namespace access {
inline constexpr std::uint8_t kRead = 0x01;  // implemented; octets without this flag cannot be read
inline constexpr std::uint8_t kEcatWrite = 0x02;
inline constexpr std::uint8_t kPdiWrite = 0x04;
inline constexpr std::uint8_t kDynamic = 0x08;      // must be updated before it is read
inline constexpr std::uint8_t kReadEffect = 0x10;   // a read has side effects
inline constexpr std::uint8_t kWriteEffect = 0x20;  // a write has another effect than storing the octet
}  // namespace access

// The digital outputs of an ESC: process data that is not in RAM.
inline constexpr std::uint32_t kDigitalOutputs = 0x0F00;

class RegisterFile {
  public:
    static constexpr std::uint32_t kSize = 0x1000;

    // Sets the flags for the registers of a chip. `dc_enabled`: the DC unit is switched on.
    void lay_out(const EscDescription& esc, bool dc_enabled);
    void clear() { bytes_.fill(std::byte{0}); }

    template <class T>
    [[nodiscard]] T get(std::uint16_t address) const {
        return load_le<T>(bytes_, address);
    }
    template <class T>
    void set(std::uint16_t address, T value) {
        store_le<T>(bytes_, address, value);
    }
    [[nodiscard]] MutableBytes bytes() { return bytes_; }
    [[nodiscard]] Bytes bytes() const { return bytes_; }

    [[nodiscard]] std::uint8_t flags(std::uint32_t address) const { return flags_[address]; }
    // All flags of the octets in [address, address + length), combined by OR.
    [[nodiscard]] std::uint8_t flags_in(std::uint32_t address, std::size_t length) const {
        unsigned found = 0;
        for (std::size_t i = 0; i < length; ++i) found |= flags_[address + i];
        return static_cast<std::uint8_t>(found);
    }

  private:
    void add(wire::Register where, unsigned flags);
    void add_dc(const EscDescription& esc, bool enabled);

    std::array<std::byte, kSize> bytes_{};
    std::array<std::uint8_t, kSize> flags_{};
};

}  // namespace margay::sim
