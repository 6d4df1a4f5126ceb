// Who takes part in the cycle of its group. The working counter that a datagram must have for its inputs to count is
// that of those who do, exactly: whoever is known to be lost, or is being configured, is left out, so that the others
// go on.
#pragma once

#include "network/network.hpp"

namespace margay {

// From the next cycle on the slave is counted on, or is not. Nothing happens where that is so already.
void set_takes_part(Network& network, Slave& slave, bool takes_part);

}  // namespace margay
