// Supervision and recovery by the public API.
#include "network/supervisor.hpp"

#include "network/recovery.hpp"
#include "network/search.hpp"
#include "requests.hpp"

#include <margay/margay.hpp>

namespace margay {

// Only one at a time, and no scan meanwhile.
template <>
struct RequestScope<SuperviseRequest> {
    explicit RequestScope(Network& n) : network(n) { network.supervised = true; }
    RequestScope(const RequestScope&) = delete;
    RequestScope& operator=(const RequestScope&) = delete;
    ~RequestScope() { network.supervised = false; }
    Network& network;
};

static Task<Result<>> run(Network& network, SuperviseRequest& request) { return supervise(network, request); }

static Task<Result<>> run(Network& network, ReconfigRequest& request) {
    return reconfigure(network, network.slave(request.slave));
}

static Task<Result<>> run(Network& network, RecoverRequest& request) {
    auto found = co_await find_lost(network);
    request.found = *found;
    co_return found ? Result<>() : Result<>(found.error());
}

Result<> submit(Context& ctx, SuperviseRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none && ContextAccess::network(ctx)->count == 0)
        refused = {.code = Errc::wrong_state, .step = Step::recover};
    if (refused.code == Errc::none && ContextAccess::network(ctx)->supervised)
        refused = {.code = Errc::busy, .step = Step::recover};
    const bool process = request.target == AlState::op || request.target == AlState::safeop;
    if (refused.code == Errc::none && !process && request.target != AlState::preop && request.target != AlState::init)
        refused = {.code = Errc::invalid_argument, .step = Step::recover};
    const auto started = start(ctx, request, refused);
    if (started) ContextAccess::network(ctx)->target = request.target;
    return started;
}

Result<> submit(Context& ctx, ReconfigRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::recover);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, RecoverRequest& request) { return start(ctx, request, check_init(ctx)); }

Result<> reconfig_slave(Context& ctx, std::uint16_t slave) {
    ReconfigRequest request;
    request.slave = slave;
    return submit_and_wait(ctx, request);
}

Result<> recover_slave(Context& ctx, std::uint16_t slave) {
    if (ContextAccess::network(ctx) == nullptr) return Error{.code = Errc::wrong_state, .step = Step::recover};
    if (slave != 0) {
        const Error refused = check_slave(*ContextAccess::network(ctx), slave, Step::recover);
        if (refused.code != Errc::none) return refused;
    }
    if (const auto states = readstate(ctx); !states) return states.error();
    if (slave != 0 && ctx.slave(slave).al.state != AlState::none) return Result<>();
    RecoverRequest request;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done;
    const bool there = slave == 0 ? request.found > 0 : ctx.slave(slave).al.state != AlState::none;
    if (there) return Result<>();
    if (slave != 0 && ctx.slave(slave).error.code == Errc::other_slave) return ctx.slave(slave).error;
    return Error{.code = Errc::unknown_slave,
                 .step = Step::recover,
                 .slave = slave,
                 .expected = static_cast<std::uint32_t>(ctx.slaves().size())};
}

}  // namespace margay
