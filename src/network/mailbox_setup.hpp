// The mailboxes of a slave, for a description: the normal mailboxes, or the mailboxes of BOOT.
#pragma once

#include "network/network.hpp"

namespace margay {

// The registers of SyncManagers 0 and 1. Write them while the SyncManagers are disabled, as config_init() and
// clear_sync_managers() leave them: an ESC ignores the address and length of an enabled SyncManager.
using MailboxSyncManagers = std::array<std::byte, 2 * wire::reg::kSyncManagerStride>;
[[nodiscard]] MailboxSyncManagers mailbox_sync_managers(const Slave& slave, const MailboxInfo& info);

// Opens the channel of the slave, which is in a state with these mailboxes. No effect if the slave has no mailbox, or
// none is wanted.
void open_mailbox(Network& network, Slave& slave, const MailboxInfo& info);

// Call it when slave.al has changed, or the slave was proved to be the same one. In INIT the mailbox is closed. Mail to
// a slave that does not answer ends with Errc::missing_slave, and none goes to its address until the slave is there
// again and is the same one (SlaveMarks::was_away).
void update_mailbox(Network& network, const Slave& slave);

// Whether the slave has normal mailboxes that are to be used.
[[nodiscard]] inline bool uses_mailbox(const Slave& slave) {
    return slave.mailbox.present() && !slave.config.no_mailbox;
}

}  // namespace margay
