// The reference clock after it was away.
#pragma once

#include "util/task.hpp"

#include <margay/error.hpp>

namespace margay {

struct Network;

// Checks whether the reference clock was reset, and restores its time in this case. From now on the cycles carry its
// time.
[[nodiscard]] Task<Result<>> restore_reference(Network& network);

}  // namespace margay
