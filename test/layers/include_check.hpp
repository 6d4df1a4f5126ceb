// Who may include whom: the table of the architecture, as data, and the check of a tree against it.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Every include that goes upward in the house, reaches past the contract of osal or oshw, closes a circle, is
// found nowhere, or takes a header from outside the project where that is not allowed.
Faults include_faults(const SourceTree& tree);

}  // namespace margay::layers
