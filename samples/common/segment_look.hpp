// Checks, before anything is written to a segment, whether another master operates it.
#pragma once

#include "osal/osal.hpp"
#include "oshw/nic.hpp"
#include "util/bytes.hpp"

#include <margay/al_state.hpp>

#include <cstdint>
#include <vector>

namespace margay::samples {

struct SegmentLook {
    bool link = true;             // false: the cable is not plugged in
    std::uint16_t slaves = 0;     // number of slaves that answered; 0 also when no frame came back
    std::uint16_t al_status = 0;  // register 0x0130 of all slaves, ORed

    // True when a slave is in SAFEOP or OP. A scan would put such a slave to INIT.
    [[nodiscard]] bool running() const;
};

// Reads the AL status of all slaves by one broadcast read, in a separate frame. Writes nothing. Blocks: up to 5 s for
// the link, as config_init() does, then for the reply. Call it before init(), while no other code uses the NIC.
//
// The public API reads registers only of slaves that a scan has found, and a scan begins by putting slaves to INIT.
// Therefore this function builds the frame itself. `second`: the NIC at the other end of a ring. Both NICs send
// requests, and the reply may return at either NIC.
[[nodiscard]] SegmentLook look_at_segment(Nic& nic, Osal& osal, Nic* second = nullptr);

// The AL status in the registers 0x0130 to 0x0135 of one slave.
[[nodiscard]] AlStatus al_status_in(Bytes registers);

// Reads the AL status and the AL status code of each slave, in the order of the ring, by its position. Writes nothing.
// Blocks for the replies; a slave without a reply has AlState::none. The conditions are those of look_at_segment(),
// which it calls first.
[[nodiscard]] std::vector<AlStatus> look_at_states(Nic& nic, Osal& osal, Nic* second = nullptr);

}  // namespace margay::samples
