// What process data a slave has by its object dictionary (ETG.1000.6 and ETG.1020: SyncManager communication type
// 0x1C00, PDO assignment 0x1C10 + SyncManager, PDO mapping 0x1600 and 0x1A00).
#pragma once

#include "mailbox/coe_sdo.hpp"
#include "mailbox/found_sms.hpp"

namespace margay {

// What each SyncManager is for, by 0x1C00. False where there is no such object: then `types` are those that the
// standard has by default. Errors: anything but an abort.
[[nodiscard]] Task<Result<bool>> read_sm_types(MailboxChannel& channel, SmTypes& types, MailPatience patience);

// `entries`, where there is one, gets each entry; it outlives the task. What the PDOs that are assigned to each
// SyncManager have in all. False, and nothing found, when the dictionary says nothing of the assignment: no failure,
// the SII may know. Errors: anything but an abort.
[[nodiscard]] Task<Result<bool>> find_sms_by_coe(MailboxChannel& channel, const Slave& slave, const SmTypes& types,
                                                 FoundSms& found, MailPatience patience, EntrySink* entries = nullptr);

}  // namespace margay
