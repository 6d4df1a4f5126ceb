// CoE emergencies (ETG.1000.6 "Emergency"): messages that slaves send on their own, stored in one ring for each slave.
#pragma once

#include <margay/spsc_ring.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>

namespace margay {

struct Emergency {
    std::uint16_t code = 0;           // error code; 0x00xx: the error was reset
    std::uint8_t error_register = 0;  // as in object 0x1001
    std::array<std::byte, 5> data{};  // manufacturer-specific
    Time at{};                        // when the master has fetched the message
};

// The unread emergencies of one slave, oldest first. The thread that polls writes; one other thread may read. A scan
// that finds the slave again clears the ring.
using EmergencyRing = SpscRing<Emergency>;

}  // namespace margay
