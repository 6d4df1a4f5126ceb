// PDOs of a slave as the application wants them, written into its object dictionary (ETG.1000.6, ETG.1020: 0x1C10 +
// SyncManager, 0x1600 and 0x1A00).
#pragma once

#include "mailbox/coe_sdo.hpp"

#include <margay/pdo.hpp>

namespace margay {

// Makes the PDOs of one SyncManager what `wanted` says, which outlives the task. What is there already is not written,
// so that fixed PDOs are no failure as long as they are the wanted ones. Else: assignment emptied, mappings emptied,
// filled and counted, assignment filled and counted. Errors name the object and the element at which it ended:
// sdo_abort …
[[nodiscard]] Task<Result<>> write_sm_pdos(MailboxChannel& channel, const SmPdos& wanted, MailPatience patience);

}  // namespace margay
