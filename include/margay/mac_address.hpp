// The address of an Ethernet interface.
#pragma once

#include <array>
#include <cstdint>

namespace margay {

// The first octet is the first one on the wire.
using MacAddress = std::array<std::uint8_t, 6>;

}  // namespace margay
