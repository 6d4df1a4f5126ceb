#include "network/ring_watch.hpp"

#include "network/by_address.hpp"
#include "network/newcomer.hpp"
#include "network/places.hpp"
#include "network/ring_reading.hpp"
#include "network/scan.hpp"
#include "network/topology.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace margay {
namespace {

const Slave* slave_at(Network& network, std::size_t position) {
    const auto slaves = network.slaves();
    const auto found = std::ranges::find(slaves, position, &Slave::ring_position);
    return found == slaves.end() || position == 0 ? nullptr : &*found;
}

}  // namespace

const Slave* last_slave(Network& network, std::uint8_t& port) {
    for (const Slave& slave : network.slaves()) {
        if (slave.ring_position == 0) continue;
        for (std::uint8_t p = 0; p < slave.ports.size(); ++p) {
            if (!slave.ports[p].open || slave.ports[p].neighbour != 0 || p == slave.entry_port) continue;
            port = p;
            return &slave;
        }
    }
    return nullptr;
}

namespace {

// The port of the last slave before a break: it leads to a slave that is lost, or it is closed (mostly port 1).
std::uint8_t broken_port(Network& network, const Slave& slave) {
    constexpr std::array<std::uint8_t, 3> kPorts{1, 3, 2};
    for (const std::uint8_t port : kPorts) {
        const std::uint16_t below = slave.ports[port].neighbour;
        if (port != slave.entry_port && below != 0 && network.slave(below).ring_position == 0) return port;
    }
    for (const std::uint8_t port : kPorts)
        if (port != slave.entry_port && !slave.ports[port].open) return port;
    return 1;
}

// The place on the way between the two NICs that the frames of the whole ring pass before `place`. The places
// up to `front` are passed on that way, the others are at branches behind it, one branch after the other.
std::size_t on_the_way(std::span<const RingPlace> ring, std::size_t front, std::size_t place) {
    while (place > front && ring[place - 1].parent > front) --place;
    return place > front ? ring[place - 1].parent : place;
}

// How many places only the second NIC reaches when the whole ring breaks above this place.
std::size_t count_behind(std::span<const RingPlace> ring, std::size_t front, std::size_t place) {
    std::size_t count = front + 1 - place;
    bool behind = false;
    for (const RingPlace& other : ring.subspan(std::min(front, ring.size()))) {
        if (other.parent <= front) behind = other.parent >= place;  // a branch begins
        count += behind ? 1U : 0U;
    }
    return count;
}

// A check value of the places and of the slaves at these places.
std::uint32_t sum_of_places(std::span<const RingPlace> ring) {
    std::uint32_t sum = 0;
    for (const RingPlace& place : ring) sum = sum * 31 + place.slave + std::uint32_t{place.parent} * 7;
    return sum;
}

// The slaves before and behind the break by the last places that were read. Returns false when the break is newer than
// the places, or the slaves are not known.
bool find_neighbours(Network& network, std::size_t first_behind, Event& event) {
    const auto ring = network.seen_ring();
    std::uint16_t at = first_behind == 0 ? std::uint16_t{0} : ring[first_behind - 1].slave;
    if (at == 0) return false;
    event.other = at;
    // The slaves between both are lost. Each of them was seen last below the next one of this search.
    for (std::size_t steps = 0; steps <= network.slaves().size(); ++steps) {
        const SlaveMarks& marks = network.marks(at);
        if (marks.home == SlaveMarks::kNoHome) return false;
        event.slave = marks.home;
        event.port = marks.home_port;
        at = marks.home;
        if (at == 0 || network.slave(at).ring_position != 0) return true;
    }
    return false;
}

// If only the first NIC reaches slaves: finds the last present slave on the way to the end of the ring, by the places
// that were seen last.
bool find_last_before(Network& network, std::uint16_t end, std::uint8_t end_port, Event& event) {
    if (end == 0) return false;
    event.slave = end;
    event.port = end_port;
    for (std::size_t steps = 0; steps <= network.slaves().size(); ++steps) {
        if (event.slave == 0 || network.slave(event.slave).ring_position != 0) return true;
        const SlaveMarks& marks = network.marks(event.slave);
        if (marks.home == SlaveMarks::kNoHome) return false;
        event.slave = marks.home;
        event.port = marks.home_port;
    }
    return false;
}

// Finds where the ring is open, by the numbers of slaves that the frames reach from the beginning and from the end of
// the ring.
Event find_break_by_counts(Network& network, std::size_t front, std::size_t behind, std::uint16_t end,
                           std::uint8_t end_port) {
    Event event{.kind = EventKind::ring_broken};
    const std::size_t all = std::max<std::size_t>(network.ring_count, front + behind);
    if (behind != 0)
        if (const Slave* other = slave_at(network, all - behind + 1)) event.other = other->number;
    if (front == 0) return event;
    const Slave* next = slave_at(network, front + 1);
    if (next != nullptr && next->parent != 0) {
        event.slave = next->parent;
        event.port = next->parent_port;
        return event;
    }
    if (behind == 0 && find_last_before(network, end, end_port, event)) return event;
    // Otherwise slaves are lost, or the ring was never seen whole.
    const Slave* at = slave_at(network, front);
    if (at != nullptr) event.port = broken_port(network, *at);
    if (behind == 0)
        if (const Slave* last = last_slave(network, event.port)) at = last;
    if (at != nullptr) event.slave = at->number;
    return event;
}

Task<Result<>> read_dl_status(Network& network, Slave& slave) {
    auto status = co_await read<std::uint16_t>(network.station(slave), wire::reg::kDlStatus, Step::topology);
    if (status) slave.dl_status = *status;
    co_return Nothing{};
}

void note_ends(Network& network, unsigned head, bool whole, const RingWatch& watch) {
    for (Slave& slave : network.slaves()) {
        const bool behind = !whole && watch.is_behind_break(network, slave);
        slave.ring = static_cast<RingEnd>(behind ? 1 - head : head);
    }
}

}  // namespace

// The first place behind the break. 0: not known, because the break is newer than the places, or a slave is lost.
void RingWatch::find_first_behind(Network& network, std::size_t front, std::size_t behind) {
    const auto ring = network.seen_ring();
    const RingParts read = network.parts_read;
    first_behind_ = 0;
    front_of_break_ = static_cast<std::uint16_t>(front);
    if (!read.two_nics || ring.size() != front + behind) return;
    if (read.whole && read.front > ring.size()) return;  // the places are being read again
    if (!read.whole) {
        const auto is_first = [](const RingPlace& place) { return place.behind_break && place.parent == 0; };
        const auto first = std::ranges::find_if(ring, is_first);
        if (read.front == front && first != ring.end())
            first_behind_ = static_cast<std::uint16_t>(first - ring.begin() + 1);
        return;
    }
    std::size_t low = 1;  // count_behind() becomes smaller from place to place
    std::size_t high = read.front + 1;
    while (low < high) {
        const std::size_t middle = (low + high) / 2;
        if (count_behind(ring, read.front, middle) <= behind)
            high = middle;
        else
            low = middle + 1;
    }
    if (low <= read.front && count_behind(ring, read.front, low) == behind)
        first_behind_ = static_cast<std::uint16_t>(low);
}

bool RingWatch::is_behind_front(Network& network, const Slave& slave) const {
    const RingParts now = parts();
    if (!now.two_nics || now.whole || slave.ring_position == 0) return false;
    const RingParts read = network.parts_read;
    const bool known = read.whole && first_behind_ != 0 && front_of_break_ == now.front;
    if (!known || slave.ring_position > network.seen_ring().size()) return slave.ring_position > now.front;
    return on_the_way(network.seen_ring(), read.front, slave.ring_position) >= first_behind_;
}

// Whether the places that were read last belong to the ring as the frames pass it now. If not, it is not known at which
// side of the break a slave is.
bool RingWatch::are_places_new(Network& network) const {
    const RingParts now = parts();
    const RingParts read = network.parts_read;
    if (now.whole) return read.whole;
    const std::size_t seen = std::size_t{ring_.reached_by(0)} + ring_.reached_by(1);
    if (!ring_.counts_are_new() || seen != network.ring_count) return false;
    return read.whole ? first_behind_ != 0 && front_of_break_ == now.front : read.front == now.front;
}

Event RingWatch::find_break(Network& network, std::size_t front, std::size_t behind) const {
    Event event{.kind = EventKind::ring_broken};
    if (find_neighbours(network, first_behind_, event)) return event;
    return find_break_by_counts(network, front, behind, end_, end_port_);
}

void RingWatch::report_break(Network& network) {
    const unsigned head = ring_.head();
    const std::size_t front = ring_.reached_by(head);
    const std::size_t behind = ring_.reached_by(1 - head);
    if (has_beside_) (void)find_sides(network);
    // The break was reported already. A search reads the places again: until its end, some are not read yet.
    if (reported_ == RingState::broken && network.searching) return;
    const std::uint32_t sum = sum_of_places(network.seen_ring()) * 31 + ring_.changes() * 2 + network.parts_read.whole;
    const bool same = !has_beside_ && reported_ == RingState::broken && sum == places_of_break_ &&
                      front == front_of_break_ && behind == behind_break_;
    if (same) return;
    places_of_break_ = sum;
    behind_break_ = static_cast<std::uint16_t>(behind);
    find_first_behind(network, front, behind);
    note_ends(network, head, false, *this);
    // The break was reported already. Its new place is reported when the places of the ring have been read again.
    if (reported_ == RingState::broken && front + behind != network.ring_count) return;
    if (reported_ != RingState::broken && network.parts_read.whole) {  // the ports of the whole ring
        const Slave* const last = last_slave(network, end_port_);
        end_ = last != nullptr ? last->number : std::uint16_t{0};
    }
    Event event = find_break(network, front, behind);
    if (reported_ == RingState::broken && event.slave == before_ && event.other == behind_) return;
    before_ = event.slave;
    behind_ = event.other;
    event.actual = head;
    reported_ = RingState::broken;
    if (behind == 0 && !ring_.ever_whole()) event.kind = EventKind::second_cable_missing;
    network.report(event);
}

void RingWatch::report_fault(Network& network, CablingFault fault) {
    if (std::exchange(reported_fault_, fault) == fault) return;
    if (fault == CablingFault::none) {  // the state of the ring reports the end of the fault
        before_ = behind_ = 0;
        reported_ = RingState::broken;
        return;
    }
    const bool same = fault == CablingFault::same_port;
    network.report({.kind = same ? EventKind::nics_on_same_port : EventKind::second_segment});
}

void RingWatch::watch(Network& network) {
    note_change(network);
    judge_change(network);
    report_fault(network, ring_.fault());
    if (ring_.fault() != CablingFault::none) return;
    const unsigned head = ring_.head();
    const bool swapped = head == 1;
    if (swapped && !std::exchange(reported_swapped_, true)) network.report({.kind = EventKind::cables_swapped});
    reported_swapped_ = swapped;
    if (ring_.ring() == RingState::broken && ring_.counts_are_new()) report_break(network);
    if (ring_.ring() != RingState::whole) return;
    note_ends(network, head, true, *this);
    if (std::exchange(reported_, RingState::whole) == RingState::broken)
        network.report({.kind = EventKind::ring_closed, .slave = before_, .other = behind_, .actual = head});
}

Error RingWatch::check() const {
    const CablingFault fault = ring_.fault();
    if (fault == CablingFault::none) return {};
    return {.code = Errc::cabling, .step = Step::count_slaves, .detail = static_cast<std::uint32_t>(fault)};
}

RingParts RingWatch::parts() const {
    const RingState ring = ring_.ring();
    if (ring == RingState::unknown) return {};
    return {.two_nics = true, .whole = ring == RingState::whole, .front = ring_.reached_by(ring_.head())};
}

bool RingWatch::begins_right(Network& network) {
    if (begins_at_the_end(network.seen_ring(), network.parts_read)) {
        ring_.turn_round();
        return false;
    }
    // In a broken ring, the ports are different. Delays that are computed with these ports in the whole ring would be
    // wrong.
    ports_of_broken_ = network.parts_read.two_nics && !network.parts_read.whole;
    return true;
}

Task<Result<>> RingWatch::find_beginning(Network& network) {
    has_beside_ = ways_known_ = judges_ = false;  // until the delays of this scan are measured
    ring_.guard_times(false);
    network.parts_read = parts();
    const bool told = network.parts_read.whole ? network.parts_read.front == network.count
                                               : network.parts_read.front % network.count != 0;
    if (!network.parts_read.two_nics || told) co_return Nothing{};
    network.ring_count = network.count;
    const auto ring = network.seen_ring();
    for (std::size_t n = 0; n < ring.size(); ++n) {
        std::array<std::byte, 2> dl_status{};
        Datagram look(network.engine.link(), wire::Command::APRD,
                      {RingPosition{static_cast<std::uint16_t>(n)}, wire::reg::kDlStatus.address},
                      MutableBytes(dl_status));
        const auto reply = co_await look;
        if (!reply.ok() || reply.wkc != 1) co_return Nothing{};  // the scan reports the error
        ring[n] = {.dl_status = load_le<std::uint16_t>(dl_status)};
    }
    if (parts().divides_like(network.parts_read) && !begins_right(network)) co_await required(count_slaves(network));
    co_return Nothing{};
}

Task<Result<>> RingWatch::read_ports(Network& network) {
    const Searching searching(network);
    const std::uint32_t changes = ring_.changes();
    const auto read_one = [&network](Slave& s) { return read_dl_status(network, s); };
    co_await required(for_each_slave(network, read_one));
    if (ring_.changes() != changes) co_return Nothing{};  // the next round reads them
    // In the whole ring, a branch whose port comes after the way to the next ring slave has another place.
    const auto ring = network.seen_ring();
    ByAddress table(network);
    for (std::size_t n = 0; n < ring.size(); ++n) {
        std::array<std::byte, 2> address{};
        Datagram look(network.engine.link(), wire::Command::APRD,
                      {RingPosition{static_cast<std::uint16_t>(n)}, wire::reg::kStationAddress.address},
                      MutableBytes(address));
        const auto reply = co_await look;
        if (!reply.ok() || reply.wkc != 1) co_return Nothing{};  // the next round
        const std::uint16_t at = load_le<std::uint16_t>(address);
        const Slave* const known = table.find(at);
        // A slave comes back: the search reads the places of all slaves.
        const bool returns = known != nullptr ? is_lost(network, *known) : ring[n].slave != 0;
        if (returns) co_return Nothing{};
        ring[n] = {.slave = known != nullptr ? known->number : std::uint16_t{0},
                   .address = at,
                   .dl_status = known != nullptr ? known->dl_status : ring[n].dl_status};
    }
    if (ring_.changes() != changes) co_return Nothing{};
    ports_of_broken_ = false;
    network.topology_read = find_topology(network.seen_ring(), parts()).ok();
    store_topology(network.seen_ring(), network.slaves());
    if (network.topology_read) remember_places(network);
    co_return Nothing{};
}

Task<Result<>> RingWatch::read_ports_again(Network& network, std::uint32_t changes) {
    for (unsigned tries = 3; tries > 0 && ring_.changes() != changes; --tries) {
        changes = ring_.changes();
        const auto again = [&network](Slave& s) { return read_dl_status(network, s); };
        co_await required(for_each_slave(network, again));
        co_await required(count_slaves(network));
    }
    ports_of_broken_ = parts().two_nics && !parts().whole;
    co_return Nothing{};
}

}  // namespace margay
