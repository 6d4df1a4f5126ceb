#include "api/hooked.hpp"

#include "api/operation.hpp"

namespace margay {

Task<> run_in_hook(HookedSlave hooked, Request& request) {
    const HookCall call(hooked);
    Network& network = HookAccess::network(hooked);
    const OperationDescription& operation = RequestAccess::operation(request);
    Result<> done = operation.check(network, request);
    if (done) done = co_await operation.sequence(network, request);
    co_await call.pause_after(done.error());
    co_return done;
}

}  // namespace margay
