// Reads the process data of a slave from its SII: the SyncManagers of category 41 with the PDOs of categories 50 and 51
// that are assigned to them, by default or by the application.
#pragma once

#include "mailbox/found_sms.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

namespace margay {

// Reads the SII, then offers the EEPROM to the slave's PDI again. The entries of PDOs that are not assigned are not
// read. A SyncManager without a PDO has the length of category 41. Errors: the errors of reading, and sii_format … when
// the categories are contradictory; then nothing is found. `entries` (may be nullptr) receives the entries of the
// SyncManagers that have no list of the application.
[[nodiscard]] Task<Result<>> find_sms_by_sii(Station station, const Slave& slave, FoundSms& found,
                                             EntrySink* entries = nullptr);

// Passes the entries of a SyncManager that the application lists to `entries`, in the order of the list. For a PDO
// without listed entries they are read from the SII.
[[nodiscard]] Task<Result<>> walk_list_by_sii(Station station, const Slave& slave, const SmPdos& list,
                                              EntrySink& entries);

}  // namespace margay
