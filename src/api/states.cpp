// The requests for AL states of slaves.
#include "network/states.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/doubt.hpp"
#include "network/members.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {

// When the timeout of the request is over; kNever only if the request has no timeout.
static Time end_of(Request& request) {
    const Time deadline = RequestAccess::deadline(request);
    return request.timeout > Duration{0} ? std::min(deadline, kNever - Duration{1}) : kNever;
}

// Checks that a scan has found slaves, that `slave` is one of them or 0 (all), and that `wanted` is a state.
static Error check_state(Network& network, std::uint16_t slave, AlState wanted, Step step) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = step};
    const Error refused = check_slave_or_all(network, slave, step);
    if (refused.code != Errc::none || can_be_target(wanted) || wanted == AlState::boot) return refused;
    return invalid(Argument::state, step, slave);
}

static Error check(Network& network, const StateRequest& request) {
    Error refused = check_slave(network, request.slave, Step::request_state);
    if (refused.code == Errc::none) refused = check_state(network, request.slave, request.wanted, Step::request_state);
    if (refused.code != Errc::none) return refused;
    // Checked before the request begins, so that a refused request does not end a hook that executes for the slave.
    return contradiction(network, network.slave(request.slave), request.wanted);
}
static Error check(Network& network, const WriteStateRequest& request) {
    return check_state(network, request.slave, request.wanted, Step::request_state);
}
static Error check(Network& network, const StateCheckRequest& request) {
    return check_state(network, request.slave, request.wanted, Step::read_state);
}
static Error check(Network& network, const ReadStateRequest&) {
    return network.count == 0 ? Error{.code = Errc::wrong_state, .step = Step::read_state} : Error{};
}

static Task<Result<>> run(Network& network, StateRequest& request) {
    Slave& slave = network.slave(request.slave);
    // The supervision readmits a lost slave before others may change its state.
    if (network.supervised && slave.al.state == AlState::none)
        co_return Error{.code = Errc::missing_slave, .step = Step::request_state, .slave = slave.number};
    auto seen = co_await read_anew(network, slave);
    if (!seen) co_return seen.error();
    co_await required(prove_before_request(network, slave, request.wanted));
    const ChangeReport report(network, slave);
    auto changed = co_await change_state(network, slave, request.wanted, end_of(request));
    co_return changed ? Result<>() : Result<>(changed.error());
}

// Notes the comparison of all slaves after they were doubted. `complete`: all of them were read and compared.
static void note_comparison(Network& network, bool complete) {
    if (complete)
        network.compared = network.engine.now();
    else
        network.engine.link().keep_pause();
}

static Task<Result<>> run(Network& network, ReadStateRequest& request) {
    const bool all = doubt_unseen(network);
    auto read = co_await observe_states(network);
    if (all) note_comparison(network, read.ok());
    request.lowest = *read;
    co_return read ? Result<>() : Result<>(read.error());
}

static Task<Result<>> run(Network& network, WriteStateRequest& request) {
    co_return co_await required(write_states(network, request.slave, request.wanted));
}

static Task<Result<>> run(Network& network, StateCheckRequest& request) {
    const bool all = doubt_unseen(network);
    auto reached = co_await wait_for_state(network, request.slave, request.wanted, end_of(request));
    if (all) note_comparison(network, reached.ok());
    request.reached = *reached;
    co_return reached ? Result<>() : Result<>(reached.error());
}

static constexpr OperationDescription kChange = describe_operation<StateRequest, check, run>(
    Operation::change_state, Step::request_state, Needs::its_slave, Ends::by_itself, Timing::by_sequence);
static constexpr OperationDescription kRead =
    describe_operation<ReadStateRequest, check, run>(Operation::read_states, Step::read_state);
static constexpr OperationDescription kWrite =
    describe_operation<WriteStateRequest, check, run>(Operation::write_states, Step::request_state, Needs::its_slave);
static constexpr OperationDescription kCheck = describe_operation<StateCheckRequest, check, run>(
    Operation::check_states, Step::read_state, Needs::nothing, Ends::by_itself, Timing::by_sequence);
StateRequest::StateRequest() : SlaveRequest(kChange) {}
ReadStateRequest::ReadStateRequest() : Request(kRead) {}
WriteStateRequest::WriteStateRequest() : SlaveRequest(kWrite) {}
StateCheckRequest::StateCheckRequest() : SlaveRequest(kCheck) {}

Result<AlStatus> readstate(Context& ctx) {
    ReadStateRequest request;
    return submit_and_wait(ctx, request, request.lowest);
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
    return submit_and_wait(ctx, request, request.reached);
}

}  // namespace margay
