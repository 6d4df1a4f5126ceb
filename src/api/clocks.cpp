// The requests for distributed clocks.
#include "network/clocks.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {
namespace {

Error check_settings(const ClockSettings& settings) {
    constexpr Duration kLongest = std::chrono::hours(24 * 365 * 100);  // sums of them and of a time have room
    const Duration times[] = {settings.cycle,   settings.start_grid,     settings.start_delay,   settings.settle,
                              settings.timeout, settings.watch_interval, settings.delay_interval};
    bool right = settings.measurements >= 1 && settings.burst_bulk >= 1 && settings.cycle > Duration{0};
    for (const Duration time : times) right &= time >= Duration{0} && time <= kLongest;
    return right ? Error{} : invalid(Argument::clock_settings, Step::configure_clocks);
}

}  // namespace

static Error check(Network& network, const ClockRequest& request) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::configure_clocks};
    if (network.clocks.entries.empty())
        return {.code = Errc::capacity, .step = Step::configure_clocks, .expected = network.count};
    const Error refused = check_settings(request.settings);
    if (refused.code != Errc::none) return refused;
    if (request.settings.group >= network.process.groups.size())
        return invalid(Argument::clock_settings, Step::configure_clocks);
    // configdc() switches SYNC signals off, and slaves in OP need them.
    for (const Slave& slave : network.slaves())
        if (slave.al.state == AlState::op && network.clocks.of(slave).sync_active)
            return {.code = Errc::wrong_state, .step = Step::configure_clocks, .slave = slave.number};
    if (request.settings.reference == 0) return Error{};
    return check_slave(network, request.settings.reference, Step::configure_clocks);
}

static Error check(Network& network, const SyncRequest& request) {
    const Error refused = check_same_slave(network, request.slave, Step::configure_sync);
    if (refused.code != Errc::none) return refused;
    if (network.clocks.prepare == nullptr)
        return {.code = Errc::wrong_state, .step = Step::configure_sync, .slave = request.slave};
    if (request.sync.source == SyncSettings::Source::sii) return Error{};
    Error error = sync_registers(request.sync, network.clocks.settings).error();
    error.slave = error.code == Errc::none ? std::uint16_t{0} : request.slave;
    return error;
}

static Task<Result<>> run(Network& network, ClockRequest& request) {
    auto reference = co_await configure_clocks(network, request.settings);
    request.reference = network.clocks.reference;
    if (reference) co_return Result<>();
    const Error error = reference.error();
    if (error.slave != 0 && error.slave <= network.count)
        network.note(network.slave(error.slave), error);
    else
        network.note(error);
    co_return error;
}

static Task<Result<>> run(Network& network, SyncRequest& request) {
    Slave& slave = network.slave(request.slave);
    const auto wanted = co_await find_sync(network, slave, request.sync);
    if (!wanted) {
        Error error = wanted.error();
        error.slave = request.slave;
        co_return error;
    }
    ClockEntry& clock = network.clocks.of(slave);
    auto done = co_await activate_sync(network, slave, *wanted);
    if (!done) co_return done;
    clock.sync = *wanted;
    clock.sync_set = true;
    co_return done;
}

static constexpr OperationDescription kClocks =
    describe_operation<ClockRequest, check, run>(Operation::configure_clocks, Step::configure_clocks, Needs::segment);
static constexpr OperationDescription kSync =
    describe_operation<SyncRequest, check, run>(Operation::set_sync, Step::configure_sync, Needs::its_slave);
ClockRequest::ClockRequest() : Request(kClocks) {}
SyncRequest::SyncRequest() : SlaveRequest(kSync) {}

Result<std::uint16_t> configdc(Context& ctx, const ClockSettings& settings) {
    ClockRequest request;
    request.settings = settings;
    return submit_and_wait(ctx, request, request.reference);
}

static Result<> set_sync(Context& ctx, std::uint16_t slave, bool active, const SyncSettings& wanted) {
    if (active && wanted.sync0_cycle < Duration{0}) return invalid(Argument::sync_cycle, Step::configure_sync, slave);
    SyncRequest request;
    request.slave = slave;
    if (active) request.sync = wanted;
    return submit_and_wait(ctx, request);
}

Result<> dcsync01(Context& ctx, std::uint16_t slave, bool active, Duration cycle0, Duration cycle1, Duration shift) {
    constexpr std::uint16_t kBoth = 0x0700;
    return set_sync(ctx, slave, active,
                    {.source = SyncSettings::Source::application,
                     .assign_activate = kBoth,
                     .sync0_cycle = cycle0,
                     .sync1_cycle = cycle1,
                     .shift = shift});
}

Result<> dcsync0(Context& ctx, std::uint16_t slave, bool active, Duration cycle0, Duration shift) {
    constexpr std::uint16_t kSync0 = 0x0300;
    return set_sync(ctx, slave, active,
                    {.source = SyncSettings::Source::application,
                     .assign_activate = kSync0,
                     .sync0_cycle = cycle0,
                     .shift = shift});
}

const SlaveClock& slave_clock(Context& ctx, std::uint16_t slave) {
    static constexpr SlaveClock kUnknown;
    Master* master = master_of(ctx);
    if (master == nullptr || slave < 1 || slave > master->network.count) return kUnknown;
    if (master->network.clocks.entries.empty()) return kUnknown;
    return master->network.clocks.entries[slave - 1U];
}

ClockStatus clock_status(Context& ctx, Time now) {
    Master* master = master_of(ctx);
    if (master == nullptr || master->network.clocks.reference == 0) return {};
    refresh_system_time(master->network);
    const Clocks& clocks = master->network.clocks;
    return {.reference = clocks.reference,
            .in_sync = clocks.all_in_sync,
            .greatest_ns = clocks.greatest_ns,
            .system_time_ns = clocks.system_at_ns(now)};
}

std::uint16_t reference_clock(Context& ctx) {
    Master* master = master_of(ctx);
    return master == nullptr ? std::uint16_t{0} : master->network.clocks.reference;
}

std::string_view to_text(ClockKind kind) {
    switch (kind) {
        case ClockKind::unknown: return "unknown";
        case ClockKind::none: return "no clock";
        case ClockKind::receive_times: return "receive times only";
        case ClockKind::bits32: return "32 bits";
        case ClockKind::bits64: return "64 bits";
    }
    return "unknown";
}

}  // namespace margay
