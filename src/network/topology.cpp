#include "network/topology.hpp"

#include "wire/esc.hpp"

#include <algorithm>

namespace margay {
namespace {

// The next port by which a frame leaves a slave, after the frame has arrived at `port`.
constexpr std::uint8_t next_port(std::uint8_t port) {
    constexpr std::uint8_t kNext[4] = {3, 2, 0, 1};  // 0 → 3 → 1 → 2 → 0
    return kNext[port & 3];
}

void read_ports(RingPlace& place) {
    for (unsigned p = 0; p < 4; ++p) {
        place.ports[p].link = (place.dl_status & wire::dl_status::physical_link(p)) != 0;
        place.ports[p].open = (place.dl_status & wire::dl_status::loop_closed(p)) == 0 &&
                              (place.dl_status & wire::dl_status::communication(p)) != 0;
        place.ports[p].neighbour = 0;
    }
    // Frames arrive at port 0 unless nothing is connected there.
    place.entry_port = 0;
    while (!place.ports[place.entry_port].open && next_port(place.entry_port) != 0)
        place.entry_port = next_port(place.entry_port);
    place.parent = 0;
    place.parent_port = 0;
    place.at_second_nic = place.behind_break = false;
}

// The first open port of `place` behind its entry port that has no neighbour yet, or the entry port when there is none.
std::uint8_t free_port(const RingPlace& place) {
    std::uint8_t port = next_port(place.entry_port);
    while (port != place.entry_port && !(place.ports[port].open && place.ports[port].neighbour == 0))
        port = next_port(port);
    return port;
}

Error topology_error(std::size_t place, std::uint16_t port) {
    return {.code = Errc::unstable, .step = Step::topology, .slave = static_cast<std::uint16_t>(place), .index = port};
}

// Sets the parent of a slave: the next known slave in the direction of the master.
void store_parent(std::span<const RingPlace> ring, const RingPlace& place, Slave& slave) {
    slave.entry_port = place.entry_port;
    slave.parent_port = place.parent_port;
    std::uint16_t at = place.parent;
    while (at != 0 && ring[at - 1U].slave == 0) {
        slave.parent_port = ring[at - 1U].parent_port;
        at = ring[at - 1U].parent;
    }
    slave.parent = at == 0 ? std::uint16_t{0} : ring[at - 1U].slave;
}

constexpr std::uint16_t kSecondNic = UINT16_MAX;  // value of a port's neighbour

// The place by whose free port a frame continues after it has passed the places 1 to `last`: the place `last`, or the
// nearest of its parents that has a free open port. 0: no port is free.
std::size_t free_place(std::span<const RingPlace> ring, std::size_t last) {
    while (last != 0 && free_port(ring[last - 1]) == ring[last - 1].entry_port) last = ring[last - 1].parent;
    return last;
}

// Connects the second NIC to the next free port, by which a frame leaves after it has passed `last` places. Returns the
// place of this port; 0: no port is free.
std::size_t leave_to_second_nic(std::span<RingPlace> ring, std::size_t last) {
    const std::size_t at = free_place(ring, last);
    if (at != 0) ring[at - 1].ports[free_port(ring[at - 1])].neighbour = kSecondNic;
    if (at != 0) ring[at - 1].at_second_nic = true;
    return at;
}

// Fills the place of the first slave behind the break: its port 0 is closed, and it has no parent.
void begin_second_part(RingPlace& place) {
    place.entry_port = 0;
    place.parent = 0;
    place.parent_port = 0;
    place.behind_break = true;
}

// The index of the first slave behind the break: its port 0 is closed. The places before it from `front` on are at
// branches that the frames of the second NIC pass first.
std::size_t first_behind(std::span<const RingPlace> ring, std::size_t front) {
    for (std::size_t i = front; i < ring.size(); ++i)
        if (!ring[i].ports[0].open) return i;
    return front;
}

// Connects place `i` (from 0) to the next free port after the frame has passed the place `before` (from 1).
Error connect(std::span<RingPlace> ring, std::size_t i, std::size_t before) {
    const std::size_t parent = free_place(ring, before);
    ring[i].parent = static_cast<std::uint16_t>(parent == 0 ? i : parent);
    ring[i].parent_port = parent == 0 ? ring[i == 0 ? 0 : i - 1].entry_port : free_port(ring[parent - 1]);
    ring[i].ports[ring[i].entry_port].neighbour = ring[i].parent;
    if (parent == 0) return topology_error(i + 1, 0);
    ring[parent - 1].ports[ring[i].parent_port].neighbour = static_cast<std::uint16_t>(i + 1);
    return {};
}

}  // namespace

Result<> find_topology(std::span<RingPlace> ring, RingParts parts) {
    Error error;
    const auto note = [&error](const Error& found) {
        if (error.code == Errc::none) error = found;
    };
    for (RingPlace& place : ring) read_ports(place);
    const std::size_t front = parts.two_nics ? std::min(parts.front, ring.size()) : ring.size();
    const std::size_t first = parts.whole ? front : first_behind(ring, front);
    for (std::size_t i = 1; i < front; ++i) note(connect(ring, i, i));
    if (!parts.whole && first < ring.size()) begin_second_part(ring[first]);
    for (std::size_t i = first + 1; !parts.whole && i < ring.size(); ++i) note(connect(ring, i, i));
    // 0: the way to the second NIC is not known yet.
    std::size_t before = 0;
    if (parts.two_nics) before = leave_to_second_nic(ring, parts.whole ? front : ring.size());
    // The way from the second NIC to the break.
    for (std::size_t at = before; !parts.whole && front < ring.size() && at != 0; at = ring[at - 1].parent)
        ring[at - 1].behind_break = true;
    const std::size_t end = parts.whole ? ring.size() : first;
    for (std::size_t i = front; i < end; ++i) note(connect(ring, i, i == front ? before : i));
    for (RingPlace& place : ring) {
        const std::uint8_t port = free_port(place);
        if (port != place.entry_port) note(topology_error(static_cast<std::size_t>(&place - ring.data() + 1), port));
        for (RingPlace::Port& to : place.ports)
            if (to.neighbour == kSecondNic) to.neighbour = 0;
    }
    return error.code == Errc::none ? Result<>() : Result<>(error);
}

bool begins_at_the_end(std::span<RingPlace> ring, RingParts parts) {
    if (!parts.two_nics || parts.front > ring.size()) return false;
    if (!parts.whole) {
        if (parts.front != 0 && parts.front != ring.size()) return false;
        const RingParts turned{.two_nics = true, .front = ring.size() - parts.front};
        return !find_topology(ring, parts).ok() && find_topology(ring, turned).ok();
    }
    int before = 0;  // open ports of the places before the front, more than two for each
    int all = 0;
    for (RingPlace& place : ring) {
        read_ports(place);
        for (const RingPlace::Port& port : place.ports) all += port.open ? 1 : 0;
        all -= 2;
        if (static_cast<std::size_t>(&place - ring.data()) < parts.front) before = all;
    }
    return all == 0 && before < 0;
}

void store_topology(std::span<const RingPlace> ring, std::span<Slave> slaves) {
    for (Slave& slave : slaves) slave.ring_position = 0;
    for (const RingPlace& place : ring) {
        if (place.slave == 0) continue;
        Slave& slave = slaves[place.slave - 1U];
        slave.ring_position = static_cast<std::uint16_t>(&place - ring.data() + 1);
        slave.dl_status = place.dl_status;
        store_parent(ring, place, slave);
        for (std::size_t p = 0; p < slave.ports.size(); ++p) {
            slave.ports[p].link = place.ports[p].link;
            slave.ports[p].open = place.ports[p].open;
            const std::uint16_t at = place.ports[p].neighbour;
            if (place.ports[p].open) slave.ports[p].neighbour = at == 0 ? std::uint16_t{0} : ring[at - 1U].slave;
        }
    }
    for (Slave& slave : slaves)
        for (Port& port : slave.ports)
            if (!port.open && port.neighbour != 0 && slaves[port.neighbour - 1U].ring_position != 0) port.neighbour = 0;
}

}  // namespace margay
