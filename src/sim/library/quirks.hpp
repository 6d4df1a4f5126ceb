// Quirks of real devices by name (the facts are from the issue threads of other masters).
#pragma once

#include "sim/devices.hpp"

#include <string_view>

namespace margay::sim {

struct QuirkInfo {
    std::string_view name;
    std::string_view what;  // the behaviour of the device
};

// All quirks, in the order of the table.
[[nodiscard]] std::span<const QuirkInfo> quirks();

// Activates a quirk before the device is assembled; several quirks can be active together. Returns false when the name
// is unknown, or when the quirk belongs to the slave stack and the device has another firmware ("digital_io_16" and the
// following devices of the library use the slave stack).
[[nodiscard]] bool add_quirk(Device& device, std::string_view name);

}  // namespace margay::sim
