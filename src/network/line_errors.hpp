// The error counters of the slaves' ports, and the cables that they belong to.
#pragma once

#include "network/network.hpp"

#include <margay/supervision.hpp>

namespace margay {

// A supervision begins: its first reading of each slave is not counted.
void begin_line_errors(std::span<LineErrors> sums);

// Reads the counters of all slaves that answer, adds their increase since the last reading to `sums`, reports it as
// events, and clears counters before they stop at 255. Values of the first reading are not counted.
[[nodiscard]] Task<Result<>> read_all_line_errors(Network& network, std::span<LineErrors> sums);

}  // namespace margay
