// Which slave is connected to which port, where frames enter some slaves at ports other than 0.
#pragma once

#include "clock/delays.hpp"

#include <cstdint>
#include <span>

namespace margay {

// Fills parent and parent port of all nodes from their entry ports, their open ports, and the time for which the frame
// is away from each (`arrival_ps`). Several ways of the frames fit the order of the nodes and their ports. The times
// decide: the frame is away from a slave for a longer time than from each slave behind it. False when no way fits.
[[nodiscard]] bool find_ways(std::span<DelayNode> nodes);

}  // namespace margay
