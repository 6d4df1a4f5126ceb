// Requests: what each of them does, and how it is submitted.
#include "requests.hpp"

#include "network/groups.hpp"
#include "network/scan.hpp"
#include "network/states.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

#include <margay/margay.hpp>

namespace margay {

static Task<Result<>> run(Network& network, ScanRequest& request) {
    auto count = co_await scan(network);
    request.slaves = count ? *count : std::uint16_t{0};
    co_return count ? Result<>() : Result<>(count.error());
}

// Afterwards the EEPROM is the slave's again: without it some refuse PREOP (AL status code 0x0050).
static Task<Result<>> run(Network& network, SiiReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    SiiReader reader(station);
    auto read = co_await reader.read(request.word, request.data);
    auto given_back = co_await sii_assign(station, true);
    co_return read ? given_back : read;
}

static Task<Result<>> run(Network& network, SiiWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    auto written = co_await sii_write(station, request.word, request.data);
    auto given_back = co_await sii_assign(station, true);
    co_return written ? given_back : written;
}

static Task<Result<>> run(Network& network, StateRequest& request) {
    Slave& slave = network.slave(request.slave);
    auto seen = co_await read_al_status(network.station(slave));
    slave.al = seen ? *seen : AlStatus{};
    if (!seen) co_return seen.error();
    auto changed = co_await change_state(network, slave, request.state, request.timeout);
    co_return changed ? Result<>() : Result<>(changed.error());
}

static Task<Result<>> run(Network& network, ReadStateRequest& request) {
    auto read = co_await read_states(network);
    request.lowest = *read;
    co_return read ? Result<>() : Result<>(read.error());
}

static Task<Result<>> run(Network& network, WriteStateRequest& request) {
    co_return co_await write_states(network, request.slave, request.wanted);
}

static Task<Result<>> run(Network& network, StateCheckRequest& request) {
    auto reached = co_await wait_for_state(network, request.slave, request.wanted, request.timeout);
    request.reached = *reached;
    co_return reached ? Result<>() : Result<>(reached.error());
}

static Task<Result<>> run(Network& network, MapRequest& request) {
    auto mapped = co_await map_group(network, request.group, request.image);
    request.bytes = mapped ? *mapped : std::size_t{0};
    co_return mapped ? Result<>() : Result<>(mapped.error());
}

// A scan begins anew with all slaves: not while somebody looks after them.
Result<> submit(Context& ctx, ScanRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none && ContextAccess::network(ctx)->supervised)
        refused = {.code = Errc::busy, .step = Step::count_slaves};
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, SiiReadRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::read_sii);
    if (refused.code == Errc::none) refused = check_words(request.data.size(), request.slave, Step::read_sii);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, SiiWriteRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::write_sii);
    if (refused.code == Errc::none) refused = check_words(request.data.size(), request.slave, Step::write_sii);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, StateRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none)
        refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::request_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, ReadStateRequest& request) { return start(ctx, request, check_init(ctx)); }

Result<> submit(Context& ctx, WriteStateRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none)
        refused = check_slave_or_all(*ContextAccess::network(ctx), request.slave, Step::request_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, StateCheckRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none)
        refused = check_slave_or_all(*ContextAccess::network(ctx), request.slave, Step::read_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, MapRequest& request) { return start(ctx, request, check_init(ctx)); }

}  // namespace margay
