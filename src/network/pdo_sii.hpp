// What process data a slave has by its SII: the SyncManagers of category 41 with the PDOs of categories 50 and 51 that are assigned to
// them by default.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Fills slave.config from the SII and lends the slave's PDI the EEPROM again. The sizes of PDOs that are not assigned are not read.
// A SyncManager without any PDO has the length that category 41 gives it. Errors: those of reading, and sii_format … when the categories
// contradict themselves; slave.config is untouched then.
[[nodiscard]] Task<Result<>> discover_pdos_from_sii(Station station, Slave& slave);

}  // namespace margay
