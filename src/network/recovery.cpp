#include "network/recovery.hpp"

#include "network/configure.hpp"
#include "network/members.hpp"
#include "network/scan.hpp"
#include "network/startup.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

namespace margay {
namespace {

namespace reg = wire::reg;

bool mapped(const Network& network, const Slave& slave) {
    return slave.config.group < network.process.groups.size() && network.process.groups[slave.config.group].mapped;
}

Task<Result<AlStatus>> change(Network& network, Slave& slave, AlState state) {
    auto changed =
        co_await change_al_state_from(network.station(slave), slave.al, state, slave.device_emulation, default_al_timeout(state));
    if (changed) {
        note_state(network, slave, *changed);
        co_return changed;
    }
    auto seen = co_await read_al_status(network.station(slave));
    if (seen) note_state(network, slave, *seen);
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
    Datagram sync(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSyncActivation.address}, Bytes(kNone).first(1));
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
            slave.hooks.failed = !done.ok();
            co_return done;
        }
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
}

}  // namespace

void note_state(Network& network, Slave& slave, const AlStatus& now) {
    if (slave.al == now) return;
    network.tell({.kind = EventKind::state, .slave = slave.position, .before = slave.al, .now = now});
    slave.al = now;
}

AlState goal(const Network& network, const Slave& slave, AlState target) { return mapped(network, slave) ? target : AlState::preop; }

Task<Result<>> reconfigure(Network& network, Slave& slave) {
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
    auto configured = co_await configure_process_data(network, slave, network.process.groups[slave.config.group].layout, true);
    const AlStatus reached = slave.al;
    slave.al = after;
    note_state(network, slave, reached);
    co_return configured;
}

Task<Result<>> bring_back(Network& network, Slave& slave, AlState target) {
    const AlState wanted = goal(network, slave, target);
    auto seen = co_await read_al_status(network.station(slave));
    if (!seen) co_return seen.error();
    note_state(network, slave, *seen);
    const bool exchanges = slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
    bool configured = (slave.al.state == AlState::safeop || slave.al.state == AlState::op) && (slave.takes_part || !exchanges);
    if (configured && slave.al.error) {
        auto acknowledged = co_await change(network, slave, slave.al.state);
        configured = acknowledged.ok();
    }
    if (configured && wanted == AlState::op && slave.al.state != AlState::op) {
        auto listed = co_await run_startup(network.station(slave), slave, Transition::safeop_to_op);
        if (!listed) co_return listed;
        auto op = co_await change(network, slave, AlState::op);
        configured = op.ok();
    }
    if (configured) co_return Result<>();
    auto again = co_await reconfigure(network, slave);
    if (!again || wanted != AlState::op) co_return again;
    auto listed = co_await run_startup(network.station(slave), slave, Transition::safeop_to_op);
    if (!listed) co_return listed;
    auto op = co_await change(network, slave, AlState::op);
    co_return op ? Result<>() : Result<>(op.error());
}

}  // namespace margay
