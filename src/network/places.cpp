#include "network/places.hpp"

#include "network/expectation.hpp"

#include <algorithm>
#include <array>

namespace margay {
namespace {

bool of_the_line(const Slave& slave) { return slave.wanted == nullptr || slave.wanted->number != 0; }

bool has_stranger_address(const Network& network, const RingPlace& place, std::uint16_t below) {
    return network.stranger_address != 0 && place.address == network.stranger_address - below;
}

// Whether the slave at this place was identified, and is no slave of the line.
bool is_stranger(const Network& network, const RingPlace& place) {
    return has_stranger_address(network, place, 0) || has_stranger_address(network, place, stranger_address::kSuspect);
}

// The part of the line between two known slaves that contains the newcomer.
struct Gap {
    const Slave* before = nullptr;
    const Slave* behind = nullptr;
    std::size_t there = 0;  // places of unknown slaves that may be slaves of the line, the newcomer included
    std::size_t index = 0;  // how many of these places are before the newcomer

    [[nodiscard]] bool includes(const Slave& slave) const {
        return of_the_line(slave) && (before == nullptr || slave.number >= before->number) &&
               (behind == nullptr || slave.number <= behind->number);
    }
};

Gap find_gap(Network& network, std::size_t n) {
    const auto ring = network.seen_ring();
    const auto known = [&](std::size_t at) -> const Slave* {
        const std::uint16_t slave = ring[at].slave;
        return slave != 0 && of_the_line(network.slave(slave)) ? &network.slave(slave) : nullptr;
    };
    const auto counts = [&](std::size_t at) {
        return ring[at].slave == 0 && !is_stranger(network, ring[at]) &&
               group_above(network, static_cast<std::uint16_t>(at + 1)) == 0;
    };
    Gap gap{.there = 1};
    for (std::size_t at = n; at-- > 0 && (gap.before = known(at)) == nullptr;) gap.index += counts(at) ? 1U : 0U;
    gap.there += gap.index;
    for (std::size_t at = n; ++at < ring.size() && (gap.behind = known(at)) == nullptr;)
        gap.there += counts(at) ? 1U : 0U;
    return gap;
}

// The next place on the way from the break to the second NIC; nullptr: the second NIC.
const RingPlace* next_below(std::span<const RingPlace> ring, std::size_t n) {
    for (std::size_t at = n + 1; at < ring.size() && !ring[n].at_second_nic; ++at)
        if (ring[at].behind_break && ring[at].parent == n + 1) return &ring[at];
    return nullptr;
}

// The neighbour of a place in the direction of the NIC from which the frames come.
struct Neighbour {
    bool below = false;  // the neighbour is below the place, which is behind a break
    std::uint16_t slave = 0;
    std::uint8_t port = 0;  // of the slave above
    std::uint16_t home = SlaveMarks::kNoHome;
    std::uint8_t home_port = 0;
};

Neighbour find_neighbour(Network& network, std::size_t n) {
    const auto ring = network.seen_ring();
    Neighbour neighbour{.below = ring[n].behind_break};
    if (!neighbour.below) {
        neighbour.slave = ring[n].parent == 0 ? std::uint16_t{0} : ring[ring[n].parent - 1U].slave;
        neighbour.port = ring[n].parent_port;
        return neighbour;
    }
    const RingPlace* const next = next_below(ring, n);
    if (next == nullptr || next->slave == 0) return neighbour;
    neighbour.slave = next->slave;
    neighbour.home = network.marks(next->slave).home;
    neighbour.home_port = network.marks(next->slave).home_port;
    return neighbour;
}

// Whether the slave was seen last at this neighbour.
bool was_at(const Network& network, const Neighbour& neighbour, const Slave& slave) {
    const SlaveMarks& marks = network.marks(slave);
    if (!neighbour.below) return marks.home == neighbour.slave && marks.home_port == neighbour.port;
    if (neighbour.slave == 0) return marks.at_second_nic;
    if (neighbour.home == slave.number) return true;
    // `slave` was bridged, and the neighbour is now connected where `slave` was.
    return neighbour.home != SlaveMarks::kNoHome && marks.home == neighbour.home &&
           marks.home_port == neighbour.home_port && slave.number < neighbour.slave;
}

// Behind a break: whether any slave, lost or present, was seen last at this neighbour.
bool is_remembered(const Network& network, const Neighbour& neighbour) {
    if (!neighbour.below) return false;
    if (neighbour.slave != 0) return neighbour.home != SlaveMarks::kNoHome;
    return std::ranges::any_of(network.slaves(),
                               [&](const Slave& slave) { return network.marks(slave).at_second_nic; });
}

// The lost slaves of a gap, in the order of their numbers. A lost slave outside of the gap is included if the newcomer
// has its serial number, or, with two NICs, if it was at the neighbour of the newcomer.
struct Lost {
    std::size_t count = 0;
    Slave* in_order = nullptr;  // the lost slave with the index Gap::index, if the newcomer can be this slave
    // The lost slaves that the newcomer can be:
    std::array<Slave*, 2> same{};  // the first two with the serial number or the alias of the newcomer
    std::array<Slave*, 2> here{};  // the first two that were at this neighbour
    std::array<Slave*, 2> any{};   // the first two
    bool none_was_there = true;    // no lost slave of the gap was present since the scan
    Slave* never = nullptr;        // the first of these slaves that was not present since the scan
    Slave* replaced = nullptr;     // the first lost slave that was at this neighbour, or else the first lost slave
    bool unsettled = false;        // a slave is absent that is in use, and not reported lost yet
};

void add_one(std::array<Slave*, 2>& first_two, Slave& slave) {
    Slave*& next = first_two[first_two[0] == nullptr ? 0 : 1];
    if (next == nullptr) next = &slave;
}

// The numbers may have another order than the places: the frames of a broken ring pass its branches in another order
// than the frames of the whole ring, and the numbers may come from either order.
bool in_other_order(const Network& network) { return network.parts_read.two_nics; }

Lost find_lost_slaves(Network& network, const Gap& gap, const Neighbour& neighbour) {
    Lost lost;
    for (Slave& slave : network.slaves()) {
        const bool was_here = is_known(slave) && was_at(network, neighbour, slave);
        const bool elsewhere = (was_here && in_other_order(network)) || is_guest_by_serial(network, slave);
        if (!gap.includes(slave) && !(elsewhere && of_the_line(slave))) continue;
        if (!is_lost(network, slave)) {
            lost.unsettled |= slave.ring_position == 0 && slave.seen && fits_guest(network, slave);
            continue;
        }
        const bool may_be = guest_may_be(network, slave);
        if (lost.replaced == nullptr || (was_here && lost.here[0] == nullptr)) lost.replaced = &slave;
        if (lost.count++ == gap.index && may_be) lost.in_order = &slave;
        if (!may_be) continue;
        if (is_guest_by_number(network, slave)) add_one(lost.same, slave);
        if (was_here) add_one(lost.here, slave);
        add_one(lost.any, slave);
        lost.none_was_there &= !is_known(slave);
        if (lost.never == nullptr && !is_known(slave)) lost.never = &slave;
    }
    return lost;
}

Verdict undecided(const std::array<Slave*, 2>& between) { return {.rivals = {between[0], between[1]}}; }

}  // namespace

void remember_places(Network& network) {
    const auto ring = network.seen_ring();
    const bool reaches_second =
        std::ranges::any_of(ring, [](const RingPlace& place) { return static_cast<bool>(place.at_second_nic); });
    for (const RingPlace& place : ring) {
        if (place.slave == 0) continue;
        SlaveMarks& marks = network.marks(place.slave);
        if (reaches_second) marks.at_second_nic = place.at_second_nic;
        const std::uint16_t above = place.parent == 0 ? std::uint16_t{0} : ring[place.parent - 1U].slave;
        if (place.parent == 0 ? place.behind_break : above == 0) continue;
        marks.home = above;
        marks.home_port = static_cast<std::uint8_t>(place.parent_port & 3U);
    }
}

bool neighbour_is_known(const Network& network, std::size_t n) {
    const auto ring = network.ring.first(std::min<std::size_t>(network.ring_count, network.ring.size()));
    if (ring[n].behind_break) {
        const RingPlace* const below = next_below(ring, n);
        return below == nullptr ? ring[n].at_second_nic : below->slave != 0;
    }
    for (std::uint16_t at = ring[n].parent; at != 0; at = ring[at - 1U].parent)
        if (ring[at - 1U].slave == 0) return false;
    return true;
}

bool was_at_place(Network& network, std::size_t n, const Slave& slave) {
    return is_known(slave) && was_at(network, find_neighbour(network, n), slave);
}

Verdict choose_by_place(Network& network, std::size_t n) {
    if (!neighbour_is_known(network, n)) return {};
    const RingPlace& place = network.ring[n];
    const Neighbour neighbour = find_neighbour(network, n);
    const Gap gap = find_gap(network, n);
    const Lost lost = find_lost_slaves(network, gap, neighbour);
    if (lost.unsettled) return {};
    // The device was reported as a stranger while an equal slave was present. So the device is not this slave, although
    // the slave is lost now.
    const bool stranger = has_stranger_address(network, place, 0);
    if (!stranger && lost.same[0] != nullptr && lost.same[1] == nullptr) return {.slave = lost.same[0]};
    const bool all_are_there = !stranger && lost.in_order != nullptr && lost.count == gap.there;
    const bool others_were_asked =
        has_stranger_address(network, place, stranger_address::kUndecided) ||
        has_stranger_address(network, place, stranger_address::kUndecided + stranger_address::kSuspect);
    const bool one_was_here = lost.here[0] != nullptr && lost.here[1] == nullptr;
    if (all_are_there) {
        if (!one_was_here || lost.here[0] == lost.in_order || others_were_asked) return {.slave = lost.in_order};
        return undecided({lost.here[0], lost.in_order});
    }
    if (one_was_here) {
        if (lost.never == nullptr || lost.never->number > lost.here[0]->number) return {.slave = lost.here[0]};
        return undecided({lost.never, lost.here[0]});
    }
    if (lost.here[0] != nullptr) return undecided(lost.here);
    const bool placed_otherwise = is_remembered(network, neighbour);
    if (lost.any[0] == nullptr || stranger || placed_otherwise) return {.instead_of = lost.replaced};
    const bool decided = lost.any[1] == nullptr || lost.none_was_there || lost.count < gap.there;
    return decided ? Verdict{.slave = lost.any[0]} : undecided(lost.any);
}

}  // namespace margay
