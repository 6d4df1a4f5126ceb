// The requests for supervision and recovery.
#include "api/supervision.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/doubt.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/states.hpp"
#include "network/supervisor.hpp"
#include "network/wanted.hpp"

#include <margay/margay.hpp>

namespace margay {

static Error check(Network& network, const SuperviseRequest& request) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::supervise};
    if (network.supervised)
        return {
            .code = Errc::busy, .step = Step::supervise, .detail = static_cast<std::uint32_t>(Operation::supervise)};
    if (request.interval <= Duration{0} || request.retry <= Duration{0} || request.line_interval < Duration{0})
        return invalid(Argument::interval, Step::supervise);
    return can_be_target(request.target) ? Error{} : invalid(Argument::state, Step::supervise);
}
static Error check(Network& network, const RecoverRequest& request) {
    return check_slave_or_all(network, request.slave, Step::recover);
}
static Error check(Network& network, const ReconfigRequest& request) {
    return check_slave(network, request.slave, Step::recover);
}

// Marks the network as supervised while this object exists.
class Supervised {
  public:
    Supervised(Network& network, const SuperviseRequest& request) : network_(network) {
        network_.supervised = true;
        network_.supervision = &request;
        network_.target_read = request.target;
    }
    Supervised(const Supervised&) = delete;
    Supervised& operator=(const Supervised&) = delete;
    ~Supervised() {
        network_.supervised = false;
        network_.supervision = nullptr;
        network_.supervision_ended = !network_.reaching;
    }

  private:
    Network& network_;
};

static Task<Result<>> run(Network& network, SuperviseRequest& request) {
    // For a silence before this request: no other request may write to the slaves before.
    (void)doubt_after_silence(network);
    const Supervised supervised(network, request);
    network.target = request.target;
    co_return co_await required(supervise(network, request));
}

static Task<Result<>> run(Network& network, ReconfigRequest& request) {
    Slave& slave = network.slave(request.slave);
    slave.error = {};  // the error of an earlier attempt
    auto done = co_await reconfigure(network, slave);
    const Error error = done ? held_error(slave, Step::recover) : done.error();
    if (error.code != Errc::none) slave.error = error;
    co_return error;
}

// The error of a slave that does not answer; code none if it answers.
static Error absence(Network& network, std::uint16_t number) {
    const Slave& slave = network.slave(number);
    if (slave.al.state != AlState::none) return {};
    if (slave.error.code == Errc::other_slave) return slave.error;
    return {.code = Errc::missing_slave, .step = Step::recover, .slave = number};
}

Task<Result<>> recover(Network& network, RecoverRequest& request) {
    request.found = 0;
    Slave* const wanted = request.slave == 0 ? nullptr : &network.slave(request.slave);
    // The error of an earlier search.
    if (wanted != nullptr && wanted->error.code == Errc::other_slave) wanted->error = {};
    if (!network.supervised && network.is_unobserved()) {
        doubt_all(network, false);
        network.compared = network.engine.now();
    }
    co_await required(read_states(network));
    const auto readmit = [&network](Slave& s) { return readmit_if_there(network, s); };
    Error refused;
    co_await required(for_each_slave(network, readmit, &refused));
    if (wanted != nullptr && wanted->al.state != AlState::none) {
        if (!network.marks(*wanted).unproved) co_return Nothing{};
        co_return co_await required(readmit_if_there(network, *wanted));  // a slave whose SII could not be read
    }
    const auto found = co_await required(find_lost(network));
    request.found = found;
    if (wanted == nullptr && found == 0 && refused.code != Errc::none) co_return refused;
    if (wanted == nullptr) co_return Nothing{};
    const Error absent = absence(network, request.slave);
    co_return absent.code == Errc::none ? Result<>() : Result<>(absent);
}

static constexpr OperationDescription kSupervise = describe_operation<SuperviseRequest, check, run>(
    Operation::supervise, Step::supervise, Needs::segment_to_begin, Ends::when_canceled);
static constexpr OperationDescription kReconfigure =
    describe_operation<ReconfigRequest, check, run>(Operation::reconfigure, Step::recover, Needs::its_slave);
static constexpr OperationDescription kRecover =
    describe_operation<RecoverRequest, check, recover>(Operation::recover, Step::recover, Needs::segment);
SuperviseRequest::SuperviseRequest() : Request(kSupervise) {}
ReconfigRequest::ReconfigRequest() : SlaveRequest(kReconfigure) {}
RecoverRequest::RecoverRequest() : SlaveRequest(kRecover) {}

Result<> reconfigure_slave(Context& ctx, std::uint16_t slave) {
    ReconfigRequest request;
    request.slave = slave;
    return submit_and_wait(ctx, request);
}

Result<> recover_slave(Context& ctx, std::uint16_t slave) {
    RecoverRequest request;
    request.slave = slave;
    const auto done = submit_and_wait(ctx, request);
    if (!done || slave != 0 || request.found > 0) return done;
    return Error{.code = Errc::missing_slave, .step = Step::recover};
}

}  // namespace margay
