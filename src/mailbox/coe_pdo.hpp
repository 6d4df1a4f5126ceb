// What process data a slave has by its object dictionary (ETG.1000.6 and ETG.1020: SyncManager communication type 0x1C00, PDO assignment 0x1C10 +
// SyncManager, PDO mapping 0x1600 and 0x1A00).
#pragma once

#include "mailbox/coe_sdo.hpp"

namespace margay {

// Fills slave.config from the dictionary. False, and slave.config untouched, when the slave has no CoE or its dictionary says nothing of the
// assignment: no failure, the SII may know. Start and control octet of the SyncManagers are those of the SII. Errors: anything but an abort.
[[nodiscard]] Task<Result<bool>> discover_pdos_from_coe(MailboxChannel& channel, Slave& slave);

}  // namespace margay
