// Other frames for a group that is mapped: see replan_processdata().
#pragma once

#include "network/network.hpp"

namespace margay {

// Neither waits nor allocates. After an error the group has the frames that it had.
[[nodiscard]] Result<> replan(Network& network, std::uint8_t number);

}  // namespace margay
