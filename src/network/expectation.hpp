// What was found against what was expected.
#pragma once

#include "network/network.hpp"

#include <margay/expected.hpp>

namespace margay {

// Finds each expected slave among those found, gives it its configuration and notes what is wrong: other_slave, missing_slave (of one that is not
// optional) and, when anything is expected at all, unexpected_slave. One that is not what it should be keeps its own configuration.
void compare_with_expected(Network& network);

}  // namespace margay
