// Reads what a slave is, from its ESC and its SII.
#pragma once

#include "network/network.hpp"

namespace margay {

// Fills the slave's entry from its ESC, its SII and, where expect() requires it, its explicit device id. Returns the
// error of an ESC or SII that cannot be read, which is noted too; other faults are noted only. Values that were read
// before a fault stay. Afterwards the SII interface is assigned to the master. `again`: the slave keeps the error of an
// earlier reading until this reading has ended, and a failed reading is not noted.
[[nodiscard]] Task<Result<>> survey(Network& network, Slave& slave, bool again = false);

}  // namespace margay
