// Recordings of both NICs of a ring. Such a master sends each frame at both ends, and the slaves process the first
// copy, the second one, or both in part where the ring is broken. Here the copies become one request and one reply, as
// they are for the master.
#pragma once

#include "analyse/exchanges.hpp"
#include "oshw/pcap/pcapng.hpp"

#include <array>
#include <functional>
#include <vector>

namespace margay::analyse {

class RingCopies {
  public:
    using Emit = std::function<void(Moment when, Bytes packet, std::size_t length_on_wire)>;
    explicit RingCopies(Emit emit) : emit_(std::move(emit)) {}

    // Whether the packets have exactly two interfaces, and were sent at both. Recordings without directions are not
    // recognised.
    [[nodiscard]] static bool is_ring(const std::vector<PacketOrigin>& origins);

    void packet(const PacketOrigin& origin, Moment when, Bytes packet, std::size_t length_on_wire);
    void finish();
    // Packets that were not passed on: second copies, copies that no slave has processed, parts of merged replies.
    [[nodiscard]] std::uint64_t merged() const { return merged_; }

  private:
    struct Held {
        Moment when{};
        std::vector<std::byte> bytes{};
        [[nodiscard]] bool there() const { return !bytes.empty(); }
        void keep(Moment at, Bytes packet) {
            when = at;
            bytes.assign(packet.begin(), packet.end());
        }
    };
    // A frame on the wire, by the index of its first datagram.
    struct Flight {
        std::array<Held, 2> sent{};   // by the interface at which the copy was sent
        std::array<Held, 2> reply{};  // the part of a reply that is held, by the copy
        bool passed = false;          // a reply was passed on: a part that comes later is left out
    };
    void sent(std::uint32_t interface, Moment when, Bytes packet);
    void received(std::uint32_t interface, Moment when, Bytes packet);
    void pass(Flight& flight);
    void pass_old(Moment now);
    void forward(const Held& held) { emit_(held.when, held.bytes, held.bytes.size()); }

    Emit emit_;
    std::array<Flight, 256> flights_{};
    std::vector<std::uint8_t> waiting_{};  // indices with a held part
    std::array<std::array<std::byte, 6>, 2> macs_{};
    std::uint64_t merged_ = 0;
};

}  // namespace margay::analyse
