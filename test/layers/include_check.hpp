// The allowed includes: the table of the architecture as data, and the check of a source tree.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// The faults: an include of a higher layer, an include that bypasses the contract header of osal or oshw, a circle of
// includes, an include of a file that does not exist, and an external header that the layer must not use.
Faults include_faults(const SourceTree& tree);

}  // namespace margay::layers
