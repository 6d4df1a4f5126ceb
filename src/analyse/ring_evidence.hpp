// Distinguishes the two NICs of a ring from two masters, in a recording with directions of packets.
#pragma once

#include "analyse/ring_signs.hpp"

#include <array>
#include <vector>

namespace margay::analyse {

class RingEvidence {
  public:
    // Call it for each packet with an EtherCAT frame, in any order of time. Only the first packets of a long recording
    // are used.
    void look(const PacketOrigin& origin, Duration at, Bytes packet);
    // whole: both NICs of a ring: a frame that was sent at one NIC was received at the other NIC, or most frames were
    // sent at both NICs. like: two NICs send the same frames, but the time between both copies is too long for a ring
    // of one clock. part: one NIC of a ring. This NIC receives frames of another address, which are copies of the
    // frames that this NIC sends.
    [[nodiscard]] RingSigns::Sight decide();

  private:
    struct Seen {
        Duration at{};
        RingSigns::Address address{};
        std::uint16_t size = 0;
        std::uint8_t interface = 0;
        std::uint8_t index = 0;  // of the first datagram
        bool received = false;
    };
    std::vector<Seen> seen_{};
};

}  // namespace margay::analyse
