#include "network/ring_watch.hpp"

#include "network/by_address.hpp"
#include "network/places.hpp"
#include "network/scan.hpp"
#include "network/topology.hpp"

#include <algorithm>
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

// Where the ring is open. `front` and `behind`: how many slaves the frames reach from its beginning and from its end.
Event find_break(Network& network, std::size_t front, std::size_t behind) {
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
    // Slaves are lost, or the ring was never seen whole.
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

void RingWatch::report_break(Network& network, const RedundancyStatus& now) {
    const unsigned head = now.swapped ? 1 : 0;
    const std::size_t front = now.cables[head].slaves;
    const std::size_t behind = now.cables[1 - head].slaves;
    if (has_beside_) (void)find_sides(network);
    note_ends(network, head, false, *this);
    Event event = has_beside_ ? find_break_beside(network) : find_break(network, front, behind);
    if (reported_ == RingState::broken && event.slave == before_ && event.other == behind_) return;
    before_ = event.slave;
    behind_ = event.other;
    reported_ = RingState::broken;
    if (behind == 0 && !ring_.ever_whole()) event.kind = EventKind::second_cable_missing;
    network.report(event);
}

void RingWatch::report_fault(Network& network, CablingFault fault) {
    if (std::exchange(reported_fault_, fault) == fault) return;
    if (fault == CablingFault::none) {  // the end of the fault is told with the state of the ring
        before_ = behind_ = 0;
        reported_ = RingState::broken;
        return;
    }
    const bool same = fault == CablingFault::same_port;
    network.report({.kind = same ? EventKind::nics_on_same_port : EventKind::second_segment});
}

void RingWatch::watch(Network& network) {
    const RedundancyStatus now = ring_.status();
    report_fault(network, now.fault);
    if (now.fault != CablingFault::none) return;
    if (now.swapped && !std::exchange(reported_swapped_, true)) network.report({.kind = EventKind::cables_swapped});
    reported_swapped_ = now.swapped;
    if (now.ring == RingState::broken && ring_.counts_are_new()) report_break(network, now);
    if (now.ring != RingState::whole) return;
    note_ends(network, now.swapped ? 1 : 0, true, *this);
    if (std::exchange(reported_, RingState::whole) == RingState::broken)
        network.report({.kind = EventKind::ring_closed, .slave = before_, .other = behind_});
}

Error RingWatch::check() const {
    const CablingFault fault = ring_.status().fault;
    if (fault == CablingFault::none) return {};
    return {.code = Errc::cabling, .step = Step::count_slaves, .detail = static_cast<std::uint32_t>(fault)};
}

RingParts RingWatch::parts() const {
    const RedundancyStatus now = ring_.status();
    if (now.ring == RingState::unknown) return {};
    return {.two_nics = true, .whole = now.ring == RingState::whole, .front = now.cables[ring_.head()].slaves};
}

Task<Result<>> RingWatch::read_ports(Network& network) {
    const std::uint32_t changes = ring_.changes();
    const auto read_one = [&network](Slave& s) { return read_dl_status(network, s); };
    co_await required(for_each_slave(network, read_one));
    if (ring_.changes() != changes) co_return Nothing{};  // the next round reads them
    // A branch behind the way to the next ring slave has another place now.
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
