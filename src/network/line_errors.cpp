#include "network/line_errors.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr std::size_t kOctets = reg::kLostLinkCounter.end() - reg::kRxErrorCounter.address;
static_assert(kOctets == std::tuple_size_v<decltype(LineErrors::last)>);
constexpr std::size_t kForwarded = reg::kForwardedRxErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kProcessing = reg::kProcessingUnitErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kPdi = reg::kPdiErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kLostLink = reg::kLostLinkCounter.address - reg::kRxErrorCounter.address;
constexpr std::uint8_t kClearAt = 0x80;

// An event for the cable at a port, seen from the master: the slave and port where the cable starts, and the slave at
// its other end.
Event cable_event(const Slave& slave, std::uint8_t port, EventKind kind, std::uint32_t count) {
    Event event{.kind = kind, .port = port, .slave = slave.number, .actual = count};
    event.other = slave.ports[port].neighbour;
    if (port == slave.entry_port) {
        event.slave = slave.parent;
        event.port = slave.parent_port;
        event.other = slave.number;
    }
    return event;
}

void count_port(Network& network, const Slave& slave, std::uint8_t port, const std::array<std::uint8_t, kOctets>& more,
                PortErrors& sums) {
    const std::uint8_t invalid = more[2U * port];
    const std::uint8_t lost = more[kLostLink + port];
    sums.invalid_frames += invalid;
    sums.rx_errors += more[2U * port + 1];
    sums.forwarded += more[kForwarded + port];
    sums.lost_links += lost;
    if (invalid > 0) network.report(cable_event(slave, port, EventKind::line_errors, invalid));
    if (lost > 0) network.report(cable_event(slave, port, EventKind::link_lost, lost));
}

bool high(const LineErrors& sums) {
    return std::ranges::any_of(sums.last, [](std::uint8_t n) { return n >= kClearAt; });
}

using Counters = std::array<std::byte, kOctets>;

// Reads and clears the counters in one frame, so that no error in between is lost. Not repeated: cleared values cannot
// be read again.
Task<Result<>> read_and_clear(Network& network, Slave& slave, Counters& octets) {
    static constexpr Counters kZeros{};
    Link& link = network.engine.link();
    const auto at = [&](wire::Register r) { return wire::DatagramAddress(slave.station_address, r.address); };
    Datagram look(link, wire::Command::FPRD, at(reg::kRxErrorCounter), MutableBytes(octets), Repeat::no);
    Datagram errors(link, wire::Command::FPWR, at(reg::kRxErrorCounter), Bytes(kZeros).first(kPdi + 1), Repeat::no);
    Datagram links(link, wire::Command::FPWR, at(reg::kLostLinkCounter),
                   Bytes(kZeros).first(reg::kLostLinkCounter.length), Repeat::no);
    co_await together(look, errors, links);
    const Error error =
        error_of_reply(network.station(slave), look.reply(), Step::read_dl_information, reg::kRxErrorCounter.address);
    co_return error.code == Errc::none ? Result<>() : Result<>(error);
}

Task<Result<>> read_line_errors(Network& network, Slave& slave, LineErrors& sums) {
    Counters octets{};
    if (high(sums)) {
        auto cleared = co_await read_and_clear(network, slave, octets);
        if (!cleared) cleared = co_await read_and_clear(network, slave, octets);
        if (!cleared) co_return Nothing{};
    } else {
        Datagram look(network.engine.link(), wire::Command::FPRD, {slave.station_address, reg::kRxErrorCounter.address},
                      MutableBytes(octets));
        auto reply = co_await look;
        if (!reply.ok() || reply.wkc != 1) co_return Nothing{};
    }
    const bool cleared = high(sums);
    std::array<std::uint8_t, kOctets> more{};
    for (std::size_t n = 0; n < kOctets; ++n) {
        const auto now = std::to_integer<std::uint8_t>(octets[n]);
        // A counter below its last value was cleared meanwhile, by a loss of power or by another master.
        if (sums.primed) more[n] = static_cast<std::uint8_t>(now >= sums.last[n] ? now - sums.last[n] : now);
        sums.last[n] = cleared ? std::uint8_t{0} : now;
    }
    sums.primed = true;
    for (std::uint8_t port = 0; port < sums.ports.size(); ++port)
        count_port(network, slave, port, more, sums.ports[port]);
    sums.processing_unit += more[kProcessing];
    sums.pdi += more[kPdi];
    co_return Nothing{};
}

}  // namespace

Task<Result<>> read_all_line_errors(Network& network, std::span<LineErrors> sums) {
    Crew crew(network.tasks);
    for (Slave& slave : network.slaves()) {
        if (slave.number > sums.size() || slave.al.state == AlState::none) continue;
        while (crew.full()) co_await crew.one();
        if (!crew.start(read_line_errors(network, slave, sums[slave.number - 1U])) && crew.running() > 0)
            co_await crew.one();
    }
    co_await crew.all();
    co_return Nothing{};
}

}  // namespace margay
