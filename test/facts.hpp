// For tests that need a slave with other facts than the library has read.
#pragma once

#include <margay/slave.hpp>

namespace margay {

// Returns the facts of a slave as writable. The slaves of a context are not constant objects, so the cast has defined
// behaviour.
inline Slave& facts(const Slave& slave) { return const_cast<Slave&>(slave); }

}  // namespace margay
