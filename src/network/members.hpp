// Who takes part in the cycle of its group, and who should. The working counter that a datagram must have for its
// inputs to count (`accepted`) is that of the slaves that take part, exactly: a slave that is known to be lost, or is
// being configured, is left out, so that the inputs of the others go on. The working counter that is right (`expected`)
// is that of the slaves that are wanted.
#pragma once

#include "network/network.hpp"

namespace margay {

// From the next cycle on the slave is counted on, or is not. Nothing happens where that is so already.
void set_takes_part(Network& network, Slave& slave, bool takes_part);

// Counts the slave in the expected working counters, or no longer, by what is wanted of it now.
void update_counted(Network& network, Slave& slave);

// When a group was laid out and has its frames. A slave that is wanted and whose sizes nobody knows yet (`unplaced`) is
// counted once in the first datagram: the cycle is not right without the slave.
void begin_counting(Network& network, ProcessGroup& group);

// A slave that was `unplaced` has turned out to have no process data.
void forget_unplaced(Network& network, Slave& slave);

}  // namespace margay
