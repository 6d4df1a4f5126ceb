// A request of the public API within the sequence of a hook.
#pragma once

#include "network/hooks.hpp"

#include <margay/request.hpp>

namespace margay {

// Checks and executes the request for the slave of the hook, without the queue. The request lives
// as long as the task. Its errors are those of the request.
[[nodiscard]] Task<> run_in_hook(HookedSlave hooked, Request& request);

}  // namespace margay
