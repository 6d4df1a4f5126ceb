// Which slave is connected to which port, where frames enter some slaves at ports other than 0.
#pragma once

#include "clock/delays.hpp"

#include <cstdint>
#include <span>

namespace margay {

// Fills parent and parent port of all nodes from their entry ports, their open ports, and the time for which the frame
// is away from each (`arrival_ps`). The order of the nodes and their ports allow several ways of the frames. The times
// tell which it is: the frame is away for longer from a slave than from each slave behind it. False when no way fits.
[[nodiscard]] bool find_ways(std::span<DelayNode> nodes);

}  // namespace margay
