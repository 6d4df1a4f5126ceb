// What an application writes to use a process image by name (margay/entry.hpp), as lines of C++ to be pasted.
#pragma once

#include "common/process_map.hpp"

namespace margay::samples {

// The declaration of the handle for each entry of the map, in its order: "margay::Output<bool> s1_enable{1, 0x7000,
// 1};". Empty for gaps, for what nobody has described, and where there is no type for so many bits.
[[nodiscard]] std::vector<std::string> entry_declarations(const ProcessMap& map);

// The declarations, and the list of them for GroupConfiguration::entries. Empty when there are none.
[[nodiscard]] std::string entries_code(const ProcessMap& map);

}  // namespace margay::samples
