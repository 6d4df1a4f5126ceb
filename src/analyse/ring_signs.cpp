#include "analyse/ring_signs.hpp"

#include "wire/datagram.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;

constexpr Duration kOneFlight = 20ms;  // the longest time between the first and the last sight of a frame
constexpr std::size_t kMostKinds = 1024;
constexpr Duration kCopiesNear = 1ms;      // the usual limit of the time between the first sights of both copies
constexpr std::uint64_t kLeastSigns = 16;  // flights; fewer signs may be chance

// A hash of the content that the two copies of a frame and their replies have in common. Commands are left out, because
// only one copy carries the time of a reference clock; positions are left out, too.
std::uint64_t shape_of_copies(Bytes packet) {
    std::uint64_t shape = 0xCBF29CE484222325;
    wire::DatagramReader reader(packet);
    while (const auto d = reader.next())
        for (const std::uint64_t part :
             {std::uint64_t{d->header.index}, std::uint64_t{d->data.size()}, std::uint64_t{d->header.address.ado()}})
            shape = (shape ^ part) * 0x100000001B3;
    return std::max<std::uint64_t>(shape, 1);
}

std::uint64_t data_of_copies(Bytes packet) {
    std::uint64_t data = 0xCBF29CE484222325;
    wire::DatagramReader reader(packet);
    while (const auto d = reader.next())
        for (const auto octet : d->data) data = (data ^ std::to_integer<std::uint64_t>(octet)) * 0x100000001B3;
    return data;
}

bool nearly_all(std::uint64_t part, std::uint64_t all) { return 10 * part >= 9 * all; }

}  // namespace

std::uint32_t counters_of(Bytes frame) {
    std::uint32_t sum = 0;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) sum += d->wkc;
    return sum;
}

// A hash of the datagrams without the octets that differ between the copies of a frame, or from frame to frame.
std::uint64_t kind_of_copies(Bytes frame) {
    std::uint64_t kind = 0xCBF29CE484222325;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        for (const std::uint64_t part : {std::uint64_t{d->data.size()}, std::uint64_t{d->header.address.ado()}})
            kind = (kind ^ part) * 0x100000001B3;
    return kind;
}

void RingSigns::look(const PacketOrigin& origin, Duration at, Bytes packet) {
    const bool is_plain = packet.size() >= wire::kFramePrefixBytes + wire::kDatagramOverheadBytes &&
                          packet[12] == std::byte{0x88} && packet[13] == std::byte{0xA4};
    if (!is_plain || origin.direction != PacketOrigin::Direction::unknown) {
        other_kinds_ = true;
        return;
    }
    ++frames_;
    Address address{};
    std::copy_n(packet.begin() + wire::kSourceMacOffset, address.size(), address.begin());
    const bool is_marked = (address[0] & wire::kPassedEscBit) != std::byte{0};
    address[0] &= ~wire::kPassedEscBit;
    std::size_t of = 0;
    while (of < known_ && addresses_[of] != address) ++of;
    if (of == addresses_.size()) {
        ++strangers_;
        return;
    }
    if (of == known_) addresses_[known_++] = address;
    ++(is_marked ? marked_ : unmarked_)[of];
    Flight& flight = flights_[std::to_integer<std::size_t>(packet[wire::kFramePrefixBytes + 1])];
    const auto shape = shape_of_copies(packet);
    if (flight.shape != shape || at - flight.at >= kOneFlight || flight.at - at >= kOneFlight) {
        count(flight);
        flight = {.shape = shape, .at = at, .first = is_marked ? 2 : of};
    }
    if (!is_marked && flight.unmarked[of] == 0) flight.data[of] = data_of_copies(packet);
    const bool is_first = flight.unmarked[of] + flight.marked[of] == 0;
    const bool is_second = flight.unmarked[1 - of] + flight.marked[1 - of] != 0;
    if (is_first && is_second && at - flight.at < kCopiesNear && flight.at - at < kCopiesNear) ++near_;
    ++(is_marked ? flight.marked : flight.unmarked)[of];
    if (!is_marked) return;
    flight.kind = kind_of_copies(packet);
    flight.counters = counters_of(packet);
}

void RingSigns::count(const Flight& flight) {
    if (flight.shape == 0) return;
    const auto& [unmarked, marked] = std::pair(flight.unmarked, flight.marked);
    std::array<bool, 2> there{};
    for (std::size_t of = 0; of < there.size(); ++of) {
        there[of] = unmarked[of] + marked[of] != 0;
        if (there[of]) ++seen_[of];
        // Slaves have processed this copy, and the other copy was seen again unchanged.
        if (marked[of] == 0 || marked[1 - of] != 0 || unmarked[1 - of] < 2) continue;
        ++crossed_[of];
        if (whole_.size() >= kMostKinds && whole_.count(flight.kind) == 0) continue;
        auto& most = whole_[flight.kind];
        most = std::max(most, flight.counters);
    }
    ++all_;
    if (there[0] && there[1]) ++both_;
    if (flight.first < first_.size()) ++first_[flight.first];
    if (unmarked[0] == 0 || unmarked[1] == 0) return;
    ++sent_twice_;
    if (flight.data[0] == flight.data[1]) ++sent_alike_;
}

RingSigns::Sight RingSigns::decide() {
    for (Flight& flight : flights_) count(std::exchange(flight, {}));
    constexpr std::uint64_t kFewStrangers = 16;
    if (other_kinds_ || kFewStrangers * strangers_ > frames_ || both_ < kLeastSigns || 2 * near_ < both_ ||
        !nearly_all(both_, std::min(seen_[0], seen_[1])) || !nearly_all(sent_alike_, sent_twice_))
        return Sight::none;
    const bool crosses = std::max(crossed_[0], crossed_[1]) >= kLeastSigns;
    const bool is_whole = crosses && nearly_all(sent_twice_, all_);
    if (is_whole ? crossed_[1] > crossed_[0] : first_[1] > first_[0]) {
        std::swap(addresses_[0], addresses_[1]);
        std::swap(first_[0], first_[1]);
    }
    if (is_whole) return Sight::whole;
    const auto is_complete = [&](std::size_t of) { return marked_[of] != 0 && unmarked_[of] != 0; };
    if (!crosses && is_complete(0) && is_complete(1)) return Sight::like;
    // If no request of one NIC was seen, the requests of the other NIC may be copies that have crossed the ring.
    const bool are_sent = unmarked_[0] != 0 && unmarked_[1] != 0 && nearly_all(first_[0], all_);
    return are_sent ? Sight::sent : Sight::part;
}

}  // namespace margay::analyse
