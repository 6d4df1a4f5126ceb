#include "network/boot.hpp"

#include "network/configure.hpp"
#include "network/mailbox_setup.hpp"
#include "network/search.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"

#include <margay/features.hpp>

namespace margay {
namespace {

// The process data of the running cycle must not be written over the mailboxes of BOOT, which may have the same memory.
Task<Result<>> to_init(Network& network, Slave& slave, Time until) {
    co_await required(clear_fmmus(network, slave));
    auto init = co_await bring_to_state(network, slave, AlState::init, until);
    co_return init ? Result<>() : Result<>(init.error());
}

Task<Result<>> prepare(Network& network, Slave& slave, AlState to, Time until) {
    const bool enters = to == AlState::boot;
    if (enters) {
        const Error refused = boot_refusal(network, slave);
        if (refused.code != Errc::none) co_return refused;
    }
    if (slave.al.state != AlState::init || enters) {
        co_await required(to_init(network, slave, until));
    } else if (slave.takes_part) {
        // Without its SyncManagers, the FMMUs exchange plain memory and increment the working counter.
        co_await required(clear_fmmus(network, slave));
    }
    if (network.has_mailbox(slave)) network.mailbox(slave).close();
    if (!enters && (to == AlState::init || !uses_mailbox(slave))) co_return Nothing{};
    const Station station = network.station(slave);
    // An ESC accepts the address and length of a SyncManager only while the SyncManager is disabled.
    co_await required(clear_sync_managers(network, slave));
    const MailboxSyncManagers sms = mailbox_sync_managers(slave, enters ? slave.boot_mailbox : slave.mailbox);
    auto written = co_await write_bytes(station, wire::reg::kSyncManagerBase, sms, Step::configure_mailbox);
    co_return written ? Result<>() : Result<>(written.error());
}

void reached(Network& network, Slave& slave, AlState from, AlState to) {
    if (to == AlState::boot) network.marks(slave).leave_boot = false;
    if (!network.has_mailbox(slave)) return;
    MailboxChannel& channel = network.mailbox(slave);
    if (to == AlState::init && from == AlState::boot) channel.close();
    if (from != AlState::init || channel.is_open()) return;
    if (to == AlState::boot) open_mailbox(network, slave, slave.boot_mailbox);
    if (to == AlState::preop) open_mailbox(network, slave, slave.mailbox);
}

Task<Result<>> prove_in_boot(Network& network, Slave& slave) {
    const auto now = co_await required(read_al_status(network.station(slave)));
    if (now.state == AlState::boot) network.marks(slave).boot_read = true;
    const bool mail = network.has_mailbox(slave) && network.mailbox(slave).is_used();
    std::uint8_t used_by_pdi = 1;
    if (!mail)
        used_by_pdi =
            co_await required(read<std::uint8_t>(network.station(slave), wire::reg::kSiiPdiAccess, Step::recover));
    if ((used_by_pdi & 1U) != 0)
        co_return Error{.code = Errc::identity_unread, .step = Step::identify, .slave = slave.number};
    co_return co_await required(prove(network, slave));
}

}  // namespace

const BootFeature kBootFeature{.prepare = prepare, .reached = reached, .prove = prove_in_boot};

}  // namespace margay
