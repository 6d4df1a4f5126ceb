// Reads of a slave's SII what bringing it up needs, and nothing else: identity, mailboxes, the general, FMMU
// and SyncManager categories, and of the strings only those up to the name.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Fills the SII part of `slave`. A wrong checksum is kept in slave.error and reading goes on; a blank or
// contradictory EEPROM ends it with the error, and leaves out what would follow from nonsense (mailboxes,
// SyncManagers).
[[nodiscard]] Task<Result<>> read_sii_contents(Station station, Slave& slave);

}  // namespace margay
