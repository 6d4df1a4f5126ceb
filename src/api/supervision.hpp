// The search for lost slaves, which RecoverRequest and the rescan of a client (src/attach) use.
#pragma once

#include "network/network.hpp"

#include <margay/supervision.hpp>

namespace margay {

// The sequence of a RecoverRequest.
[[nodiscard]] Task<Result<>> recover(Network& network, RecoverRequest& request);

}  // namespace margay
