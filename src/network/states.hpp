// AL states of all slaves: reading, requesting, waiting.
#pragma once

#include "network/network.hpp"

#include <margay/al_state.hpp>

namespace margay {

// Reads AL status and AL status code of every slave into slave.al. The state of a slave that does not answer becomes
// NONE. Returns the lowest state, and whether any slave has its error indication set, with the AL status code of the
// first one. Errors: no_frame, capacity (slaves that could not be read then keep the state that was read before),
// unstable (a scan has begun meanwhile: the slaves are others).
[[nodiscard]] Task<Result<AlStatus>> read_states(Network& network);

// The same. Without a supervision the identities of doubted slaves are compared, too. Errors: also the errors of
// prove(), and identity_unread (a request uses the slave, and has not compared it yet).
[[nodiscard]] Task<Result<AlStatus>> observe_states(Network& network);

// Requests `state` of one slave, or of all (0), without waiting for it. An error indication in slave.al is
// acknowledged, unless the slave mirrors AL control. Errors: the error of the first slave that could not be written, or
// that is held or missing when SAFEOP or OP is requested; the other slaves are written nevertheless. supervised: the
// supervision keeps the slaves in another state.
[[nodiscard]] Task<Result<>> write_states(Network& network, std::uint16_t slave, AlState state);

// Reads the states until the slave, or all slaves (0), are in `state` without error and the commands and hooks after
// the transition have ended, or until `until`; kNever: reads once. Returns the status read last: of the slave, or the
// lowest state. Errors: the errors of read_states().
[[nodiscard]] Task<Result<AlStatus>> wait_for_state(Network& network, std::uint16_t slave, AlState state, Time until);

}  // namespace margay
