// Bringing one slave back: what has to be done follows from the state that it is in.
#pragma once

#include "network/network.hpp"

namespace margay {

// The whole start-up of a slave that answers at its station address, from INIT to SAFEOP: mailboxes, start-up lists,
// the hook, process data. It takes part in no cycle while that lasts. A slave whose group is not mapped ends in PREOP.
// See reconfig_slave().
[[nodiscard]] Task<Result<>> reconfigure(Network& network, Slave& slave);

// Brings a slave that answers at its station address to `target`, SAFEOP or OP: acknowledges an error, and goes through
// the whole start-up when the slave has lost its configuration, or when it refuses.
[[nodiscard]] Task<Result<>> bring_back(Network& network, Slave& slave, AlState target);

// Takes `now` over as the state of the slave, and tells when that is another one.
void note_state(Network& network, Slave& slave, const AlStatus& now);

// Where the slave belongs: `target`, or PREOP while its group is not mapped or has no place for it.
[[nodiscard]] AlState goal(const Network& network, const Slave& slave, AlState target);

}  // namespace margay
