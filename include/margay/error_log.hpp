// The ring of errors or warnings of a context: see Context::errors() and Context::warnings().
#pragma once

#include <margay/error.hpp>
#include <margay/spsc_ring.hpp>

namespace margay {

// The unread errors, oldest first; a full ring drops new errors. The thread that polls writes the ring; one other
// thread may read it.
using ErrorLog = SpscRing<Error>;

}  // namespace margay
