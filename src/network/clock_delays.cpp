// The ways of the frames through the segment, for the propagation delays of the clocks. In a ring with two NICs that is
// broken, the frames of the second NIC enter the slaves behind the break at the other end, pass them to the break
// without being processed, and are processed on their way back: in the same order as in the whole ring.
#include "network/clocks.hpp"
#include "network/network.hpp"

#include <algorithm>

namespace margay {
namespace {

// How much longer the way through the processing unit takes, by the type of the chip (register 0x0000). Recordings of
// E-bus terminals show 20 ns for ET1100 and ET1200 (test/clock/delays_test.cpp); for other chips nothing is recorded.
constexpr std::uint16_t processing_ns_of(const Slave& slave) {
    const std::int16_t set = slave.config.dc().processing_ns;
    if (set >= 0) return static_cast<std::uint16_t>(set);
    const bool is_et = slave.dl.type == 0x11 || slave.dl.type == 0x12;
    return is_et ? 20 : 40;
}

// The first place behind the break; the number of places where there is none.
std::size_t second_part(Network& network, std::size_t places) {
    const RingParts parts = network.ring_parts();
    return parts.two_nics && !parts.whole ? std::min(parts.front, places) : places;
}

// A port that leads to no slave: that to the second NIC. The entry port when there is none.
std::uint8_t outer_port(const RingPlace& place) {
    for (std::uint8_t port = 0; port < 4; ++port)
        if (place.ports[port].open && place.ports[port].neighbour == 0 && port != place.entry_port) return port;
    return place.entry_port;
}

// Turns the way from the first slave behind the break to the last one: it begins at the last one.
void turn_second_part(Network& network, std::span<DelayNode> nodes, std::size_t first) {
    const auto ring = network.seen_ring();
    std::size_t at = nodes.size();
    while (at > first && outer_port(ring[at - 1]) == ring[at - 1].entry_port) --at;
    if (at == first) return;
    DelayNode turned{.parent = 0, .parent_port = 0, .entry_port = outer_port(ring[at - 1])};
    for (std::size_t steps = 0; at > first && at <= nodes.size() && steps <= nodes.size(); ++steps) {
        DelayNode& node = nodes[at - 1];
        const DelayNode before = node;
        node.parent = turned.parent;
        node.parent_port = turned.parent_port;
        node.entry_port = turned.entry_port;
        turned = {.parent = static_cast<std::uint16_t>(at),
                  .parent_port = before.entry_port,
                  .entry_port = before.parent_port};
        at = before.parent;
    }
}

// Sets the ports of all nodes behind which a slave answers. A port to slaves that are lost keeps an old receive time.
void find_neighbours(Network& network, std::span<DelayNode> nodes) {
    const auto ring = network.seen_ring();
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (ring[n].slave != 0 && network.slave(ring[n].slave).al.state == AlState::none) continue;
        for (std::size_t at = n; nodes[at].parent != 0 && nodes[at].parent <= nodes.size();
             at = nodes[at].parent - 1U) {
            DelayNode& parent = nodes[nodes[at].parent - 1U];
            const auto port = static_cast<std::uint8_t>(1U << (nodes[at].parent_port & 3));
            if ((parent.neighbours & port) != 0) break;
            parent.neighbours |= port;
        }
    }
}

// Of the first node from `from` on whose delay can be known; nullptr: none.
const DelayNode* first_timed(std::span<const DelayNode> nodes, std::size_t from) {
    for (std::size_t n = from; n < nodes.size(); ++n)
        if (nodes[n].timed()) return &nodes[n];
    return nullptr;
}

// The delay from the last slave before the break to the first one behind it is not known while the cable is broken. It
// is taken for one of 10 m, until the ring is whole: the clocks behind the break do not depend on it, because they
// follow the first clock there.
constexpr std::int64_t kUnknownCable_ns = 500;

}  // namespace

std::size_t find_frame_ways(Network& network) {
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    const auto nodes = clocks.nodes.first(std::min(clocks.nodes.size(), ring.size()));
    const std::size_t second = second_part(network, nodes.size());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const RingPlace& place = ring[n];
        nodes[n] = {.parent = place.parent, .parent_port = place.parent_port, .entry_port = place.entry_port};
        if (n >= second && place.parent <= second) nodes[n].parent = 0;  // the cable is broken
        if (place.slave == 0) continue;
        nodes[n].times = &clocks.entries[place.slave - 1U].times;
        nodes[n].processing_ns = processing_ns_of(network.slave(place.slave));
    }
    if (second < nodes.size()) turn_second_part(network, nodes, second);
    find_neighbours(network, nodes);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (ring[n].slave == 0) continue;
        ClockEntry& clock = clocks.entries[ring[n].slave - 1U];
        const bool turned = nodes[n].entry_port != ring[n].entry_port;
        const bool comes_back = turned && (nodes[n].neighbours >> ring[n].entry_port & 1) != 0;
        clock.arrival_port = nodes[n].entry_port;
        clock.passing_port = comes_back ? ring[n].entry_port : nodes[n].entry_port;
    }
    return nodes.size();
}

void compute_clock_delays(Network& network) {
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    const auto nodes = clocks.nodes.first(find_frame_ways(network));
    compute_delays(nodes);
    std::size_t reference = network.slave(clocks.reference).ring_position;
    if (reference == 0 || reference > nodes.size()) return;
    // A delay cannot be negative: all are from the first clock, which is the reference again when it is settled.
    for (std::size_t n = reference; n-- > 0;)
        if (ring[n].slave != 0 && nodes[n].timed() && is_clock(clocks.entries[ring[n].slave - 1U].kind))
            reference = n + 1;
    const std::size_t second = second_part(network, nodes.size());
    const bool parted = reference <= second && second < nodes.size();
    const DelayNode* const behind = parted ? first_timed(nodes, second) : nullptr;
    std::int64_t farthest = 0;  // before the break
    std::uint16_t way = 0;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (ring[n].slave == 0) continue;
        const std::uint16_t before = way;
        way = static_cast<std::uint16_t>(way + way_part(network.slave(ring[n].slave)));
        if (!nodes[n].timed()) continue;
        const std::int64_t passed = delay_between_ns(nodes[reference - 1], nodes[n]);
        if (n < second) farthest = std::max(farthest, passed);
        const std::int64_t delay = behind != nullptr && n >= second
                                       ? farthest + kUnknownCable_ns + delay_between_ns(*behind, nodes[n])
                                       : passed;
        ClockEntry& clock = clocks.entries[ring[n].slave - 1U];
        clock.delay_ns = static_cast<std::uint32_t>(std::max<std::int64_t>(delay, 0));
        clock.passed_ns = static_cast<std::int32_t>(passed);
        clock.measured = true;
        clock.way = before;
    }
}

// Receive times that no way of the frames explains. A port that the last frame has not passed has an old time: the
// slaves behind it were lost, and this is not known yet. Where frames arrive at a port other than 0 and other slaves
// are behind, neither the DL status nor the order of the slaves tells which slave is connected to which.
Error check_receive_times(Network& network) {
    constexpr std::int64_t kLongest_ps = 100'000'000'000;  // 100 ms: longer than a frame through 65 535 slaves
    const auto ring = network.seen_ring();
    const auto nodes = network.clocks.nodes.first(find_frame_ways(network));
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const DelayNode& node = nodes[n];
        if (ring[n].slave == 0 || !node.timed()) continue;
        Error error{.step = Step::configure_clocks, .slave = ring[n].slave};
        for (std::uint8_t port = 0; port < 4; ++port) {
            if (port == node.entry_port) continue;
            const bool neighbour = (node.neighbours >> port & 1) != 0;
            const bool connected = neighbour || (network.redundancy == nullptr && ring[n].ports[port].open);
            const std::int64_t time = node.times->port_ps(port);
            const bool old = node.times->differ(port) || time > kLongest_ps || time < -kLongest_ps;
            if (old && neighbour) error.code = Errc::unstable;
            // Behind a break of a ring with two NICs, frames arrive at other ports by intention.
            const bool before = time < 0 || (network.redundancy == nullptr && node.entry_port != 0);
            if (!old && connected && before) {
                error.code = Errc::unsupported;
                error.actual = time < 0 ? port : node.entry_port;
            }
            if (error.code != Errc::none) return error;
        }
    }
    return {};
}

bool find_old_delays(Network& network) {
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    const bool any_followed = network.slave(clocks.reference).al.state != AlState::none;
    // By how much the sum before a slave has changed.
    const auto change = [&](std::uint16_t slave) {
        std::uint16_t way = 0;
        for (const RingPlace& place : ring) {
            if (place.slave == slave) break;
            if (place.slave != 0) way = static_cast<std::uint16_t>(way + way_part(network.slave(place.slave)));
        }
        return static_cast<std::uint16_t>(way - clocks.entries[slave - 1U].way);
    };
    const std::uint16_t of_reference = change(clocks.reference);
    std::uint16_t second = 0;
    std::uint16_t of_second = 0;
    std::uint16_t way = 0;
    bool any = false;
    for (const RingPlace& place : ring) {
        if (place.slave == 0) continue;
        const Slave& slave = network.slave(place.slave);
        ClockEntry& clock = clocks.of(slave);
        const auto moved = static_cast<std::uint16_t>(way - clock.way);
        way = static_cast<std::uint16_t>(way + way_part(slave));
        const std::uint16_t followed =
            network.redundancy == nullptr ? clocks.reference : network.redundancy->reference_of(network, slave);
        if (followed != clocks.reference && followed != second) of_second = change(second = followed);
        const bool there = any_followed && clock.measured && clock.synchronised && slave.al.state != AlState::none;
        clock.delay_old = there && moved != (followed == clocks.reference ? of_reference : of_second);
        any |= clock.delay_old;
    }
    return any;
}

}  // namespace margay
