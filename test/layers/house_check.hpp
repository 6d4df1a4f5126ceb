// The rules of the house that are neither about includes nor about identifiers: lengths, notes, what may lie
// about.
#pragma once

#include "layers/source_tree.hpp"

#include <set>

namespace margay::layers {

inline constexpr std::size_t kMaxFileLines = 500;
inline constexpr std::size_t kMaxColumns = 120;

// Files of the library that have grown too long.
Faults length_faults(const SourceTree& tree);

// Lines that are wider than a page, of all files.
Faults width_faults(const SourceTree& tree);

// Folders with sources (a contract header alone is its own note) without a README.md. `notes` are the paths
// of those there are.
Faults readme_faults(const SourceTree& tree, const std::set<std::string>& notes);

// What lies at the top level and does not belong there, by the names of what lies there.
Faults top_level_faults(const std::set<std::string>& names);

}  // namespace margay::layers
