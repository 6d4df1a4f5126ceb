// What process data a slave has by its SII: the SyncManagers of category 41 with the PDOs of categories 50 and 51 that
// are assigned to them, by default or by the application.
#pragma once

#include "mailbox/found_sms.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

namespace margay {

// Reads it and lends the slave's PDI the EEPROM again. The sizes of PDOs that are not assigned are not read. A
// SyncManager without any PDO has the length that category 41 gives it. Errors: those of reading, and sii_format … when
// the categories contradict themselves; nothing is found then.
// `entries`, where there is one, gets the entries of those SyncManagers that have no list of the application.
[[nodiscard]] Task<Result<>> find_sms_by_sii(Station station, const Slave& slave, FoundSms& found,
                                             EntrySink* entries = nullptr);

// The entries of a SyncManager that the application lists: in the order of the list, those of a PDO whose entries are
// not listed as the SII has them.
[[nodiscard]] Task<Result<>> walk_list_by_sii(Station station, const Slave& slave, const SmPdos& list,
                                              EntrySink& entries);

}  // namespace margay
