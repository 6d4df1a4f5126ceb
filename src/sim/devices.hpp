// Devices that can be added to a segment: from an SII image, or devices of Margay (vendor ID 0x00004D47).
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

    // Creates the slave for a segment; moves the parts out of the device.
    [[nodiscard]] std::unique_ptr<Esc> assemble() &&;
};

// Creates a device from its SII image only. Any octets are accepted: content that cannot be read is treated as absent.
[[nodiscard]] Device device_from_sii(std::vector<std::byte> image);

// A device of the library ("coupler", "digital_in_8", …); nullopt when the name is unknown.
[[nodiscard]] std::optional<Device> make_device(std::string_view name);
// All names, in the order of the table of the library.
[[nodiscard]] std::span<const std::string_view> device_names();

// A chip by its name ("et1100", "et1200", "ip_core", "lan9252", "junction").
[[nodiscard]] std::optional<EscDescription> chip_by_name(std::string_view name);

}  // namespace margay::sim
