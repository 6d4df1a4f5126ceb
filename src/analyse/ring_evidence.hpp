// Tells the two NICs of a ring from two masters, in a recording with directions of packets.
#pragma once

#include "analyse/ring_signs.hpp"

#include <array>
#include <vector>

namespace margay::analyse {

class RingEvidence {
  public:
    // Each packet with an EtherCAT frame, in any order of time. The first ones of a long recording count.
    void look(const PacketOrigin& origin, Duration at, Bytes packet);
    // whole: both NICs of a ring: a frame that was sent at one NIC was received at the other one, or most frames were
    // sent at both. like: two NICs send the same frames, with a time between that is too long for a ring of one clock.
    // part: one NIC of a ring, because it receives the frames of another address that are those that it sends.
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
