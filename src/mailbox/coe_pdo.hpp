// Reads the process data of a slave from its object dictionary (ETG.1000.6 and ETG.1020: SyncManager communication type
// 0x1C00, PDO assignment 0x1C10 + SyncManager, PDO mapping 0x1600 and 0x1A00).
#pragma once

#include "mailbox/coe_sdo.hpp"
#include "mailbox/found_sms.hpp"

namespace margay {

// Reads the type of each SyncManager from 0x1C00. False when the slave has no such object: `types` then contains the
// defaults of the standard. Errors: anything but an abort.
[[nodiscard]] Task<Result<bool>> read_sm_types(MailboxChannel& channel, SmTypes& types, const MailPatience& patience);

// Finds the length of the PDOs that are assigned to each SyncManager. `entries` (may be nullptr, outlives the task)
// receives each entry. False, and nothing found, when the dictionary has no assignment or does not describe its PDOs:
// this is not a failure, the SII may contain them. `undescribed` receives assigned PDOs that the dictionary does not
// describe; their SyncManagers have the length of the SII. Errors: anything but an abort.
[[nodiscard]] Task<Result<bool>> find_sms_by_coe(MailboxChannel& channel, const Slave& slave, const SmTypes& types,
                                                 FoundSms& found, UndescribedPdos& undescribed,
                                                 const MailPatience& patience, EntrySink* entries = nullptr);

}  // namespace margay
