// Manners of real devices, each by its name (the facts behind them are from the issue threads of other masters).
#pragma once

#include "sim/devices.hpp"

#include <string_view>

namespace margay::sim {

struct QuirkInfo {
    std::string_view name;
    std::string_view what;  // the device does, in words
};

// All there are, in the order of the table.
[[nodiscard]] std::span<const QuirkInfo> quirks();

// Switches one on, before the device is assembled; several may be on together. False: there is none of that name, or it
// is one of the slave stack and the device runs another firmware (those of the library that do: "digital_io_16" and
// behind).
[[nodiscard]] bool add_quirk(Device& device, std::string_view name);

}  // namespace margay::sim
