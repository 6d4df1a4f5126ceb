// Supervision and recovery.
#include "network/supervisor.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/wanted.hpp"

#include <margay/margay.hpp>

namespace margay {

static Error check(Network& network, const SuperviseRequest& request) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::recover};
    if (network.supervised)
        return {.code = Errc::busy, .step = Step::recover, .detail = static_cast<std::uint32_t>(Operation::supervise)};
    if (can_be_target(request.target)) return {};
    return {.code = Errc::invalid_argument, .step = Step::recover};
}
static Error check(Network& network, const ReconfigRequest& request) {
    return check_slave(network, request.slave, Step::recover);
}

// Marks the network as supervised for as long as the mark lives.
class Supervised {
  public:
    explicit Supervised(Network& network) : network_(network) { network_.supervised = true; }
    Supervised(const Supervised&) = delete;
    Supervised& operator=(const Supervised&) = delete;
    ~Supervised() { network_.supervised = false; }

  private:
    Network& network_;
};

static Task<Result<>> run(Network& network, SuperviseRequest& request) {
    const Supervised supervised(network);
    network.target = request.target;
    co_return co_await supervise(network, request);
}

static Task<Result<>> run(Network& network, ReconfigRequest& request) {
    return reconfigure(network, network.slave(request.slave));
}

static Task<Result<>> run(Network& network, RecoverRequest& request) {
    auto found = co_await find_lost(network);
    request.found = *found;
    co_return found ? Result<>() : Result<>(found.error());
}

static constexpr OperationDescription kSupervise = describe_operation<SuperviseRequest, check, run>(
    Operation::supervise, Step::recover, Needs::nothing, Ends::when_canceled);
static constexpr OperationDescription kReconfigure =
    describe_operation<ReconfigRequest, check, run>(Operation::reconfigure, Step::recover, Needs::its_slave);
static constexpr OperationDescription kRecover = describe_operation<RecoverRequest, check_nothing<RecoverRequest>, run>(
    Operation::recover, Step::recover, Needs::segment);
SuperviseRequest::SuperviseRequest() : Request(kSupervise) {}
ReconfigRequest::ReconfigRequest() : SlaveRequest(kReconfigure) {}
RecoverRequest::RecoverRequest() : Request(kRecover) {}

Result<> reconfig_slave(Context& ctx, std::uint16_t slave) {
    ReconfigRequest request;
    request.slave = slave;
    return submit_and_wait(ctx, request);
}

Result<> recover_slave(Context& ctx, std::uint16_t slave) {
    Master* master = master_of(ctx);
    if (master == nullptr) return Error{.code = Errc::wrong_state, .step = Step::recover};
    const Error refused = slave != 0 ? check_slave(master->network, slave, Step::recover) : Error{};
    if (refused.code != Errc::none) return refused;
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
