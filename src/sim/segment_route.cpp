// Segment: ports, loops, and the path of a frame.
#include "sim/segment.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

// The port order of a frame; the processing unit is located behind port 0.
constexpr std::array<std::uint8_t, kMaxPorts> kNext{3, 2, 0, 1};

// 0x0101, two bits per port.
enum class Loop : std::uint8_t { automatic, auto_close, open, closed };
Loop loop_of(std::uint32_t dl_control, unsigned port) { return static_cast<Loop>((dl_control >> (8 + 2 * port)) & 3); }

}  // namespace

void Segment::topology_changed() { ++topology_; }

// Notes that values which are compared with datagrams have changed in a slave, or that its ports have changed.
void Segment::note_change(std::uint32_t number) {
    auto& node = nodes_[number];
    node.configuration = node.esc->configuration();
    if (node.loops_written != node.esc->loops_written()) {
        update_ports(number, true);
        return topology_changed();
    }
    for (auto& known : routes_)
        if (known.built == topology_ && number < known.visit_of.size() && known.visit_of[number] != kNobody)
            note(known, known.visit_of[number]);
}

bool Segment::linked(const Node& node, unsigned port) const {
    const auto& cable = node.cables[port];
    if (!node.powered || !cable.intact) return false;
    return cable.peer == Peer::master || (cable.peer == Peer::slave && nodes_[cable.to.slave].powered);
}

// ESC data sheets I, "Loop control and loop state".
void Segment::update_ports(std::uint32_t number, bool control_written, unsigned opened) {
    auto& node = nodes_[number];
    if (!node.powered) return;
    node.loops_written = node.esc->loops_written();
    unsigned status = 0;
    for (unsigned p = 0; p < kMaxPorts; ++p) {
        const bool link = linked(node, p);
        if (node.link[p] && !link) node.esc->count_lost_link(p);
        switch (loop_of(node.esc->dl_control(), p)) {
            case Loop::automatic: node.open[p] = link; break;
            // A closed port stays closed until the master writes the loop control again, or until a valid frame arrives
            // at the port.
            case Loop::auto_close: node.open[p] = link && (node.open[p] || control_written || p == opened); break;
            case Loop::open: node.open[p] = true; break;
            case Loop::closed: node.open[p] = false; break;
        }
        node.link[p] = link;
        node.esc->set_link(p, link);
        if (link) status |= wire::dl_status::physical_link(p);
        if (!node.open[p]) status |= wire::dl_status::loop_closed(p);
        if (link && node.open[p]) status |= wire::dl_status::communication(p);
    }
    node.recovery = std::find(node.open.begin(), node.open.end(), true) == node.open.end();
    node.esc->set_dl_status(static_cast<std::uint16_t>(status));
}

void Segment::update_all_ports() {
    for (std::uint32_t n = 0; n < size(); ++n) update_ports(n, false);
    topology_changed();
}

Segment::Route& Segment::route(unsigned master_port) {
    auto& found = routes_[master_port];
    if (found.built != topology_) build(found, master_port);
    return found;
}

void Segment::build(Route& route, unsigned master_port) {
    route.built = topology_;
    route.visits.clear();
    route.hops.clear();
    route.circulating_at = kNobody;
    route.returns = route.knocks = false;
    route.aliases = false;
    route.any_irq = 0;
    const auto& cable = masters_[master_port];
    if (master_link(master_port)) walk(route, cable.to, cable.delay);

    const auto count = route.visits.size();
    route.esc.assign(count, nullptr);
    route.configuration.assign(count, 0);
    route.station.assign(count, 0);
    route.alias.assign(count, kNobody);
    route.logical_first.assign(count, 1);
    route.logical_last.assign(count, 0);
    route.irq.assign(count, 0);
    std::array<Duration, kMaxPorts> nowhere;
    nowhere.fill(Duration(-1));
    route.ports.assign(count, nowhere);
    auto& visit_of = route.visit_of;
    visit_of.assign(size(), kNobody);
    for (std::uint32_t v = 0; v < count; ++v) {
        visit_of[route.visits[v].slave] = v;
        note(route, v);
    }
    // An ESC latches the receive time at the same point as the system time: behind the physical layer of the port. So
    // the delay of the port is a part of the cable.
    for (const auto& hop : route.hops) {
        if (visit_of[hop.at.slave] == kNobody) continue;
        const auto& chip = nodes_[hop.at.slave].esc->description();
        route.ports[visit_of[hop.at.slave]][hop.at.port] = hop.offset + chip.ports[hop.at.port].delay;
    }
}

// Follows the frame from the port at which it arrives until it reaches a master or is lost.
void Segment::walk(Route& route, PortRef entry, Duration t) {
    const auto limit = size() * kMaxPorts * 2 + 2;
    for (std::size_t step = 0; step < limit; ++step) {
        const auto& node = nodes_[entry.slave];
        const auto& chip = node.esc->description();
        route.hops.push_back({entry, t, static_cast<std::uint32_t>(route.visits.size())});
        if (!node.passes(entry.port)) {  // a closed port does not receive frames
            route.knocks = loop_of(node.esc->dl_control(), entry.port) == Loop::auto_close;
            route.knocks_at = entry;
            return;
        }
        t += chip.ports[entry.port].delay;
        unsigned port = entry.port;
        bool through_closed_0 = false;
        Duration inside = chip.forwarding_delay;
        for (;;) {
            if (port == 0) {
                const bool marks = through_closed_0 && !node.link[0];
                if (marks && route.circulating_at == kNobody)
                    route.circulating_at = static_cast<std::uint32_t>(route.visits.size());
                else if (marks)
                    return;  // the frame was marked before, so it is destroyed
                const Duration before = entry.port == 0 ? Duration{0} : chip.forwarding_delay;
                route.visits.push_back({entry.slave, t + before, marks});
                inside = chip.processing_delay;
            }
            port = kNext[port];
            if (node.passes(port)) break;
            through_closed_0 = port == 0;
        }
        t += inside + chip.ports[port].delay;
        const auto& cable = node.cables[port];
        if (!node.link[port]) return;  // forced open without a link: the frame is lost
        t += cable.delay;
        if (cable.peer == Peer::master) {
            route.returns = true;
            route.exit_port = cable.to.slave;
            route.exit_offset = t;
            return;
        }
        entry = cable.to;
    }
}

// Copies the values that datagrams are compared with.
void Segment::note(Route& route, std::uint32_t visit) {
    auto& node = nodes_[route.visits[visit].slave];
    const auto& esc = *node.esc;
    node.configuration = esc.configuration();
    const auto irq_before = route.irq[visit];
    route.esc[visit] = node.esc.get();
    route.configuration[visit] = esc.configuration();
    route.station[visit] = esc.station();
    route.alias[visit] = esc.alias_enabled() ? esc.alias() : kNobody;
    route.logical_first[visit] = esc.logical_first();
    route.logical_last[visit] = esc.logical_last();
    route.irq[visit] = esc.irq();
    route.any_irq |= esc.irq();
    if (irq_before != 0 && esc.irq() == 0) {
        route.any_irq = 0;
        for (const auto irq : route.irq) route.any_irq = static_cast<std::uint16_t>(route.any_irq | irq);
    }
    route.aliases |= esc.alias_enabled();
}

}  // namespace margay::sim
