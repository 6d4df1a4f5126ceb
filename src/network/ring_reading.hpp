// Reading the ring anew: which slave is at which place, and how the places are connected.
#pragma once

#include "network/network.hpp"

namespace margay {

// Marks a search as executing, until it is destroyed. No scan begins meanwhile.
class Searching {
  public:
    explicit Searching(Network& network) : network_(network) { network_.searching = true; }
    Searching(const Searching&) = delete;
    Searching& operator=(const Searching&) = delete;
    ~Searching() { network_.searching = false; }

  private:
    Network& network_;
};

// A roll: the result of one broadcast read of AL status. A lost frame is not sent again. Errors: no_frame.
struct BroadcastState {
    std::uint16_t count = 0;
    std::uint16_t al_status = 0;  // of all slaves, ORed
};
[[nodiscard]] Task<Result<BroadcastState>> read_all_states(Network& network);

// Stores the topology that was read in the slaves.
void store_places(Network& network);
// Assigns the places of the ring to the slaves that answer, by their station addresses. The other places are not
// assigned yet. A slave that was lost and has its address belongs to readmit_slave(), which may be working on it; an
// address that no slave has had since the scan comes from an earlier master.
void recognise(Network& network);
// Reads all places of the ring. Errors: unstable (the ring has changed meanwhile), capacity.
[[nodiscard]] Task<Result<>> read_places(Network& network);
// The same as read_places(); also ends clashes of station addresses and recognises the slaves. Errors: the errors of
// read_places().
[[nodiscard]] Task<Result<>> read_ring(Network& network);

}  // namespace margay
