// The request that watches the latch inputs of a slave.
#include "api/master.hpp"
#include "api/operation.hpp"
#include "clock/system_time.hpp"
#include "station/register_access.hpp"

#include <margay/latches.hpp>
#include <margay/margay.hpp>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr Step kStep = Step::watch_latches;

// Both edges of both inputs: the first edge is kept until its time is read ("single event").
constexpr std::uint16_t kBothEdges = 0x0303;
// Latch control and latch status: registers 0x09A8 to 0x09AF.
constexpr wire::Register kControlAndStatus{reg::kLatch0Control.address, 8};
constexpr wire::Register kControl{reg::kLatch0Control.address, 2};

// The edges that have occurred, as bits in the order of LatchRequest::edges, from the two status registers.
constexpr unsigned edges_of(std::uint64_t control_and_status) {
    const auto status = static_cast<unsigned>(control_and_status >> 48);
    return (status & 3U) | (status >> 8 & 3U) << 2;
}

// Reads the time, so that the input keeps the next edge. `known`: the edge is of this request, and the time of a clock
// of 32 bits has not wrapped since.
Task<Result<>> read_edge(Network& network, LatchRequest& request, unsigned which, bool known) {
    const Slave& slave = network.slave(request.slave);
    const wire::Register time{
        static_cast<std::uint16_t>(reg::kLatch0PositiveEdge.address + 8 * (which & 1U) + 0x10 * (which >> 1)), 8};
    const auto seen = co_await required(read<std::uint64_t>(network.station(slave), time, kStep));
    if (!known) co_return Nothing{};
    const std::uint64_t about = network.clocks.system_at_ns(network.engine.now());
    LatchEdge& edge = request.edges[which];
    edge.time_ns = slave.dl.dc_64bit ? seen : extend_past_time_ns(static_cast<std::uint32_t>(seen), about);
    ++edge.count;
    network.report({.kind = EventKind::latch_edge,
                    .port = static_cast<std::uint8_t>(which >> 1),
                    .slave = slave.number,
                    .expected = static_cast<std::uint32_t>(edge.time_ns >> 32),
                    .actual = static_cast<std::uint32_t>(edge.time_ns),
                    .detail = which & 1U});
    co_return Nothing{};
}

// Whether the clock of the slave shows the system time, as far as configdc() has set it. A clock that was reset shows
// its own time until the slave has its offset again.
Task<Result<bool>> has_system_time(Network& network, const Slave& slave) {
    if (network.clocks.entries.empty() || network.clocks.of(slave).offset_ns == 0) co_return true;
    const auto offset = co_await required(read<std::uint64_t>(network.station(slave), reg::kSystemTimeOffset, kStep));
    co_return offset != 0;
}

constexpr Duration kLongestOf32Bits = std::chrono::seconds(4);  // see extend_past_time_ns()

// One reading of the status. A slave that was reset has lost the latch control. `looked`: when all times were
// read last; Time::min(): not yet, so a slave that has the latch control may have kept an edge from before the request.
Task<Result<>> look_once(Network& network, LatchRequest& request, Time& looked) {
    if (check_same_slave(network, request.slave, kStep).code != Errc::none) co_return Nothing{};
    const Station station = network.station(network.slave(request.slave));
    refresh_system_time(network);  // a clock of 32 bits wraps
    const Time asked = network.engine.now();
    const auto seen = co_await required(read<std::uint64_t>(station, kControlAndStatus, kStep));
    if (static_cast<std::uint16_t>(seen) != kBothEdges) {
        const bool set = co_await required(has_system_time(network, network.slave(request.slave)));
        if (!set) co_return Nothing{};
        co_await required(write(station, kControl, kBothEdges, kStep));
        looked = asked;
        co_return Nothing{};
    }
    const unsigned edges = edges_of(seen);
    for (unsigned which = 0; which < request.edges.size(); ++which) {
        if ((edges >> which & 1U) == 0) continue;
        const bool wide = network.slave(request.slave).dl.dc_64bit;
        const bool known = looked != Time::min() && (wide || network.engine.now() - looked < kLongestOf32Bits);
        co_await required(read_edge(network, request, which, known));
    }
    looked = asked;
    co_return Nothing{};
}

}  // namespace

static Error check(Network& network, const LatchRequest& request) {
    const Error refused = check_slave(network, request.slave, kStep);
    if (refused.code != Errc::none) return refused;
    const bool wide = network.slave(request.slave).dl.dc_64bit;
    const bool fits = request.interval > Duration{0} && (wide || request.interval <= kLongestOf32Bits / 2);
    return fits ? Error{} : invalid(Argument::interval, kStep, request.slave);
}

// Whether the slave has latch inputs that the master controls. A slave that is there, but does not answer at these
// registers, has none.
static Task<Result<>> check_unit(Network& network, const LatchRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto unit = co_await read<std::uint8_t>(station, reg::kCyclicUnitControl, kStep);
    if (does_not_answer(unit.error())) co_return Error{.code = Errc::no_clock, .step = kStep, .slave = request.slave};
    if (!unit) co_return unit.error();
    if ((*unit & (wire::cyclic_unit::kLatch0IsPdis | wire::cyclic_unit::kLatch1IsPdis)) != 0)
        co_return Error{.code = Errc::unsupported, .step = kStep, .slave = request.slave};
    co_return Nothing{};
}

static Task<Result<>> run(Network& network, LatchRequest& request) {
    request.edges = {};
    const std::uint32_t scan = network.scans;
    Time looked = Time::min();
    if (network.slave(request.slave).al.state != AlState::none) {  // a lost slave may come back
        co_await required(check_unit(network, request));
    }
    for (;;) {
        if (network.scans != scan) co_return Error{.code = Errc::wrong_state, .step = kStep, .slave = request.slave};
        co_await completion(look_once(network, request, looked));  // a slave that does not answer may come back
        co_await network.engine.sleep_for(request.interval);
    }
}

static constexpr OperationDescription kLatches =
    describe_operation<LatchRequest, check, run>(Operation::watch_latches, kStep, Needs::nothing, Ends::when_canceled);
LatchRequest::LatchRequest() : SlaveRequest(kLatches) {}

}  // namespace margay
