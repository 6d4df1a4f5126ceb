// Reads the parts of a slave's SII that the master needs to configure it: identity, mailboxes, the general, FMMU and
// SyncManager categories, and the strings category up to the name.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Fills the SII part of `slave`. After a wrong checksum the reading continues, and the error is returned at the end. A
// blank or contradictory EEPROM ends the reading with the error; the values that would follow from invalid words
// (mailboxes, SyncManagers) are left out.
[[nodiscard]] Task<Result<>> read_sii_contents(Station station, Slave& slave);

}  // namespace margay
