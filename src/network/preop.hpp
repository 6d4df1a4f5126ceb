// From INIT to PREOP: the mailboxes of one slave, at the first start and whenever the slave comes back.
#pragma once

#include "network/network.hpp"

namespace margay {

// Configures the mailbox SyncManagers of one slave and brings it to PREOP, with the commands and the hook of the
// transition; a slave that is held gets neither. Its EEPROM must have been offered to the PDI: some slaves refuse
// without.
[[nodiscard]] Task<Result<>> bring_to_preop(Network& network, Slave& slave);

}  // namespace margay
