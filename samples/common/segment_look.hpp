// A look at a segment before anything is written to it: does another master run it?
#pragma once

#include "osal/osal.hpp"
#include "oshw/nic.hpp"

#include <cstdint>

namespace margay::samples {

struct SegmentLook {
    bool link = true;             // false: the cable is not plugged in
    std::uint16_t slaves = 0;     // that have answered; 0 also when no frame came back
    std::uint16_t al_status = 0;  // register 0x0130 of all slaves, ORed

    // True when a slave is in SAFEOP or OP. A scan would throw such a slave to INIT.
    [[nodiscard]] bool running() const;
};

// Reads the AL status of all slaves by one broadcast read, in a frame of its own; writes nothing. Waits: up to 5 s for
// the link, as config_init() does, then for the reply. Use before init(), while nothing else uses the NIC.
//
// The public API reads registers of slaves that a scan has found, and a scan begins with INIT; so this function builds
// the frame itself.
[[nodiscard]] SegmentLook look_at_segment(Nic& nic, Osal& osal);

}  // namespace margay::samples
