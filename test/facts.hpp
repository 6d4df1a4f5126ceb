// For tests that need a slave with other facts than the library has read.
#pragma once

#include <margay/slave.hpp>

namespace margay {

// The facts of a slave, writable. The slaves of a context are not constant objects, so that the cast is defined.
inline Slave& facts(const Slave& slave) { return const_cast<Slave&>(slave); }

}  // namespace margay
