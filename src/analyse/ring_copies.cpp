#include "analyse/ring_copies.hpp"

#include "wire/datagram.hpp"

#include <algorithm>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kLeast = wire::kFramePrefixBytes + wire::kDatagramOverheadBytes;
constexpr auto kPatience = 500us;  // a part of a reply is passed on alone after this time

bool is_ethercat(Bytes packet) {
    return packet.size() >= kLeast && packet[12] == std::byte{0x88} && packet[13] == std::byte{0xA4};
}

std::uint8_t index_of(Bytes packet) { return std::to_integer<std::uint8_t>(packet[wire::kFramePrefixBytes + 1]); }

// The source address without the mark of the first slave.
std::array<std::byte, 6> source_of(Bytes packet) {
    std::array<std::byte, 6> mac{};
    std::copy_n(packet.begin() + wire::kSourceMacOffset, 6, mac.begin());
    mac[0] &= ~wire::kPassedEscBit;
    return mac;
}

// Adds the reply to the second copy to the reply to the first one, datagram by datagram: what slaves have changed in
// either of them, and the sum of the working counters. The time of the reference clock travels in one copy only: the
// datagram has another command in the other one.
void merge(MutableBytes into, Bytes into_sent, Bytes from, Bytes from_sent) {
    const std::size_t size = std::min({into.size(), into_sent.size(), from.size(), from_sent.size()});
    for (std::size_t at = wire::kFramePrefixBytes; at + wire::kDatagramOverheadBytes <= size;) {
        const std::uint16_t length = load_le<std::uint16_t>(into_sent, at + 6);
        const std::size_t data = at + wire::kDatagramHeaderBytes;
        const std::size_t wkc = data + (length & 0x07FF);
        if (wkc + 2 > size) return;
        if (into_sent[at] == from_sent[at]) {
            for (std::size_t n = data; n < wkc; ++n) {
                if (from[n] == from_sent[n]) continue;
                into[n] = into[n] == into_sent[n] ? from[n] : into[n] | from[n];
            }
            store_le(into, wkc,
                     static_cast<std::uint16_t>(load_le<std::uint16_t>(into, wkc) + load_le<std::uint16_t>(from, wkc)));
        }
        if ((length & 0x8000) == 0) return;
        at = wkc + 2;
    }
}

}  // namespace

bool RingCopies::is_ring(const std::vector<PacketOrigin>& origins) {
    std::array<bool, 2> sends{};
    for (const PacketOrigin& origin : origins) {
        if (origin.interface > 1) return false;
        sends[origin.interface] |= origin.direction == PacketOrigin::Direction::sent;
    }
    return sends[0] && sends[1];
}

void RingCopies::packet(const PacketOrigin& origin, Moment when, Bytes packet, std::size_t length_on_wire) {
    using Direction = PacketOrigin::Direction;
    pass_old(when);
    if (!is_ethercat(packet) || packet.size() < length_on_wire || origin.direction == Direction::unknown ||
        origin.interface > 1)
        return emit_(when, packet, length_on_wire);
    if (origin.direction == Direction::sent) return sent(origin.interface, when, packet);
    if (origin.direction == Direction::received) return received(origin.interface, when, packet);
    ++merged_;  // refused by the NIC: it was not on the wire
}

void RingCopies::sent(std::uint32_t interface, Moment when, Bytes packet) {
    macs_[interface] = source_of(packet);
    Flight& flight = flights_[index_of(packet)];
    const bool is_copy = interface == 1 && flight.sent[0].there() && !flight.sent[1].there();
    if (!is_copy) {
        pass(flight);
        flight = {};
    }
    flight.sent[interface].keep(when, packet);
    if (is_copy)
        ++merged_;
    else
        emit_(when, packet, packet.size());
}

void RingCopies::received(std::uint32_t interface, Moment when, Bytes packet) {
    const auto source = source_of(packet);
    const bool known = source == macs_[0] || source == macs_[1];
    const bool processed = (packet[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    if (!known) return emit_(when, packet, packet.size());
    if (!processed) {
        ++merged_;
        return;
    }
    const std::uint32_t copy = source == macs_[1] ? 1 : 0;
    Flight& flight = flights_[index_of(packet)];
    if (flight.passed) {
        ++merged_;
        return;
    }
    // It has crossed the whole ring, or it was sent alone: the other copy has no part of the reply.
    if (interface != copy || !flight.sent[1 - copy].there()) {
        if (flight.reply[1 - copy].there()) ++merged_;
        flight = {};
        return emit_(when, packet, packet.size());
    }
    flight.reply[copy].keep(when, packet);
    if (flight.reply[1 - copy].there()) return pass(flight);
    waiting_.push_back(index_of(packet));
}

// Passes on what is held, as one reply.
void RingCopies::pass(Flight& flight) {
    auto& [first, second] = flight.reply;
    if (first.there() && second.there()) {
        merge(first.bytes, flight.sent[0].bytes, second.bytes, flight.sent[1].bytes);
        first.when = std::max(first.when, second.when, [](const Moment& a, const Moment& b) { return a.at < b.at; });
        ++merged_;
        forward(first);
    } else if (first.there() || second.there()) {
        forward(first.there() ? first : second);
    }
    flight = {};
    flight.passed = true;
}

void RingCopies::pass_old(Moment now) {
    std::erase_if(waiting_, [&](std::uint8_t index) {
        Flight& flight = flights_[index];
        const Held& held = flight.reply[0].there() ? flight.reply[0] : flight.reply[1];
        if (held.there() && now.at - held.when.at < kPatience) return false;
        if (held.there()) pass(flight);
        return true;
    });
}

void RingCopies::finish() {
    for (const std::uint8_t index : waiting_) pass(flights_[index]);
    waiting_.clear();
}

}  // namespace margay::analyse
