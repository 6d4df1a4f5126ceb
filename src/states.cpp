// States of slaves by the public API: the blocking forms.
#include "requests.hpp"

#include <margay/margay.hpp>

namespace margay {

Result<AlStatus> readstate(Context& ctx) {
    ReadStateRequest request;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    return request.lowest;
}

Result<> writestate(Context& ctx, std::uint16_t slave, AlState state) {
    WriteStateRequest request;
    request.slave = slave;
    request.wanted = state;
    return submit_and_wait(ctx, request);
}

Result<AlStatus> statecheck(Context& ctx, std::uint16_t slave, AlState state, Duration timeout) {
    StateCheckRequest request;
    request.slave = slave;
    request.wanted = state;
    request.timeout = timeout;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    return request.reached;
}

}  // namespace margay
