#include "network/recovery.hpp"

#include "network/configure.hpp"
#include "network/entries.hpp"
#include "network/expectation.hpp"
#include "network/members.hpp"
#include "network/pdos.hpp"
#include "network/scan.hpp"
#include "network/survey.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

// What it shall exchange, if anything, is in the image.
bool has_place(const Slave& slave) {
    if (slave.pdos_failed) return false;  // nobody knows what it exchanges
    const bool wants = std::ranges::any_of(std::span(slave.config.sms).first(slave.config.sm_count),
                                           [](const ProcessSm& sm) { return sm.bits != 0; });
    return !wants || slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
}

bool mapped(const Network& network, const Slave& slave) {
    return slave.config.group < network.process.groups.size() && network.process.groups[slave.config.group].mapped;
}

// With all that belongs to the transition, and told as an event.
Task<Result<AlStatus>> change(Network& network, Slave& slave, AlState state) {
    const AlStatus before = slave.al;
    auto changed = co_await change_state(network, slave, state);
    const AlStatus after = slave.al;
    slave.al = before;
    note_state(network, slave, after);
    co_return changed;
}

// INIT, and nothing left of what the slave was configured with before.
Task<Result<>> back_to_init(Network& network, Slave& slave) {
    auto cleared = co_await clear_fmmus(network, slave);
    if (!cleared) co_return cleared;
    auto init = co_await change(network, slave, AlState::init);
    if (!init) co_return init.error();
    static constexpr std::array<std::byte, Slave::kSyncManagers * reg::kSyncManagerStride> kNone{};
    const Station station = network.station(slave);
    const std::size_t count = std::min<std::size_t>(slave.dl.sync_managers, Slave::kSyncManagers);
    if (count == 0) co_return Result<>();
    Datagram write(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSyncManagerBase},
                   Bytes(kNone).first(count * reg::kSyncManagerStride));
    Datagram sync(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSyncActivation.address},
                  Bytes(kNone).first(1));
    co_await together(write, sync);  // not every slave has a SYNC unit
    const Error error = judge(station, write.reply(), Step::recover, reg::kSyncManagerBase);
    if (error.code != Errc::none) co_return error;
    co_return Result<>();
}

// The hook is called from poll() here: as long as it says busy it is asked again.
Task<Result<>> call_hook(Network& network, Slave& slave) {
    if (slave.hooks.preop_to_safeop == nullptr) co_return Result<>();
    for (;;) {
        const auto done = slave.hooks.preop_to_safeop(*network.context, slave.position, slave.hooks.user);
        if (done.error().code != Errc::busy) {
            slave.hook_failed = !done.ok();
            co_return done;
        }
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
}

// One that was not there when the segment was scanned.
Task<Result<>> get_to_know(Network& network, Slave& slave) {
    slave.error = {};
    auto assigned = co_await sii_assign(network.station(slave), false);
    if (!assigned) co_return assigned;
    auto surveyed = co_await survey(network, slave);
    if (!surveyed) co_return surveyed;
    if (!slave.seen) co_return slave.error;
    const Error other = slave.wanted != nullptr ? difference(slave, *slave.wanted) : Error{};
    if (other.code == Errc::none) co_return Result<>();
    slave.seen = false;
    co_return other;
}

// Its process data: what was said of it before it came, or what it says itself now; that may not be what the image was
// laid out for.
Task<Result<>> take_in(Network& network, Slave& slave) {
    auto discovered = co_await discover_pdos(network, slave);
    slave.pdos_failed = !discovered;
    if (!discovered) co_return discovered;
    if (!has_place(slave)) {
        Error error{.code = Errc::no_place, .step = Step::map_process_data, .slave = slave.position};
        network.note(slave, error);
        co_return Result<>();
    }
    ProcessGroup& group = network.process.groups[slave.config.group];
    const Error entries = place_entries(network, group, &slave);
    (void)entries;  // told in errors(); the slave goes on
    const bool lrw =
        std::ranges::any_of(group.plans, [](const DatagramPlan& plan) { return plan.command == wire::Command::LRW; });
    co_return check_place(slave, group.layout, lrw);
}

}  // namespace

// That it does not answer the next look will tell.
void note_state(Network& network, Slave& slave, const AlStatus& now) {
    if (slave.al == now || now.state == AlState::none) return;
    network.tell({.kind = EventKind::state, .slave = slave.position, .before = slave.al, .now = now});
    slave.al = now;
}

AlState goal(const Network& network, const Slave& slave, AlState target) {
    return mapped(network, slave) && has_place(slave) ? limited(slave, target) : AlState::preop;
}

Task<Result<>> reconfigure(Network& network, Slave& slave) {
    const bool new_here = !slave.seen;
    if (new_here) {
        auto known = co_await get_to_know(network, slave);
        if (!known) co_return known;
    }
    auto init = co_await back_to_init(network, slave);
    if (!init) co_return init;
    const AlStatus before = slave.al;
    auto offered = co_await sii_assign(network.station(slave), true);
    if (!offered) co_return offered;
    auto preop = co_await bring_to_preop(network, slave);
    const AlStatus after = slave.al;
    slave.al = before;
    note_state(network, slave, after);
    if (!preop || !mapped(network, slave)) co_return preop;
    auto hook = co_await call_hook(network, slave);
    if (!hook) co_return hook;
    if (new_here || slave.pdos_failed) {
        auto taken_in = co_await take_in(network, slave);
        if (!taken_in || !has_place(slave)) co_return taken_in;
    }
    auto configured =
        co_await configure_process_data(network, slave, network.process.groups[slave.config.group].layout, true);
    const AlStatus reached = slave.al;
    slave.al = after;
    note_state(network, slave, reached);
    co_return configured;
}

Task<Result<>> bring_back(Network& network, Slave& slave, AlState target) {
    auto seen = co_await read_al_status(network.station(slave));
    if (!seen) co_return seen.error();
    note_state(network, slave, *seen);
    const bool exchanges = slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
    bool configured = (slave.al.state == AlState::safeop || slave.al.state == AlState::op) &&
                      (slave.takes_part || !exchanges) && slave.seen;
    if (configured && slave.al.error) {
        auto acknowledged = co_await change(network, slave, slave.al.state);
        configured = acknowledged.ok();
    }
    if (configured && goal(network, slave, target) == AlState::op && slave.al.state != AlState::op) {
        auto op = co_await change(network, slave, AlState::op);
        configured = op.ok();
    }
    if (configured) co_return Result<>();
    auto again = co_await reconfigure(network, slave);
    if (!again || goal(network, slave, target) != AlState::op) co_return again;
    auto op = co_await change(network, slave, AlState::op);
    co_return op ? Result<>() : Result<>(op.error());
}

}  // namespace margay
