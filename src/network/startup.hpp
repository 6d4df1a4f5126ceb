// The commands of SlaveSetup::startup.
#pragma once

#include "network/network.hpp"

namespace margay {

// Whether there are commands for this moment of the transition.
[[nodiscard]] bool has_commands(const Slave& slave, Transition which, Moment moment);

// Executes them, one after the other. Stops at the first that fails and may not; its error names the transition (step),
// the place in the list, and the object or register. What fails and may is told in errors().
[[nodiscard]] Task<Result<>> run_commands(Network& network, Slave& slave, Transition which, Moment moment);

}  // namespace margay
