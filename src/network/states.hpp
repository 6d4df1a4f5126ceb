// AL states of all slaves: asked for, requested, waited for.
#pragma once

#include "network/network.hpp"

#include <margay/al_state.hpp>

namespace margay {

// Reads AL status and AL status code of every slave into slave.al. A slave that does not answer becomes NONE. Returns
// the lowest state, and whether any slave has its error indication set, with the code of the first of those. Errors:
// no_frame, capacity (the states of the slaves that could not be asked are those that were read before).
[[nodiscard]] Task<Result<AlStatus>> read_states(Network& network);

// Requests `state` of one slave, or of all (0), without waiting for it. An error indication that slave.al knows of is
// acknowledged, unless the slave mirrors AL control. Errors: those of the first slave that could not be written to, or
// that is held or missing when SAFEOP or OP is requested; the others are written to all the same. supervised: the
// supervision keeps the slaves in another state.
[[nodiscard]] Task<Result<>> write_states(Network& network, std::uint16_t slave, AlState state);

// Reads states until the slave, or all (0), are in `state` without error, or until `timeout` is over. Returns what was
// read last: of the slave, or the lowest.
[[nodiscard]] Task<Result<AlStatus>> wait_for_state(Network& network, std::uint16_t slave, AlState state,
                                                    Duration timeout);

}  // namespace margay
