// Forbids identifiers in code that must work without heap, exceptions, RTTI, clocks and streams.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Every forbidden identifier outside comments and literals: a strict set in the core and the slave stack, a smaller
// set in the simulation (which may allocate during construction) and in the implementations of osal and oshw.
Faults identifier_faults(const SourceTree& tree);

}  // namespace margay::layers
