#include "network/mailbox_setup.hpp"

#include "wire/sync_manager.hpp"

namespace margay {
namespace {

// Address and length from the description, control octet from the slave's SyncManager category if it has one.
wire::SyncManager mailbox_sync_manager(const Slave& slave, const MailboxInfo& info, SmType type) {
    const bool out = type == SmType::mailbox_out;
    wire::SyncManager sm{.physical_start = out ? info.out_start : info.in_start,
                         .length_bytes = out ? info.out_bytes : info.in_bytes,
                         .control = wire::sm_control::kModeMailbox | wire::sm_control::kPdiInterrupt,
                         .activate = wire::sm_activate::kEnable};
    if (out) sm.control |= wire::sm_control::kEcatWrites;
    const auto& described = slave.sync_managers[out ? 0 : 1];
    if (described.type == type) sm.control = described.control;
    return sm;
}

}  // namespace

MailboxSyncManagers mailbox_sync_managers(const Slave& slave, const MailboxInfo& info) {
    MailboxSyncManagers sms{};
    wire::store_sync_manager(sms, mailbox_sync_manager(slave, info, SmType::mailbox_out));
    wire::store_sync_manager(MutableBytes(sms).subspan(wire::reg::kSyncManagerStride),
                             mailbox_sync_manager(slave, info, SmType::mailbox_in));
    return sms;
}

void open_mailbox(Network& network, Slave& slave, const MailboxInfo& info) {
    if (info.present() && !slave.config.no_mailbox && network.has_mailbox(slave))
        network.mailbox(slave).open(network.mailboxes, network.station(slave), slave, info);
}

void update_mailbox(Network& network, const Slave& slave) {
    if (!network.has_mailbox(slave)) return;
    MailboxChannel& channel = network.mailbox(slave);
    const AlState now = slave.al.state;
    if (now == AlState::none) {
        channel.interrupt(Errc::missing_slave);
    } else if (now == AlState::init) {
        if (channel.is_open()) channel.close();
    } else if (now == AlState::boot || !network.marks(slave).was_away) {
        channel.resume();
    }
}

}  // namespace margay
