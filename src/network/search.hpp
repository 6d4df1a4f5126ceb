// Lost slaves that are back without their station address: found by their place in the ring, known by what they are.
#pragma once

#include "network/network.hpp"

namespace margay {

// How many answer, and what they say together. Errors: no_frame.
struct Roll {
    std::uint16_t count = 0;
    std::uint16_t al_status = 0;  // of all, ORed
};
[[nodiscard]] Task<Result<Roll>> call_roll(Network& network);

// Goes through the ring for slaves that have no station address of ours, or one that another slave has. A newcomer behind a known slave is the next lost
// one behind that if its SII says so (vendor, product, revision); else any other lost one that it can be. It is given its station address then. The others
// are told as other_slave events and left alone. Returns how many were found.
[[nodiscard]] Task<Result<std::uint16_t>> find_lost(Network& network);

}  // namespace margay
