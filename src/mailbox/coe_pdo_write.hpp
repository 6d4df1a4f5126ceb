// Writes the PDOs that the application wants into the object dictionary of a slave (ETG.1000.6, ETG.1020: 0x1C10 +
// SyncManager, 0x1600 and 0x1A00).
#pragma once

#include "mailbox/coe_sdo.hpp"

#include <margay/pdo.hpp>

namespace margay {

// Configures the PDOs of one SyncManager as in `wanted`, which outlives the task. Lists that already have the wanted
// values are not written, so fixed PDOs are no failure if they are the wanted ones. Otherwise the order is: empty the
// assignment, empty, fill and count the mappings, fill and count the assignment. Errors (sdo_abort …) contain the
// object and the subindex that failed.
[[nodiscard]] Task<Result<>> write_sm_pdos(MailboxChannel& channel, const SmPdos& wanted, const MailPatience& patience);

}  // namespace margay
