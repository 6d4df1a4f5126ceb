// The receive times of the slaves, and the ways of the frames through the segment, for the propagation delays of the
// clocks. In a ring with two NICs that is broken, the frames of the second NIC enter the slaves behind the break at the
// other end, pass them to the break without being processed, and are processed on their way back: in the same order as
// in the whole ring.
#include "clock/frame_ways.hpp"
#include "network/clocks.hpp"
#include "network/network.hpp"
#include "station/register_access.hpp"

#include <algorithm>
#include <bit>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr Step kLatchStep = Step::configure_clocks;

// How much longer the way through the processing unit takes, by the type of the chip (register 0x0000). Recordings of
// E-bus terminals show 20 ns for ET1100 and ET1200 (test/clock/delays_test.cpp); for other chips nothing is recorded.
constexpr std::uint16_t processing_ns_of(const Slave& slave) {
    const std::int16_t set = slave.config.dc().processing_ns;
    if (set >= 0) return static_cast<std::uint16_t>(set);
    const bool is_et = slave.dl.type == 0x11 || slave.dl.type == 0x12;
    return is_et ? 20 : 40;
}

// The index of the first place behind the break; without a break, the number of places.
std::size_t second_part(Network& network, std::size_t places) {
    const RingParts parts = network.ring_parts();
    return parts.two_nics && !parts.whole ? std::min(parts.front, places) : places;
}

// The open port without a neighbour, to which the second NIC is connected; if there is none, the entry port.
std::uint8_t outer_port(const RingPlace& place) {
    for (std::uint8_t port = 0; port < 4; ++port)
        if (place.ports[port].open && place.ports[port].neighbour == 0 && port != place.entry_port) return port;
    return place.entry_port;
}

// Reverses the way between the break and the second NIC: it begins at the last slave, not at the first slave behind the
// break.
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

// The first node from `from` on that has receive times; nullptr: none.
const DelayNode* first_timed(std::span<const DelayNode> nodes, std::size_t from) {
    for (std::size_t n = from; n < nodes.size(); ++n)
        if (nodes[n].timed()) return &nodes[n];
    return nullptr;
}

// While the cable is broken, the delay between the slaves at both sides of the break is not known. Until the ring is
// whole, the library assumes a cable of 10 m. The clocks behind the break do not depend on this delay, because they
// follow the first clock behind the break.
constexpr std::int64_t kUnknownCable_ns = 500;

// A slave with branches and without receive times.
bool is_unmeasured_junction(const DelayNode& node) { return !node.timed() && std::popcount(node.neighbours) > 1; }

// The place of the first such slave on the way from `node` to `reference`; 0: the delay between both nodes is measured.
std::size_t junction_between(std::span<const DelayNode> nodes, const DelayNode& reference, const DelayNode& node) {
    if (node.assumed == reference.assumed) return 0;
    std::size_t at = nodes[(node.assumed != 0 ? node.assumed : reference.assumed) - 1U].parent;
    for (std::size_t steps = 0; at != 0 && at <= nodes.size() && steps < nodes.size(); ++steps) {
        if (is_unmeasured_junction(nodes[at - 1])) return at;
        at = nodes[at - 1].parent;
    }
    return 0;
}

// Sets SlaveClock::delay_assumed. Reports each junction with a clock whose delay was not assumed before.
void note_assumed_delays(Network& network, std::span<const DelayNode> nodes, const DelayNode& reference) {
    const auto ring = network.seen_ring();
    const auto clock_at = [&](std::size_t n) -> ClockEntry* {
        if (ring[n].slave == 0 || !nodes[n].timed()) return nullptr;
        ClockEntry& clock = network.clocks.entries[ring[n].slave - 1U];
        return is_clock(clock.kind) ? &clock : nullptr;
    };
    for (std::size_t place = 1; place <= nodes.size(); ++place) {
        if (ring[place - 1].slave == 0 || !is_unmeasured_junction(nodes[place - 1])) continue;
        Event assumed{.kind = EventKind::delays_assumed, .slave = ring[place - 1].slave};
        bool is_news = false;
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            const ClockEntry* const clock = clock_at(n);
            if (clock == nullptr || junction_between(nodes, reference, nodes[n]) != place) continue;
            if (++assumed.actual == 1) assumed.detail = nodes[n].above == 0 ? 1 : 0;
            is_news |= !clock->delay_assumed;
        }
        if (is_news) network.report(assumed);
    }
    for (std::size_t n = 0; n < nodes.size(); ++n)
        if (ClockEntry* const clock = clock_at(n); clock != nullptr)
            clock->delay_assumed = junction_between(nodes, reference, nodes[n]) != 0;
}

constexpr std::int64_t kLongest_ps = 100'000'000'000;  // 100 ms: longer than a frame through 65 535 slaves

// A port that the last frame has not passed.
bool is_old(const PortTimes& times, std::uint8_t port) {
    return times.differ(port) || times.port_ps(port) > kLongest_ps || times.port_ps(port) < -kLongest_ps;
}

// The time from the first arrival of the frame at the slave to its last arrival.
std::int64_t away_ps_of(const RingPlace& place, const PortTimes& times) {
    std::int64_t last = 0;
    for (std::uint8_t port = 0; port < 4; ++port)
        if (place.ports[port].open && !is_old(times, port)) last = std::max(last, times.port_ps(port));
    return last;
}

// With one NIC, the frames may enter slaves at other ports than 0, and pass some of the slaves behind such a slave
// before its processing unit. In the ring, these slaves come before that slave.
void find_entered_ways(Network& network, std::span<DelayNode> nodes) {
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    bool as_expected = true;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const RingPlace& place = ring[n];
        DelayNode& node = nodes[n];
        node.arrival_ps = -1;
        for (std::uint8_t port = 0; port < 4; ++port)
            if (place.ports[port].open) node.open |= static_cast<std::uint8_t>(1U << port);
        if (place.slave == 0) continue;
        const ClockEntry& clock = clocks.entries[place.slave - 1U];
        if (place.ports[clock.entered_port].open) node.entry_port = clock.entered_port;
        if (node.timed()) node.arrival_ps = away_ps_of(place, *node.times);
        if (!node.timed() && clock.measured) node.arrival_ps = std::int64_t{clock.away_ns} * 1000;
        as_expected &= node.entry_port == 0 || node.open == 1U << node.entry_port;
    }
    clocks.ways_unknown = !as_expected && !find_ways(nodes);
}

}  // namespace

void find_entry_ports(Network& network) {
    if (network.redundancy != nullptr) return;
    for (const RingPlace& place : network.seen_ring()) {
        if (place.slave == 0) continue;
        ClockEntry& clock = network.clocks.entries[place.slave - 1U];
        if (clock.times.count() == 0) continue;
        std::uint8_t first = clock.arrival_port;
        for (std::uint8_t port = 0; port < 4; ++port)
            if (place.ports[port].open && !is_old(clock.times, port) &&
                clock.times.port_ps(port) < clock.times.port_ps(first))
                first = port;
        clock.entered_port = first;
        clock.times.begin_at(first);
        clock.away_ns = static_cast<std::int32_t>(away_ps_of(place, clock.times) / 1000);
    }
}

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
    if (network.redundancy == nullptr) find_entered_ways(network, nodes);
    find_neighbours(network, nodes);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (ring[n].slave == 0) continue;
        ClockEntry& clock = clocks.entries[ring[n].slave - 1U];
        clock.arrival_port = nodes[n].entry_port;
        clock.passing_port = port_before_unit(nodes[n]);
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
    // A delay register cannot be negative. So all delays are measured from the first clock in the ring, which becomes
    // the reference again as soon as it is ready.
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
    note_assumed_delays(network, nodes, nodes[reference - 1]);
}

// Where frames enter slaves at ports other than 0, the DL status does not show which slave is behind which.
void correct_topology(Network& network) {
    const auto ring = network.seen_ring();
    const auto nodes = network.clocks.nodes.first(std::min(network.clocks.nodes.size(), ring.size()));
    const auto is_unknown = [](const RingPlace& place) { return place.slave == 0; };
    if (network.redundancy != nullptr || network.clocks.ways_unknown || std::ranges::any_of(ring, is_unknown)) return;
    bool differs = false;
    for (std::size_t n = 0; n < nodes.size(); ++n)
        differs |= nodes[n].parent != ring[n].parent || nodes[n].parent_port != ring[n].parent_port ||
                   nodes[n].entry_port != ring[n].entry_port;
    if (!differs || nodes.size() < ring.size()) return;
    for (const RingPlace& place : ring)
        for (Port& port : network.slave(place.slave).ports)
            if (port.open) port.neighbour = 0;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const DelayNode& node = nodes[n];
        Slave& slave = network.slave(ring[n].slave);
        slave.parent = node.parent == 0 ? std::uint16_t{0} : ring[node.parent - 1U].slave;
        slave.parent_port = node.parent_port;
        slave.entry_port = node.entry_port;
        slave.ports[node.entry_port & 3].neighbour = slave.parent;
        if (slave.parent != 0) network.slave(slave.parent).ports[node.parent_port & 3].neighbour = slave.number;
    }
}

// Looks for receive times that contradict the ways of the frames. A port that the last frame has not passed shows an
// old time: the slaves behind this port were lost, and their loss is not known yet.
Error check_receive_times(Network& network) {
    const auto ring = network.seen_ring();
    const auto nodes = network.clocks.nodes.first(find_frame_ways(network));
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const DelayNode& node = nodes[n];
        if (ring[n].slave == 0 || !node.timed()) continue;
        Error error{.step = Step::configure_clocks, .slave = ring[n].slave};
        // The times are counted from the arrival at another port: the places were read anew since, after a change.
        if (node.times->port_ps(node.entry_port) != 0) error.code = Errc::unstable;
        for (std::uint8_t port = 0; port < 4; ++port) {
            const bool neighbour = port != node.entry_port && (node.neighbours >> port & 1) != 0;
            if (!neighbour) continue;
            if (is_old(*node.times, port)) error.code = Errc::unstable;
            if (error.code != Errc::none || node.times->port_ps(port) >= 0) continue;
            error.code = Errc::unsupported;
            error.actual = port;
        }
        if (network.clocks.ways_unknown && node.entry_port != 0) {
            error.code = Errc::unsupported;
            error.actual = node.entry_port;
        }
        if (error.code != Errc::none) return error;
    }
    return {};
}

bool find_old_delays(Network& network) {
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    const bool any_followed = network.slave(clocks.reference).al.state != AlState::none;
    // The change of the sum ClockEntry::way before a slave since the delay was measured.
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

// How many slaves should answer a broadcast to the register of the receive times, and to any register.
struct Answers {
    std::uint16_t timed = 0;
    std::uint16_t known = 0;
    std::uint16_t most = 0;  // with the slaves that are not expected
};

static Answers answers_of_ring(Network& network) {
    Answers answers;
    for (const RingPlace& place : network.seen_ring()) {
        const bool known = place.slave != 0;
        if (known && network.slave(place.slave).al.state == AlState::none) continue;
        ++answers.most;
        if (known) ++answers.known;
        if (known && network.clocks.entries[place.slave - 1U].kind >= ClockKind::receive_times) ++answers.timed;
    }
    return answers;
}

// The first slave that should be there, and does not answer; 0: none.
static Task<Result<std::uint16_t>> find_silent(Network& network) {
    for (const RingPlace& place : network.seen_ring()) {
        if (place.slave == 0 || network.slave(place.slave).al.state == AlState::none) continue;
        const Station station = network.station(network.slave(place.slave));
        const auto type = co_await read<std::uint8_t>(station, reg::kType, kLatchStep);
        if (does_not_answer(type.error())) co_return place.slave;
    }
    co_return std::uint16_t{0};
}

// A slave that the frame has not reached keeps older receive times. So the frame is repeated until all slaves have
// latched it. If more slaves answer than are known, the frames take other ways than in the ring that was read last.
Task<Result<>> latch_receive_times(Network& network) {
    constexpr unsigned kMostTries = 5;
    Error missed{.code = Errc::unstable, .step = kLatchStep};
    for (unsigned n = 0; n < kMostTries; ++n) {
        std::array<std::byte, 4> any{};
        std::array<std::byte, 1> type{};
        TimedDatagram latch(network.engine.link(), wire::Command::BWR,
                            {std::uint16_t{0}, reg::kPortReceiveTime.address}, MutableBytes(any));
        Datagram count(network.engine.link(), wire::Command::BRD, {std::uint16_t{0}, reg::kType.address},
                       MutableBytes(type));  // each slave has it
        co_await together(latch, count);
        network.clocks.latched_at = latch.sent_at();
        for (const Datagram* d : std::initializer_list<const Datagram*>{&latch, &count})
            if (!d->reply().ok()) co_return Error{.code = d->reply().errc, .step = kLatchStep};
        const Answers wanted = answers_of_ring(network);
        network.clocks.unknown_latched = count.reply().wkc > wanted.most;
        if (latch.reply().wkc >= wanted.timed && count.reply().wkc >= wanted.known) co_return Nothing{};
        const bool few = count.reply().wkc < wanted.known;
        missed.expected = few ? wanted.known : wanted.timed;
        missed.actual = few ? count.reply().wkc : latch.reply().wkc;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    missed.slave = co_await required(find_silent(network));
    co_return missed;
}

Task<Result<>> read_receive_times(Network& network, Slave& slave, Keep keep) {
    const Station station = network.station(slave);
    ClockEntry& clock = network.clocks.of(slave);
    std::array<std::byte, reg::kPortReceiveTime.length> ports{};
    std::array<std::byte, reg::kProcessingUnitReceiveTime.length> unit{};
    Link& link = network.engine.link();
    Datagram read_ports(link, wire::Command::FPRD, {station.address, reg::kPortReceiveTime.address},
                        MutableBytes(ports));
    Datagram read_unit(link, wire::Command::FPRD, {station.address, reg::kProcessingUnitReceiveTime.address},
                       MutableBytes(unit));
    co_await together(read_ports, read_unit);
    const Error error = error_of_reply(station, read_ports.reply(), kLatchStep, reg::kPortReceiveTime.address);
    if (error.code != Errc::none) co_return error;
    ReceiveTimes latched;
    for (unsigned p = 0; p < 4; ++p) latched.port_ns[p] = load_le<std::uint32_t>(ports, 4 * p);
    latched.has_processing = read_unit.reply().ok() && read_unit.reply().wkc == 1;
    latched.processing_ns = load_le<std::uint32_t>(unit);
    clock.local_ns = latched.has_processing ? load_le<std::uint64_t>(unit) : latched.port_ns[clock.passing_port & 3];
    if (keep == Keep::yes && !clock.times.full()) clock.times.add(latched, clock.arrival_port);
    co_return Nothing{};
}

}  // namespace margay
