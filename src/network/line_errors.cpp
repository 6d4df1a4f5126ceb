#include "network/line_errors.hpp"

#include <algorithm>
#include <type_traits>
#include <utility>

namespace margay {

struct LineErrorsAccess {
    using CableEnd = LineErrors::CableEnd;
    static auto& last(LineErrors& errors) { return errors.last_; }
    static auto& other_ends(LineErrors& errors) { return errors.other_ends_; }
    static bool& primed(LineErrors& errors) { return errors.primed_; }
};

namespace {

namespace reg = wire::reg;

constexpr std::size_t kOctets = reg::kLostLinkCounter.end() - reg::kRxErrorCounter.address;
static_assert(
    kOctets ==
    std::tuple_size_v<std::remove_reference_t<decltype(LineErrorsAccess::last(std::declval<LineErrors&>()))>>);
constexpr std::size_t kForwarded = reg::kForwardedRxErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kProcessing = reg::kProcessingUnitErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kPdi = reg::kPdiErrorCounter.address - reg::kRxErrorCounter.address;
constexpr std::size_t kLostLink = reg::kLostLinkCounter.address - reg::kRxErrorCounter.address;
constexpr std::uint8_t kClearAt = 0x80;

using CableEnd = LineErrorsAccess::CableEnd;

// The port at the other end of the cable.
CableEnd other_end(Network& network, const Slave& slave, std::uint8_t port) {
    const std::uint16_t neighbour = slave.ports[port].neighbour;
    if (neighbour == 0) return {};
    if (port == slave.entry_port) return {neighbour, slave.parent_port, 0};
    return {neighbour, network.slave(neighbour).entry_port, 0};
}

// An event for the cable at a port. The event names the end that is nearer to the master first. `other`: the slave at
// the other end; 0: it is not known.
Event cable_event(const Slave& slave, std::uint8_t port, std::uint16_t other, EventKind kind, std::uint32_t count) {
    Event event{.kind = kind, .port = port, .slave = slave.number, .other = other, .actual = count};
    if (port != slave.entry_port || other != slave.parent) return event;
    event.slave = slave.parent;
    event.port = slave.parent_port;
    event.other = slave.number;
    return event;
}

// Both ends of a cable count an interruption, and not at the same time if a slave was away. Returns the interruptions
// that the other end has not counted before.
std::uint8_t first_counted(std::span<LineErrors> all, CableEnd& end, std::uint8_t lost) {
    const std::uint8_t known = std::min(end.reported, lost);
    const auto first = static_cast<std::uint8_t>(lost - known);
    end.reported = static_cast<std::uint8_t>(end.reported - known);
    if (end.slave == 0 || end.slave > all.size()) return first;
    std::uint8_t& there = LineErrorsAccess::other_ends(all[end.slave - 1U])[end.port].reported;
    there = static_cast<std::uint8_t>(std::min(there + first, 255));
    return first;
}

void count_port(Network& network, const Slave& slave, std::uint8_t port, const std::array<std::uint8_t, kOctets>& more,
                std::span<LineErrors> all) {
    LineErrors& here = all[slave.number - 1U];
    PortErrors& sums = here.ports[port];
    const std::uint8_t invalid = more[2U * port];
    const std::uint8_t lost = more[kLostLink + port];
    sums.invalid_frames += invalid;
    sums.rx_errors += more[2U * port + 1];
    sums.forwarded += more[kForwarded + port];
    sums.lost_links += lost;
    // The counts were made before the wiring was changed. So an interrupted link is compared with the neighbour before
    // the change.
    CableEnd& end = LineErrorsAccess::other_ends(here)[port];
    const std::uint16_t before = end.slave;
    const std::uint8_t first = first_counted(all, end, lost);
    const CableEnd now = other_end(network, slave, port);
    end.slave = now.slave;
    end.port = now.port;
    const std::uint16_t damaged_by = before == now.slave ? before : std::uint16_t{0};
    if (invalid > 0) network.report(cable_event(slave, port, damaged_by, EventKind::line_errors, invalid));
    if (first > 0) network.report(cable_event(slave, port, before, EventKind::link_lost, first));
}

bool high(LineErrors& sums) {
    return std::ranges::any_of(LineErrorsAccess::last(sums), [](std::uint8_t n) { return n >= kClearAt; });
}

using Counters = std::array<std::byte, kOctets>;

// Reads and clears the counters in one frame, so that no error is lost between reading and clearing. A lost frame is
// not sent again, because cleared values cannot be read again.
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

Task<Result<>> read_line_errors(Network& network, Slave& slave, std::span<LineErrors> all) {
    LineErrors& sums = all[slave.number - 1U];
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
    auto& last = LineErrorsAccess::last(sums);
    bool& primed = LineErrorsAccess::primed(sums);
    std::array<std::uint8_t, kOctets> more{};
    for (std::size_t n = 0; n < kOctets; ++n) {
        const auto now = std::to_integer<std::uint8_t>(octets[n]);
        // A counter below its last value was cleared meanwhile, by a loss of power or by another master.
        if (primed) more[n] = static_cast<std::uint8_t>(now >= last[n] ? now - last[n] : now);
        last[n] = cleared ? std::uint8_t{0} : now;
    }
    primed = true;
    for (std::uint8_t port = 0; port < sums.ports.size(); ++port) count_port(network, slave, port, more, all);
    sums.processing_unit += more[kProcessing];
    sums.pdi += more[kPdi];
    co_return Nothing{};
}

}  // namespace

void begin_line_errors(std::span<LineErrors> sums) {
    for (LineErrors& errors : sums) {
        LineErrorsAccess::primed(errors) = false;
        LineErrorsAccess::other_ends(errors) = {};
    }
}

Task<Result<>> read_all_line_errors(Network& network, std::span<LineErrors> sums) {
    Crew crew(network.tasks);
    for (Slave& slave : network.slaves()) {
        if (slave.number > sums.size() || slave.al.state == AlState::none) continue;
        while (crew.full()) co_await crew.one();
        if (!crew.start(read_line_errors(network, slave, sums)) && crew.running() > 0) co_await crew.one();
    }
    co_await crew.all();
    co_return Nothing{};
}

}  // namespace margay
