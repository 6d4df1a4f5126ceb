// House rules that concern neither includes nor identifiers: lengths of files and lines, README files, names at the
// top level.
#pragma once

#include "layers/source_tree.hpp"

#include <set>

namespace margay::layers {

inline constexpr std::size_t kMaxFileLines = 500;
inline constexpr std::size_t kMaxColumns = 120;

// Library files that are too long.
Faults length_faults(const SourceTree& tree);

// Lines of any file that are too wide.
Faults width_faults(const SourceTree& tree);

// Folders with sources but without a README.md. A folder with only a contract header needs none. `notes` are the paths
// of the existing README files.
Faults readme_faults(const SourceTree& tree, const std::set<std::string>& notes);

// Names at the top level that do not belong there. `names` are the existing names.
Faults top_level_faults(const std::set<std::string>& names);

// Programs that wait for the first NIC of their source alone: in a ring, frames also arrive at the second NIC.
Faults wait_faults(const SourceTree& tree);

}  // namespace margay::layers
