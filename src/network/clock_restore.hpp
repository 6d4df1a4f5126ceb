// The reference clock after it was away.
#pragma once

#include "util/task.hpp"

#include <margay/error.hpp>

namespace margay {

struct Network;

// Looks whether the reference was reset, and gives it its time again. The cycles carry its time from now on.
[[nodiscard]] Task<Result<>> restore_reference(Network& network);

}  // namespace margay
