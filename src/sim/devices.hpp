// Devices ready to be plugged into a segment: from an SII image, or of our own making (vendor id 0x00004D47).
#pragma once

#include "sim/esc.hpp"

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace margay::sim {

inline constexpr std::uint32_t kVendorId = 0x00004D47;

struct Device {
    EscDescription chip;
    std::vector<std::byte> sii;
    std::unique_ptr<Firmware> firmware;

    // The device as a slave of a segment; its parts are moved out.
    [[nodiscard]] std::unique_ptr<Esc> assemble() &&;
};

// A device of which only the image is known. Any octets will do: what cannot be read is not there.
[[nodiscard]] Device device_from_sii(std::vector<std::byte> image);

// A device of the library: "coupler", "digital_in_8" …; nothing when there is none of that name.
[[nodiscard]] std::optional<Device> make_device(std::string_view name);
// The names, in the order of the library's table.
[[nodiscard]] std::span<const std::string_view> device_names();

// A chip by name ("et1100", "et1200", "ip_core", "lan9252", "junction").
[[nodiscard]] std::optional<EscDescription> chip_by_name(std::string_view name);

}  // namespace margay::sim
