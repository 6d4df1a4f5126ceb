// Changes of state with all that belongs to them: the commands of the slave's configuration and the application's hook,
// before and after.
#pragma once

#include "network/network.hpp"

namespace margay {

// Commands, then the hook. On the way down nothing stops the slave: what fails is noted. Errors: that of the command or
// hook.
[[nodiscard]] Task<Result<>> around_transition(Network& network, Slave& slave, Transition which, Moment moment);

// Requests `state` and waits for it, from slave.al, which is kept up. Errors: above_highest, those of
// around_transition() and of change_al_state(). What fails after the state is reached is an error too; slave.al tells.
[[nodiscard]] Task<Result<AlStatus>> bring_to_state(Network& network, Slave& slave, AlState state,
                                                    Duration timeout = Duration{0});

// The same for a request of the application. Errors besides: those of refusal().
[[nodiscard]] Task<Result<AlStatus>> change_state(Network& network, Slave& slave, AlState state,
                                                  Duration timeout = Duration{0});

// A state that was requested without waiting for it may be there now: then what comes after it is done.
[[nodiscard]] Task<Result<>> settle_request(Network& network, Slave& slave);
// Whether there is anything to do for it.
[[nodiscard]] bool request_is_met(const Network& network, const Slave& slave);

// How long the slave may take from where it is.
[[nodiscard]] Duration al_timeout(const Slave& slave, AlState state);

// What of `wanted` the slave is to be brought to.
[[nodiscard]] AlState limited(const Slave& slave, AlState wanted);

// The error of one that is asked for more.
[[nodiscard]] Error above_highest(const Station& station, const Slave& slave, AlState state);

}  // namespace margay
