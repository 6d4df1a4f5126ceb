// The allowed includes: the table of the architecture as data, and the check of a source tree.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Every include that goes to a higher layer, that bypasses the contract header of osal or oshw, that closes a circle,
// that does not exist, or that is an external header which the layer must not use.
Faults include_faults(const SourceTree& tree);

}  // namespace margay::layers
