// What must not be written in code that runs without heap, exceptions, RTTI, clocks and streams.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Every forbidden identifier outside comments and literals: the strict set in the core and the slave stack, a
// wider one in the simulation (which may allocate while being built up) and in the leaves of osal and oshw.
Faults identifier_faults(const SourceTree& tree);

}  // namespace margay::layers
