// The mailboxes of a slave, for a description: the normal ones, or those of BOOT.
#pragma once

#include "network/network.hpp"

namespace margay {

// Writes SyncManagers 0 and 1 of a slave whose SyncManagers are disabled: config_init() and clear_sync_managers() do
// that. An ESC accepts the address and length of a SyncManager only while the SyncManager is disabled.
[[nodiscard]] Task<Result<>> write_mailbox_sync_managers(Station station, const Slave& slave, const MailboxInfo& info);

// Opens the channel of the slave, which is in a state with these mailboxes. No effect if the slave has no mailbox, or
// none is wanted.
void open_mailbox(Network& network, Slave& slave, const MailboxInfo& info);

// Whether the slave has normal mailboxes that are to be used.
[[nodiscard]] inline bool uses_mailbox(const Slave& slave) {
    return slave.mailbox.present() && !slave.config.no_mailbox;
}

}  // namespace margay
