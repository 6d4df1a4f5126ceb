// Lost slaves that are back without their station address: found by their place in the ring, known by what they are.
#pragma once

#include "network/network.hpp"

namespace margay {

// How many answer, and what they say together; a frame that is lost is not sent again. Errors: no_frame.
struct Roll {
    std::uint16_t count = 0;
    std::uint16_t al_status = 0;  // of all, ORed
};
[[nodiscard]] Task<Result<Roll>> call_roll(Network& network);

// Goes through the ring: who is where, what hangs where, and who answers that we have not known to be there. A newcomer
// is given a guest's address, asked what it is, and taken for
//   - the lost slave that is known by the alias or device id that is set on it, wherever it is;
//   - in a hot connect group, the next lost member of it, or another one that it can be;
//   - the next lost slave of the line behind the last one before it in the ring, or any other of the line that it can
//   be,
// if vendor, product and revision are those of that slave. It is given its station address then, and told as found. All
// others are told, once, as other_slave or as stranger, and left alone. Returns how many were found. Errors: busy (a
// search is under way), unstable (the ring has changed meanwhile).
[[nodiscard]] Task<Result<std::uint16_t>> find_lost(Network& network);

// A slave does not answer any more: told, and counted on no more.
void note_lost(Network& network, Slave& slave);

// A lost slave answers at its own address: whether it is that slave. If so it is told as found, and takes part in the
// cycle again if it has kept its mapping; if not it loses the address, and is one for find_lost().
[[nodiscard]] Task<Result<>> welcome_back(Network& network, Slave& slave, AlStatus now);

}  // namespace margay
