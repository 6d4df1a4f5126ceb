// The error counters of the slaves' ports, and which cable they speak of.
#pragma once

#include "network/network.hpp"

#include <margay/supervision.hpp>

namespace margay {

// Reads the counters of all slaves that answer, adds what has come since the last time to `sums`, tells it as events,
// and clears counters before they stop at 255. What was there at the first reading is not counted.
[[nodiscard]] Task<Result<>> read_all_line_errors(Network& network, std::span<LineErrors> sums);

}  // namespace margay
