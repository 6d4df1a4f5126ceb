#include "network/topology.hpp"

#include "wire/esc.hpp"

namespace margay {
namespace {

// The port by which a frame leaves after it came in by another one.
constexpr std::uint8_t next_port(std::uint8_t port) {
    constexpr std::uint8_t kNext[4] = {3, 2, 0, 1};  // 0 → 3 → 1 → 2 → 0
    return kNext[port & 3];
}

void read_ports(Slave& slave) {
    for (unsigned p = 0; p < 4; ++p) {
        slave.ports[p].link = (slave.dl_status & wire::dl_status::physical_link(p)) != 0;
        slave.ports[p].open = (slave.dl_status & wire::dl_status::loop_closed(p)) == 0 &&
                              (slave.dl_status & wire::dl_status::communication(p)) != 0;
        slave.ports[p].neighbour = 0;
    }
    // Frames come in by port 0 unless nothing is plugged in there.
    slave.entry_port = 0;
    while (!slave.ports[slave.entry_port].open && next_port(slave.entry_port) != 0)
        slave.entry_port = next_port(slave.entry_port);
    slave.parent = 0;
    slave.parent_port = 0;
}

// The first open port of `slave` behind its entry that nobody hangs at yet, or the entry port when there is
// none.
std::uint8_t free_port(const Slave& slave) {
    std::uint8_t port = next_port(slave.entry_port);
    while (port != slave.entry_port && !(slave.ports[port].open && slave.ports[port].neighbour == 0))
        port = next_port(port);
    return port;
}

Error topology_error(const Slave& slave, std::uint16_t port) {
    return {.code = Errc::unstable, .step = Step::topology, .slave = slave.position, .index = port};
}

}  // namespace

Result<> find_topology(std::span<Slave> slaves) {
    Error error;
    for (Slave& slave : slaves) read_ports(slave);
    for (std::size_t i = 1; i < slaves.size(); ++i) {
        // The frame comes from the last slave passed that still has a way out: the one before, or its parents
        // upwards.
        Slave* parent = &slaves[i - 1];
        while (free_port(*parent) == parent->entry_port && parent->parent != 0)
            parent = &slaves[parent->parent - 1U];
        const std::uint8_t port = free_port(*parent);
        if (port == parent->entry_port) {
            if (error.code == Errc::none) error = topology_error(slaves[i], 0);
            parent = &slaves[i - 1];
        }
        slaves[i].parent = parent->position;
        slaves[i].parent_port = port;
        slaves[i].ports[slaves[i].entry_port].neighbour = parent->position;
        if (port != parent->entry_port) parent->ports[port].neighbour = slaves[i].position;
    }
    for (const Slave& slave : slaves) {
        const std::uint8_t port = free_port(slave);
        if (port != slave.entry_port && error.code == Errc::none) error = topology_error(slave, port);
    }
    return error.code == Errc::none ? Result<>() : Result<>(error);
}

}  // namespace margay
