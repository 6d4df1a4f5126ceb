// What a slave is: what its ESC and its SII say.
#pragma once

#include "network/network.hpp"

namespace margay {

// Fills the slave's entry from its ESC, its SII and, where expect() wants it, its explicit device id. What cannot be
// read is noted as the slave's error; what was read before that stays. The SII's interface is the master's afterwards.
[[nodiscard]] Task<Result<>> survey(Network& network, Slave& slave);

}  // namespace margay
