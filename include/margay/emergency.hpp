// What slaves report on their own: CoE emergencies (ETG.1000.6 "Emergency"), kept in a ring for each slave.
#pragma once

#include <margay/spsc_ring.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>

namespace margay {

struct Emergency {
    std::uint16_t code = 0;           // error code; 0x00xx: error reset
    std::uint8_t error_register = 0;  // as object 0x1001
    std::array<std::byte, 5> data{};  // the manufacturer's
    Time at{};                        // when the master fetched it
};

// The emergencies of one slave that nobody has taken yet, oldest first. The thread that polls writes, one other thread
// may read. A scan that finds the slave anew clears the ring.
using EmergencyRing = SpscRing<Emergency>;

}  // namespace margay
