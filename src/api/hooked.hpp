// A request of the public API within the sequence of a hook.
#pragma once

#include "network/hooks.hpp"
#include "network/pdos.hpp"

#include <margay/request.hpp>

namespace margay {

// Checks and executes the request for the slave of the hook, without the queue. The request lives
// as long as the task. It has the errors of the request.
[[nodiscard]] Task<> run_in_hook(HookedSlave hooked, Request& request);

// The same for a request of the type R with one value, and with the timeout of start-up.
template <class R, class Value>
[[nodiscard]] Task<> set_in_hook(HookedSlave hooked, Value R::*member, Value value) {
    R request;
    request.slave = hooked.number();
    request.*member = value;
    request.timeout = startup_patience(hooked.slave()).each;
    auto done = co_await run_in_hook(hooked, request);
    co_return done;
}

}  // namespace margay
