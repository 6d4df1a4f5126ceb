// What has gone wrong in a context, and what is odd: see Context::errors() and Context::warnings().
#pragma once

#include <margay/error.hpp>
#include <margay/spsc_ring.hpp>

namespace margay {

// The oldest errors that nobody has taken yet. The thread that polls writes, one other thread may read.
using ErrorLog = SpscRing<Error>;

}  // namespace margay
