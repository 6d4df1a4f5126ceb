// The process data of the devices of the library, as a master finds it on an undisturbed segment.
#pragma once

#include <cstdint>
#include <string>

namespace margay::storm {

struct DeviceBits {
    std::uint32_t inputs = 0;
    std::uint32_t outputs = 0;
};

// Returns the process data of a device without quirks. It is read once per process and device.
[[nodiscard]] DeviceBits bits_of_device(const std::string& name);

}  // namespace margay::storm
