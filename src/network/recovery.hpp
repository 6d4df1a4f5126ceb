// Bringing one slave back: what has to be done follows from the state that it is in.
#pragma once

#include "network/network.hpp"

namespace margay {

// From INIT to PREOP, with nothing left of what the slave was configured with before.
[[nodiscard]] Task<Result<>> restart(Network& network, Slave& slave);

// The whole start-up of a slave that answers at its station address, from INIT to SAFEOP: mailboxes, start-up lists,
// the hook, process data. It takes part in no cycle while that lasts. A slave whose group is not mapped, or that is not
// wanted in SAFEOP, ends in PREOP. Errors besides those of the steps: no_place, pdo_size (the image has no place for
// the slave, or one of another size). See reconfig_slave().
[[nodiscard]] Task<Result<>> reconfigure(Network& network, Slave& slave);

// Brings a slave that answers at its station address to its goal(), up or down: acknowledges an error, and goes through
// the whole start-up when the slave has lost its configuration, or when it refuses.
[[nodiscard]] Task<Result<>> bring_back(Network& network, Slave& slave);

// Takes `now` over as the state of the slave, and tells when that is another one.
void note_state(Network& network, Slave& slave, const AlStatus& now);

}  // namespace margay
