// Signs of a ring in a recording that has no directions of packets, for example from taps: two source addresses send
// the same frames at the same time, and in the whole ring one of the two copies is seen again without being processed.
#pragma once

#include "oshw/pcap/pcapng.hpp"
#include "util/bytes.hpp"

#include <margay/time.hpp>

#include <array>
#include <cstdint>
#include <map>

namespace margay::analyse {

// The sum of all working counters.
[[nodiscard]] std::uint32_t counters_of(Bytes frame);
// A hash of the datagrams without the octets that differ between the copies of a frame, or from frame to frame.
[[nodiscard]] std::uint64_t kind_of_copies(Bytes frame);

class RingSigns {
  public:
    using Counters = std::map<std::uint64_t, std::uint32_t>;  // counters_of() by kind_of_copies()
    using Address = std::array<std::byte, 6>;
    enum class Sight : std::uint8_t {
        none,
        whole,  // a ring, and both NICs were recorded
        sent,   // a part of a ring, with the frames that one of the NICs has sent
        part,   // a part of a ring
        like,   // two masters with the same frames, or a ring that was broken all the time
    };
    // Call it for each packet with an EtherCAT frame. `packet`: the packet as it was recorded.
    void look(const PacketOrigin& origin, Duration at, Bytes packet);
    [[nodiscard]] Sight decide();
    // The addresses of a ring, if they are known: the address whose frames the slaves process in the whole ring, and
    // the other address.
    [[nodiscard]] const std::array<Address, 2>& addresses() const { return addresses_; }
    // The largest working counters of frames that have passed the whole ring.
    [[nodiscard]] const Counters& whole() const { return whole_; }

  private:
    // A frame, by the index of its first datagram. Pairs are by address.
    struct Flight {
        std::uint64_t shape = 0;  // 0: none
        Duration at{};
        std::array<std::uint32_t, 2> unmarked{}, marked{};
        std::array<std::uint64_t, 2> data{};  // hashes of the sent data
        std::uint64_t kind = 0;
        std::uint32_t counters = 0;  // counters_of() of a reply
        std::size_t first = 2;       // the address whose request came first; 2: a reply came first
    };
    void count(const Flight& flight);

    std::array<Address, 2> addresses_{};
    std::size_t known_ = 0;  // the number of known addresses
    std::array<Flight, 256> flights_{};
    Counters whole_{};
    bool other_kinds_ = false;  // directions, VLAN tags, UDP
    std::uint64_t frames_ = 0, strangers_ = 0;
    std::array<std::uint64_t, 2> unmarked_{}, marked_{};  // frames
    std::array<std::uint64_t, 2> seen_{}, crossed_{};     // flights
    std::array<std::uint64_t, 2> first_{};                // flights that begin with a request of the address
    std::uint64_t all_ = 0, both_ = 0, near_ = 0, sent_twice_ = 0, sent_alike_ = 0;
};

}  // namespace margay::analyse
