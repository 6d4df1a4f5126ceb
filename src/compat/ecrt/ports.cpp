// The ports in the result of ecrt_master_get_slave(): when the frames of the last scan arrived there, and how long a
// frame needs to the next slave with a clock.
#include "compat/ecrt/bus.hpp"

#include <margay/datagram.hpp>

#include <algorithm>

namespace margay::compat::ecrt {
namespace {

constexpr std::uint16_t kReceiveTimes = 0x0900;                     // ESC registers, 4 octets for each port
constexpr std::array<std::uint8_t, EC_MAX_PORTS> kWay{0, 3, 1, 2};  // a frame passes the ports in this order

bool is_timed(const Slave& slave) { return is_there(slave) && slave.dl.dc; }

// Calls visit(port, time since the frame has passed the open port before it) for the ports behind the entry port.
template <class Visit>
void pass_ports(const Slave& slave, const PortFacts& facts, Visit visit) {
    const std::uint8_t entry = slave.entry_port % EC_MAX_PORTS;
    const auto begin = static_cast<std::size_t>(std::ranges::find(kWay, entry) - kWay.begin());
    std::uint32_t last = facts.received[entry];
    for (std::size_t n = 1; n < kWay.size(); ++n) {
        const std::uint8_t port = kWay[(begin + n) % kWay.size()];
        if (!slave.ports[port].open) continue;
        visit(port, facts.received[port] - last);
        last = facts.received[port];
    }
}

// The slave at the port, 0: none.
std::uint16_t child_at(Context& ctx, const Slave& slave, std::uint8_t port) {
    for (const Slave& other : ctx.slaves())
        if (is_there(other) && other.parent == slave.number && other.parent_port == port) return other.number;
    return 0;
}

// The first slave with a clock on the way behind a port; 0: there is none, or the way branches before it.
std::uint16_t next_timed(Context& ctx, const Slave& slave, std::uint8_t port) {
    std::uint16_t number = child_at(ctx, slave, port);
    for (std::size_t steps = 0; number != 0 && !is_timed(ctx.slave(number)); ++steps) {
        if (steps > ctx.slaves().size()) return 0;
        std::uint16_t only = 0;
        for (const Slave& other : ctx.slaves()) {
            if (!is_there(other) || other.parent != number) continue;
            if (only != 0) return 0;
            only = other.number;
        }
        number = only;
    }
    return number;
}

std::uint32_t time_behind(const Slave& slave, const PortFacts& facts) {
    std::uint32_t sum = 0;
    pass_ports(slave, facts, [&](std::uint8_t, std::uint32_t time) { sum += time; });
    return sum;
}

}  // namespace

// All clocks latch the receive times of one frame. The clocks are not used meanwhile.
void Bus::measure_ports() {
    std::array<std::byte, sizeof(std::uint32_t)> latch{};
    std::vector<PortFacts> found(ctx->slaves().size() + 1);
    const bool latched = exchange_datagram(*ctx, DatagramCommand::bwr, 0, kReceiveTimes, latch).ok();
    for (const Slave& slave : ctx->slaves()) {
        std::array<std::byte, EC_MAX_PORTS * sizeof(std::uint32_t)> octets{};
        if (!latched || !is_timed(slave)) continue;
        const auto read =
            exchange_datagram(*ctx, DatagramCommand::fprd, slave.station_address.value, kReceiveTimes, octets);
        if (!read) break;  // no frame returns
        if (*read != 1) continue;
        for (std::size_t port = 0; port < EC_MAX_PORTS; ++port)
            found[slave.number].received[port] =
                EC_READ_U32(reinterpret_cast<const std::uint8_t*>(octets.data()) + port * sizeof(std::uint32_t));
        found[slave.number].identity = slave.identity;
    }
    // In a ring with two interfaces, the frames of both pass the ports.
    const bool one_way = source->second() == nullptr;
    for (const Slave& slave : ctx->slaves()) {
        if (!one_way || !is_timed(slave)) continue;
        pass_ports(slave, found[slave.number], [&](std::uint8_t port, std::uint32_t there_and_back) {
            const std::uint16_t next = next_timed(*ctx, slave, port);
            if (next == 0) return;
            const std::uint32_t behind = time_behind(ctx->slave(next), found[next]);
            if (there_and_back <= behind) return;
            const std::uint32_t delay = (there_and_back - behind) / 2;
            found[slave.number].delay[port] = delay;
            found[next].delay[ctx->slave(next).entry_port % EC_MAX_PORTS] = delay;
        });
    }
    const std::lock_guard lock(facts_mutex);
    ports = std::move(found);
}

}  // namespace margay::compat::ecrt
