// What the search for lost slaves shares with the rescan of a client (src/attach).
#pragma once

#include "network/network.hpp"

#include <margay/supervision.hpp>

namespace margay {

// The sequence of a RecoverRequest.
[[nodiscard]] Task<Result<>> recover(Network& network, RecoverRequest& request);

}  // namespace margay
