// Reads what a slave is, from its ESC and its SII.
#pragma once

#include "network/network.hpp"

namespace margay {

// Fills the slave's entry from its ESC, its SII and, where expect() requires it, its explicit device id. What cannot be
// read is noted as the slave's error; values that were read before it stay. Afterwards the SII interface is assigned to
// the master. `again`: the slave keeps the error of an earlier reading until this one has ended.
[[nodiscard]] Task<Result<>> survey(Network& network, Slave& slave, bool again = false);

}  // namespace margay
