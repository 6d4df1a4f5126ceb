// AL state changes of one slave (ETG.1000.6, AL control and AL status).
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/al_state.hpp>

namespace margay {

// Reads AL status and AL status code.
class ReadAlStatus : public RegisterWait {
  public:
    explicit ReadAlStatus(const Station& station);
    [[nodiscard]] AlStatus value() const noexcept;
    [[nodiscard]] Result<AlStatus> await_resume() const noexcept;
};
[[nodiscard]] inline ReadAlStatus read_al_status(const Station& station) { return ReadAlStatus(station); }
// Updates `known` with what was read: NONE when the slave does not answer at its address; no change when the read
// failed for another reason.
inline void update_al_status(AlStatus& known, const Result<AlStatus>& seen) {
    if (seen) known = *seen;
    if (does_not_answer(seen.error())) known = AlStatus{};
}

// Writes AL control again after a write that no slave accepted (working counter 0). An ESC accepts no request as long
// as the slave's processor has not read the request before (ETG.1000.4 "AL control"); so a present slave refuses a
// request if its processor is slow, or if a frame was lost behind the slave and sent again. Errors: working_counter
// when the slave does not answer at all; timeout when its processor does not read the previous request within
// `patience` (expected: the requested state, actual: the present state).
[[nodiscard]] Task<Result<>> request_again(Station station, std::uint16_t request, Step step, Duration patience);

// Requests `state` and waits until the slave has reached it, the slave refuses, or `timeout` is over. An error
// indication from before is acknowledged with the request, unless the slave mirrors AL control (`device_emulation`).
// Errors: Errc::al_status with the AL status code in detail and the state reached in actual; Errc::timeout with the
// same fields.
[[nodiscard]] Task<Result<AlStatus>> change_al_state(Station station, AlState state, bool device_emulation,
                                                     Duration timeout);

// The same for a slave whose AL status (`before`) was already read.
[[nodiscard]] Task<Result<AlStatus>> change_al_state_from(Station station, AlStatus before, AlState state,
                                                          bool device_emulation, Duration timeout);

// The longest time for a change to `state`: the default timeouts of ETG.1020.
[[nodiscard]] Duration default_al_timeout(AlState state);

}  // namespace margay
