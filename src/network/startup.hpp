// The start-up lists of a slave: what the desired configuration wants written before each transition.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Writes what `slave.config` lists for the transition, one after the other. Stops at the first that fails; error().index is its register.
[[nodiscard]] Task<Result<>> run_startup(Station station, const Slave& slave, Transition transition);

}  // namespace margay
