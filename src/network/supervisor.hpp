// The supervision of a segment: see SuperviseRequest.
#pragma once

#include "network/network.hpp"

#include <margay/supervision.hpp>

namespace margay {

// Ends only with its own error: capacity, when the arena has no room for it.
[[nodiscard]] Task<Result<>> supervise(Network& network, const SuperviseRequest& wanted);

}  // namespace margay
