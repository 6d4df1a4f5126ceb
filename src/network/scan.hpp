// Bringing up the segment: from nothing known to every slave in PREOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// The whole of config_init(); returns the number of slaves. An error that names a slave is of that slave, and the scan
// has come to its end all the same; after any other error there are no slaves.
[[nodiscard]] Task<Result<std::uint16_t>> scan(Network& network);

// The parts of it.
[[nodiscard]] Task<Result<std::uint16_t>> count_slaves(Network& network);
// All slaves to INIT, and what a master before has left taken away. The value says whether all were seen in
// INIT.
[[nodiscard]] Task<Result<bool>> reset_slaves(Network& network);

}  // namespace margay
