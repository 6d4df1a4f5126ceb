// States of slaves by the public API: the blocking forms.
#include <margay/margay.hpp>

namespace margay {

Result<AlStatus> readstate(Context& ctx) {
    ReadStateRequest request;
    const auto submitted = submit(ctx, request);
    if (!submitted) return submitted.error();
    const auto done = wait(ctx, request);
    if (!done) return done.error();
    return request.lowest;
}

Result<> writestate(Context& ctx, std::uint16_t slave, AlState state) {
    WriteStateRequest request;
    request.slave = slave;
    request.wanted = state;
    const auto submitted = submit(ctx, request);
    return submitted ? wait(ctx, request) : submitted;
}

Result<AlStatus> statecheck(Context& ctx, std::uint16_t slave, AlState state, Duration timeout) {
    StateCheckRequest request;
    request.slave = slave;
    request.wanted = state;
    request.timeout = timeout;
    const auto submitted = submit(ctx, request);
    if (!submitted) return submitted.error();
    const auto done = wait(ctx, request);
    if (!done) return done.error();
    return request.reached;
}

}  // namespace margay
