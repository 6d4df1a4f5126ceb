// Finds the slaves whose outputs may move an axis, so that a program can leave these outputs alone.
#pragma once

#include <margay/context.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace margay::samples {

struct Drive {
    std::uint16_t slave = 0;
    std::string why{};  // "a drive (device profile 402)"
};

// The slaves of group 0 with outputs that are drives, or that may be drives because they do not respond: device profile
// 402 in object 0x1000, a control word of CiA 402 (object 0x6040, and 0x6040 + 0x800 · n of an axis n) in the outputs,
// or the protocol SoE. Motors of other profiles are not recognized. The group must be mapped. Blocks until all answers
// have arrived.
[[nodiscard]] std::vector<Drive> find_drives(Context& ctx);

}  // namespace margay::samples
