#include "sim/segment.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

bool exists(const Esc& esc, unsigned port) {
    return port < kMaxPorts && esc.description().ports[port].kind >= wire::PortKind::ebus;
}

}  // namespace

std::uint32_t Segment::add(std::unique_ptr<Esc> esc) {
    nodes_.emplace_back();
    nodes_.back().esc = std::move(esc);
    for (auto& node : nodes_) node.esc->keep_next_event_in(nullptr);  // the places may move
    due_.push_back(kNever);
    keep_events();
    touched_.reserve(nodes_.size());
    topology_changed();
    return static_cast<std::uint32_t>(nodes_.size() - 1);
}

bool Segment::connect(PortRef a, PortRef b, Duration cable) {
    if (a == b || a.slave >= size() || b.slave >= size()) return false;
    if (!exists(slave(a.slave), a.port) || !exists(slave(b.slave), b.port)) return false;
    auto& from = nodes_[a.slave].cables[a.port];
    auto& to = nodes_[b.slave].cables[b.port];
    if (from.peer != Peer::nobody || to.peer != Peer::nobody) return false;
    from = {Peer::slave, b, cable, true};
    to = {Peer::slave, a, cable, true};
    topology_changed();
    if (nodes_[a.slave].powered || nodes_[b.slave].powered) update_all_ports();
    return true;
}

bool Segment::connect_master(PortRef to, unsigned master_port, Duration cable) {
    if (master_port >= kMasterPorts || to.slave >= size() || !exists(slave(to.slave), to.port)) return false;
    auto& end = nodes_[to.slave].cables[to.port];
    if (end.peer != Peer::nobody || masters_[master_port].peer != Peer::nobody) return false;
    end = {Peer::master, {master_port, 0}, cable, true};
    masters_[master_port] = {Peer::slave, to, cable, true};
    topology_changed();
    if (nodes_[to.slave].powered) update_all_ports();
    return true;
}

void Segment::disconnect(PortRef end) {
    auto& cable = nodes_[end.slave].cables[end.port];
    if (cable.peer == Peer::slave) nodes_[cable.to.slave].cables[cable.to.port] = {};
    if (cable.peer == Peer::master) masters_[cable.to.slave] = {};
    cable = {};
    topology_changed();
    update_all_ports();
}

void Segment::power_up(Time now) {
    for (auto& node : nodes_) {
        node.powered = true;
        node.esc->power_up(now);
    }
    keep_events();
    update_all_ports();
    next_event_ = kNever;
    for (std::uint32_t n = 0; n < size(); ++n) schedule(n);
}

void Segment::reconsider() {
    update_all_ports();
    for (std::uint32_t n = 0; n < size(); ++n) schedule(n);
}

void Segment::interrupt(std::uint32_t number, Time now) {
    slave(number).interrupt(now);
    schedule(number);
}

void Segment::set_power(std::uint32_t number, bool on, Time now) {
    auto& node = nodes_[number];
    if (node.powered == on) return;
    node.powered = on;
    node.open = {};
    if (on) node.esc->power_up(now);
    keep_events();
    update_all_ports();
    schedule(number);
}

void Segment::set_cable(PortRef end, bool intact) {
    auto& cable = nodes_[end.slave].cables[end.port];
    cable.intact = intact;
    if (cable.peer == Peer::slave) nodes_[cable.to.slave].cables[cable.to.port].intact = intact;
    if (cable.peer == Peer::master) masters_[cable.to.slave].intact = intact;
    update_all_ports();
}

void Segment::set_master_cable(unsigned master_port, bool intact) {
    const Cable& cable = masters_[master_port];
    if (cable.peer == Peer::slave) set_cable(cable.to, intact);
}

void Segment::set_noise(const Noise& noise) {
    noise_ = noise;
    random_ = noise.seed * 0x9E3779B97F4A7C15u + 1;
    noisy_ = noise.lost > 0 || noise.corrupted > 0;
}

bool Segment::master_link(unsigned master_port) const {
    const auto& cable = masters_[master_port];
    return cable.peer == Peer::slave && cable.intact && nodes_[cable.to.slave].powered;
}

std::vector<std::uint32_t> Segment::order(unsigned master_port) {
    std::vector<std::uint32_t> slaves;
    for (const auto& visit : route(master_port).visits) slaves.push_back(visit.slave);
    return slaves;
}

void Segment::schedule(std::uint32_t number) { next_event_ = std::min(next_event_, due_[number]); }

void Segment::keep_events() {
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        nodes_[n].esc->keep_next_event_in(nodes_[n].powered ? &due_[n] : nullptr);
        if (!nodes_[n].powered) due_[n] = kNever;
    }
}

void Segment::advance(Time now) {
    if (next_event_ > now) return;
    next_event_ = kNever;
    constexpr std::uint32_t kAhead = 1;  // number of slaves whose memory is prefetched before it is needed
    const auto count = static_cast<std::uint32_t>(size());
    for (std::uint32_t n = 0; n < count; ++n) {
        if (due_[n] <= now) {
            if (n + 3 * kAhead < count) nodes_[n + 3 * kAhead].esc->fetch_events();
            if (n + 2 * kAhead < count) nodes_[n + 2 * kAhead].esc->fetch_firmware();
            if (n + kAhead < count && due_[n + kAhead] <= now) nodes_[n + kAhead].esc->fetch_step();
            auto& node = nodes_[n];
            node.esc->advance(now);
            if (node.configuration != node.esc->configuration()) note_change(n);
        }
        next_event_ = std::min(next_event_, due_[n]);
    }
}

}  // namespace margay::sim
