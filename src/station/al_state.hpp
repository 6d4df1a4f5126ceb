// State changes of one slave (ETG.1000.6, AL control and AL status).
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/al_state.hpp>

namespace margay {

// Reads AL status and AL status code.
[[nodiscard]] Task<Result<AlStatus>> read_al_status(Station station);
// Takes over what was read: NONE when the slave does not answer, nothing when that is not known.
inline void take_al_status(AlStatus& known, const Result<AlStatus>& seen) {
    if (seen) known = *seen;
    if (says_gone(seen.error())) known = AlStatus{};
}

// Writes AL control again after a write that no slave took (working counter 0). An ESC takes no request as long as the
// slave's processor has not read the request before (ETG.1000.4 "AL control"); a processor that is slow, or a frame
// that was lost behind the slave and sent again, makes a slave that is there refuse a request. Errors: working_counter
// when the slave does not answer at all; timeout when its processor does not read the request before within `patience`
// (expected: the requested state, actual: the present one).
[[nodiscard]] Task<Result<>> request_again(Station station, std::uint16_t request, Step step, Duration patience);

// Requests `state` and waits until the slave is there, refuses, or `timeout` is over. An error indication
// that stands before is acknowledged with the request, unless the slave mirrors AL control
// (`device_emulation`). Errors: Errc::al_status with the AL status code in detail and the state that was
// reached in actual; Errc::timeout likewise.
[[nodiscard]] Task<Result<AlStatus>> change_al_state(Station station, AlState state, bool device_emulation,
                                                     Duration timeout);

// The same for a slave whose AL status `before` is known.
[[nodiscard]] Task<Result<AlStatus>> change_al_state_from(Station station, AlStatus before, AlState state,
                                                          bool device_emulation, Duration timeout);

// The time that a change to `state` may take, by ETG.1020's default timeouts.
[[nodiscard]] Duration default_al_timeout(AlState state);

}  // namespace margay
