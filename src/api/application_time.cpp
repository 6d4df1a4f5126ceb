// The clocks follow the time of the application.
#include "api/master.hpp"
#include "api/operation.hpp"
#include "api/reference_clock.hpp"
#include "network/clocks.hpp"

#include <margay/application_time.hpp>

namespace margay {
namespace {

namespace reg = wire::reg;

using Action = ClockDatagramRequest::Action;

Error clock_error(Network& network, Errc code) {
    return {.code = code, .step = Step::configure_clocks, .slave = network.clocks.reference};
}

}  // namespace

static Error check(Network& network, const ClockDatagramRequest&) {
    return network.clocks.reference == 0 ? clock_error(network, Errc::no_clock) : Error{};
}

// Without a reference that answers, `distribute` would bring all clocks the time that the master expects, and the time
// of a clock that was reset if its slave is being brought back. While another slave becomes the reference, no time may
// reach this slave.
static Error find_obstacle(Network& network, Action action) {
    if (action == Action::read_differences) return {};
    if (!has_reference_clock(network)) return clock_error(network, Errc::missing_slave);
    if (action == Action::write_reference || !network.supervised) return {};
    if (network.clocks.paused) return clock_error(network, Errc::busy);
    if (network.silent) return clock_error(network, Errc::no_frame);
    return is_reference_silent(network) ? clock_error(network, Errc::missing_slave) : Error{};
}

// `distribute` sends the time that the reference clock will probably have, because all clocks take the sent time when
// the reference clock does not answer. A reply with the same time, from fewer slaves than the last one, was not read
// from the reference clock.
static Task<Result<>> run(Network& network, ClockDatagramRequest& request) {
    Clocks& clocks = network.clocks;
    const Error obstacle = find_obstacle(network, request.action);
    if (obstacle.code != Errc::none) co_return obstacle;
    const Slave& reference = network.slave(clocks.reference);
    const bool wide = clocks.of(reference).kind == ClockKind::bits64;
    const Time now = network.engine.now();
    std::uint64_t time = clocks.system_at_ns(leaves_at(network));
    if (request.action == Action::write_reference) clocks.is_driven = true;
    if (request.action == Action::write_reference)
        time = request.time_ns + (request.at == kNever ? 0 : static_cast<std::uint64_t>((now - request.at).count()));
    wire::Command command = wire::Command::FPWR;
    wire::DatagramAddress address{reference.station_address, reg::kSystemTime.address};
    if (request.action == Action::distribute) {
        const TimeSource source = time_source_of(network.slaves(), reference, clocks.settings.by_position);
        command = source.command;
        address = {source.address, reg::kSystemTime.address};
    } else if (request.action == Action::read_differences) {
        command = wire::Command::BRD;
        address = {std::uint16_t{0}, reg::kSystemTimeDifference.address};
        time = 0;
    }
    std::array<std::byte, 8> data{};
    store_le<std::uint64_t>(data, 0, time);
    const std::size_t bytes = request.action != Action::read_differences && wide ? 8 : 4;
    TimedDatagram datagram(network.engine.link(), command, address, MutableBytes(data).first(bytes), Repeat::no);
    auto reply = co_await datagram;
    if (!reply.ok()) co_return clock_error(network, reply.errc);
    const std::uint64_t seen = load_le<std::uint64_t>(data);
    const bool same = wide ? seen == time : static_cast<std::uint32_t>(seen) == static_cast<std::uint32_t>(time);
    const bool unread = request.action == Action::distribute && same && reply.wkc < request.slaves;
    if (reply.wkc == 0 || unread) co_return clock_error(network, Errc::missing_slave);
    if (request.action == Action::read_differences)
        request.difference_ns = load_greatest_difference_ns(load_le<std::uint32_t>(data));
    if (request.action == Action::distribute) {
        const std::uint64_t about = clocks.system_at_ns(datagram.sent_at());
        clocks.note_seen_time(seen, wide, datagram.sent_at());
        request.time_ns = wide ? seen : extend_time_ns(static_cast<std::uint32_t>(seen), about);
        request.slaves = reply.wkc;
    }
    co_return Nothing{};
}

static constexpr OperationDescription kClockDatagram =
    describe_operation<ClockDatagramRequest, check, run>(Operation::configure_clocks, Step::configure_clocks);
ClockDatagramRequest::ClockDatagramRequest() : Request(kClockDatagram) {}

void ApplicationTime::set(std::uint64_t time_ns, Time now) {
    time_ns_ = time_ns;
    set_at_ = now;
    at_zero_ = Duration(static_cast<std::int64_t>(time_ns - static_cast<std::uint64_t>((now - Time{}).count())));
}

Result<> ApplicationTime::send(ClockDatagramRequest& request, Action action) {
    if (request.busy()) return Error{.code = Errc::busy, .step = Step::configure_clocks};
    request.action = action;
    return submit(ctx_, request);
}

Result<> ApplicationTime::sync_reference_clock() {
    if (set_at_ == kNever)
        return Error{.code = Errc::wrong_state, .step = Step::configure_clocks, .detail = Error::kNoTime};
    if (!write_.busy()) {
        write_.time_ns = time_ns_;
        write_.at = set_at_;
    }
    return send(write_, Action::write_reference);
}

Result<> ApplicationTime::sync_reference_clock_to(std::uint64_t time_ns) {
    if (!write_.busy()) {
        write_.time_ns = time_ns;
        write_.at = kNever;
    }
    return send(write_, Action::write_reference);
}

Result<> ApplicationTime::sync_slave_clocks() { return send(distribute_, Action::distribute); }

Result<> ApplicationTime::queue_sync_monitor() { return send(monitor_, Action::read_differences); }

static Error not_known(const ClockDatagramRequest& request) {
    if (request.state() == RequestState::success) return {};
    if (request.state() == RequestState::error) return request.error();
    return {.code = Errc::wrong_state, .step = Step::configure_clocks, .detail = Error::kNotBack};
}

Result<std::uint64_t> ApplicationTime::reference_clock_time64() const {
    const Error error = not_known(distribute_);
    return error.code == Errc::none ? Result<std::uint64_t>(distribute_.time_ns) : Result<std::uint64_t>(error);
}

Result<std::uint32_t> ApplicationTime::reference_clock_time() const {
    const auto time = reference_clock_time64();
    return time ? Result<std::uint32_t>(static_cast<std::uint32_t>(*time)) : Result<std::uint32_t>(time.error());
}

Result<std::uint32_t> ApplicationTime::process_sync_monitor() const {
    const Error error = not_known(monitor_);
    return error.code == Errc::none ? Result<std::uint32_t>(monitor_.difference_ns) : Result<std::uint32_t>(error);
}

}  // namespace margay
