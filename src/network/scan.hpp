// The scan of the segment: from an empty table to every slave in PREOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// All of config_init(); returns the number of slaves. After an error with a slave number the scan is complete, and the
// error is of that slave. After any other error the table is empty.
[[nodiscard]] Task<Result<std::uint16_t>> scan(Network& network);

// The parts of scan().
[[nodiscard]] Task<Result<std::uint16_t>> count_slaves(Network& network);
// Brings all slaves to INIT and clears the configuration of an earlier master. The value says whether all slaves
// reported INIT.
[[nodiscard]] Task<Result<bool>> reset_slaves(Network& network);

}  // namespace margay
