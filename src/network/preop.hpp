// From INIT to PREOP: configures the mailboxes of one slave, at the first start and whenever the slave comes back.
#pragma once

#include "network/network.hpp"

namespace margay {

// Configures the mailbox SyncManagers of one slave and brings it to PREOP, with the commands and the hook of the
// transition; for a held slave these are left out. The EEPROM must be offered to the slave's PDI before: some slaves
// refuse PREOP otherwise.
[[nodiscard]] Task<Result<>> bring_to_preop(Network& network, Slave& slave);

}  // namespace margay
