// Writes C++ declarations that use a process image by name (margay/entry.hpp), for the user to paste into an
// application.
#pragma once

#include "common/process_map.hpp"

namespace margay::samples {

// The declaration of the handle for each entry of the map, in the order of the map: "margay::Output<bool> s1_enable{1,
// 0x7000, 1};". Empty for gaps, for entries without a description, and when no type has this number of bits.
[[nodiscard]] std::vector<std::string> entry_declarations(const ProcessMap& map);

// The declarations, and their list for GroupConfiguration::entries. Empty when there are no declarations.
[[nodiscard]] std::string entries_code(const ProcessMap& map);

}  // namespace margay::samples
