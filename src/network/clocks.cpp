#include "network/clocks.hpp"

#include "clock/system_time.hpp"
#include "network/network.hpp"
#include "util/scoped_flag.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
using wire::Command;
using wire::DatagramAddress;

constexpr Step kClockStep = Step::configure_clocks;
constexpr std::uint16_t kSpeedCounterDefault = 0x1000;

constexpr DatagramAddress broadcast(wire::Register r) { return {std::uint16_t{0}, r.address}; }

// Switches the SYNC signals of all slaves off, and starts the control loops of all clocks again.
Task<Result<>> reset_clocks(Network& network) {
    static constexpr std::array<std::byte, 1> kOff{};
    std::array<std::byte, 2> start{};
    store_le<std::uint16_t>(start, 0, kSpeedCounterDefault);
    Datagram off(network.engine.link(), Command::BWR, broadcast(reg::kSyncActivation), Bytes(kOff));
    Datagram loops(network.engine.link(), Command::BWR, broadcast(reg::kSpeedCounterStart), Bytes(start));
    co_await together(off, loops);
    for (const Datagram* d : {&off, &loops})
        if (!d->reply().ok()) co_return Error{.code = d->reply().errc, .step = kClockStep};
    co_return Nothing{};
}

Task<Result<>> probe_if_there(Network& network, Slave& slave, Error& first) {
    network.clocks.of(slave).reset();
    if (slave.al.state == AlState::none || slave.ring_position == 0) co_return Nothing{};
    auto probed = co_await probe_clock(network, slave);
    if (!probed && first.code == Errc::none) first = probed.error();
    co_return Nothing{};
}

Task<Result<>> read_times_if_any(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    if (clock.kind < ClockKind::receive_times || slave.al.state == AlState::none) co_return Nothing{};
    co_return co_await required(read_receive_times(network, slave, Keep::yes));
}

// The reference that the settings choose; 0 and an error if there is none.
Result<std::uint16_t> choose_reference(Network& network, std::uint16_t wanted) {
    Error error{.code = Errc::no_clock, .step = kClockStep, .slave = wanted};
    if (wanted != 0) {
        if (wanted <= network.count && network.slave(wanted).al.state == AlState::none)
            error.code = Errc::missing_slave;
        if (wanted > network.count || !is_clock(network.clocks.entries[wanted - 1U].kind)) return error;
        return wanted;
    }
    for (const RingPlace& place : network.seen_ring())
        if (place.slave != 0 && is_clock(network.clocks.entries[place.slave - 1U].kind)) return place.slave;
    return error;
}

// One measurement: all slaves latch their receive times, then the receive times of all slaves are read.
Task<Result<>> measure_once(Network& network) {
    co_await required(latch_receive_times(network));
    if (network.clocks.unknown_latched) co_return Error{.code = Errc::unstable, .step = kClockStep};
    Error first;
    const auto read = [&network](Slave& s) { return read_times_if_any(network, s); };
    co_await required(for_each_slave(network, read, &first));
    if (first.code != Errc::none) co_return first;
    co_return Nothing{};
}

// A slave that was lost, or came back, between two measurements: the receive times of its neighbours belong to
// different ways of the frame.
Error changed_meanwhile(Network& network) {
    for (const Slave& slave : network.slaves()) {
        const ClockEntry& clock = network.clocks.of(slave);
        const bool there = clock.kind >= ClockKind::receive_times && slave.al.state != AlState::none;
        if (clock.times.count() == (there ? network.clocks.settings.measurements : 0)) continue;
        return {.code = Errc::unstable, .step = kClockStep, .slave = slave.number};
    }
    return {};
}

// While the receive times are measured: a ring with two NICs is open behind its last slave.
class OpenRing {
  public:
    explicit OpenRing(RedundancyPart* ring) : ring_(ring) {}
    OpenRing(const OpenRing&) = delete;
    OpenRing& operator=(const OpenRing&) = delete;
    ~OpenRing() {
        if (ring_ != nullptr) ring_->forget_opening();
    }

  private:
    RedundancyPart* ring_;
};

Task<Result<>> measure_all(Network& network) {
    for (std::uint8_t n = 0; n < network.clocks.settings.measurements; ++n) {
        co_await required(measure_once(network));
    }
    co_return Nothing{};
}

Task<Result<>> measure(Network& network) {
    const ScopedFlag measuring(network.clocks.measuring);
    const OpenRing open(network.redundancy);
    for (ClockEntry& clock : network.clocks.entries.first(network.count)) clock.times.clear();
    if (network.redundancy != nullptr) {
        co_await required(network.redundancy->open_ring(network));
    }
    (void)find_frame_ways(network);
    Result<> measured = co_await measure_all(network);
    if (network.redundancy != nullptr) {
        const auto closed = co_await network.redundancy->close_ring(network);
        if (measured) measured = closed;
    }
    if (!measured) co_return measured;
    find_entry_ports(network);
    Error changed = changed_meanwhile(network);
    if (changed.code == Errc::none) changed = check_receive_times(network);
    if (changed.code != Errc::none) co_return changed;
    compute_clock_delays(network);
    correct_topology(network);
    if (network.redundancy != nullptr) network.redundancy->note_ways(network);
    co_return Nothing{};
}

// Whether the break of the ring is at another place than `before`.
bool ring_has_changed(Network& network, const RingParts& before) {
    const RingParts now = network.ring_parts();
    return now.whole != before.whole || now.front != before.front;
}

// The offsets of all clocks from the last measurement.
void compute_offsets(Network& network) {
    Clocks& clocks = network.clocks;
    clocks.system_at = clocks.latched_at;
    clocks.system_ns = static_cast<std::uint64_t>((clocks.system_at - Time{}).count()) +
                       static_cast<std::uint64_t>(clocks.settings.system_time_at_zero.count());
    for (ClockEntry& clock : clocks.entries.first(network.count)) {
        clock.synchronised = is_clock(clock.kind) && !clock.out_of_reach;
        if (!is_clock(clock.kind)) continue;
        // Behind a break, another copy of the frame was latched. Both were sent at the same time.
        clock.offset_ns = clock_offset_ns(clocks.system_ns, clock.passed_ns, clock.local_ns);
    }
}

// A clock that is out of reach gets the right time once, too, because its register compares it with times that the
// master has sent.
Task<Result<>> write_clock_if_any(Network& network, Slave& slave) {
    if (!is_clock(network.clocks.of(slave).kind)) co_return Nothing{};
    co_return co_await required(write_clock(network, slave));
}

Task<Result<>> write_delay_if_any(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    if (!clock.synchronised || slave.al.state == AlState::none) co_return Nothing{};
    co_return co_await required(write_clock_register(network.station(slave), reg::kSystemTimeDelay, clock.delay_ns));
}

Task<Result<>> read_difference_if_any(Network& network, Slave& slave) {
    if (!network.clocks.of(slave).synchronised || slave.al.state == AlState::none) co_return Nothing{};
    co_return co_await required(read_difference(network, slave));
}

// Reads the differences of all slaves. Error unstable: a slave does not answer, so it was lost meanwhile.
Task<Result<>> read_differences(Network& network) {
    Error first;
    const auto read = [&network](Slave& s) { return read_difference_if_any(network, s); };
    co_await required(for_each_slave(network, read, &first));
    if (does_not_answer(first)) first = {.code = Errc::unstable, .step = kClockStep, .slave = first.slave};
    co_return first;
}

Task<Result<std::uint32_t>> read_each_difference(Network& network) {
    auto read = co_await read_differences(network);  // a slave that does not answer keeps its old difference
    if (!read && read.error().code == Errc::capacity) co_return read.error();
    std::uint32_t most = 0;
    for (const Slave& slave : network.slaves()) {
        const ClockEntry& clock = network.clocks.of(slave);
        const std::int64_t away = std::abs(std::int64_t{clock.difference_ns});
        if (clock.synchronised && slave.al.state != AlState::none)
            most = std::max(most, static_cast<std::uint32_t>(away));
    }
    co_return most;
}

// Sends many frames with the time, several of them on the wire at the same time. In a running cycle they wait for free
// space in its frames. So the time of the burst is limited.
Task<Result<>> send_burst(Network& network) {
    constexpr Duration kLongest = std::chrono::seconds(2);
    const ClockSettings& settings = network.clocks.settings;
    const Time give_up = later(network.engine.now(), kLongest);
    Crew crew(settings.burst_bulk);
    for (std::uint16_t n = 0; n < settings.burst_frames && network.engine.now() < give_up; ++n) {
        while (crew.full()) co_await crew.one();
        while (!crew.start(send_time(network))) {
            if (crew.running() == 0)
                co_return Error{.code = Errc::capacity, .step = kClockStep, .detail = Error::kTasks};
            co_await crew.one();
        }
    }
    co_await crew.all();
    co_return Nothing{};
}

// The error of the clock with the greatest difference above `most`; code none if there is none.
Error worst_clock(Network& network, std::int64_t most) {
    Error error{.step = kClockStep, .expected = network.clocks.settings.limit_ns};
    for (const Slave& slave : network.slaves()) {
        const ClockEntry& clock = network.clocks.of(slave);
        const std::int64_t away = std::abs(std::int64_t{clock.difference_ns});
        if (!clock.synchronised || away <= most) continue;
        most = away;
        error.code = Errc::not_in_sync;
        error.slave = slave.number;
        error.actual = static_cast<std::uint32_t>(clock.difference_ns);
    }
    return error;
}

// Whether every clock is within the limit. The upper estimate is less than twice the greatest difference. Only if the
// estimate is between the limit and twice the limit, each clock is read.
Task<Result<bool>> are_within_limit(Network& network) {
    const std::uint32_t limit = network.clocks.settings.limit_ns;
    const auto greatest = co_await required(read_greatest_difference(network));
    network.clocks.greatest_ns = greatest;
    if (greatest <= limit || greatest / 2 >= limit) co_return greatest <= limit;
    co_await required(read_differences(network));
    co_return worst_clock(network, limit).code == Errc::none;
}

// Sends the time until every clock has been within the limit for the settle time, and for as many comparisons as its
// register is the mean of (before, a clock that swings may seem to be within it) or as there is time for.
Task<Result<>> wait_until_in_sync(Network& network) {
    const ClockSettings& settings = network.clocks.settings;
    const Time give_up = later(network.engine.now(), settings.timeout);
    Time since = kNever;
    bool settled = false;
    std::uint8_t times = 0;
    while (!settled) {
        co_await required(send_time(network));
        const auto within = co_await required(are_within_limit(network));
        const Time now = network.engine.now();
        if (within && since == kNever) since = now;
        if (!within) since = kNever;
        times = within ? static_cast<std::uint8_t>(std::min(times + 1, UINT8_MAX)) : std::uint8_t{0};
        const bool last = now >= give_up;
        settled = within && now >= later(since, settings.settle) && (last || times >= ClockEntry::kTimesOfMean);
        if (settled || last) break;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    co_await required(read_differences(network));
    // A clock that was within the limit for a part of the settle time is not in sync.
    const Error worst = worst_clock(network, settled ? std::int64_t{settings.limit_ns} : -1);
    if (worst.code != Errc::none) co_return worst;
    for (ClockEntry& clock : network.clocks.entries.first(network.count))
        clock.in_sync = clock.knows_rate = clock.told_in_sync = clock.synchronised;
    network.clocks.all_in_sync = true;
    co_return Nothing{};
}

// Measures delays and writes offsets, from the clocks' own times.
Task<Result<>> set_clocks(Network& network) {
    co_await required(measure(network));
    compute_offsets(network);
    Error first;
    const auto write = [&network](Slave& s) { return write_clock_if_any(network, s); };
    co_await required(for_each_slave(network, write, &first));
    co_return first.code == Errc::none ? Result<>() : Result<>(first);
}

}  // namespace

Task<Result<>> improve_delays(Network& network) {
    while (network.clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    co_await required(measure(network));
    Error first;
    const auto write = [&network](Slave& s) { return write_delay_if_any(network, s); };
    co_await required(for_each_slave(network, write, &first));
    co_return first;
}

bool is_way_unknown(Network& network, const Slave& slave, const Slave& reference) {
    const RedundancyPart* const ring = network.redundancy;
    return ring != nullptr && ring->has_clocks_beside() && !network.ring_parts().whole &&
           ring->are_parted(network, slave, reference);
}

Task<Result<std::int64_t>> measure_way(Network& network, Slave& slave, const Slave& reference) {
    Clocks& clocks = network.clocks;
    const RedundancyPart* const ring = network.redundancy;
    RingParts before;
    for (;;) {  // the ring may change while another measurement runs
        before = network.ring_parts();
        const bool parted = ring != nullptr && ring->are_parted(network, slave, reference);
        if (!parted || before.whole || ring->has_clocks_beside())
            co_return std::int64_t{clocks.of(slave).delay_ns} - clocks.of(reference).delay_ns;
        if (!clocks.measuring) break;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    const std::uint32_t changes = ring->changes();
    const ScopedFlag measuring(clocks.measuring);
    for (ClockEntry& clock : clocks.entries.first(network.count)) clock.times.clear();
    (void)find_frame_ways(network);
    co_await required(measure_all(network));
    Error changed = changed_meanwhile(network);
    if (check_receive_times(network).code == Errc::unstable) changed.code = Errc::unstable;
    const auto nodes = clocks.nodes.first(find_frame_ways(network));
    const std::size_t from = reference.ring_position;
    const std::size_t to = slave.ring_position;
    const auto is_known = [nodes](std::size_t place) {
        return place != 0 && place <= nodes.size() && nodes[place - 1].timed();
    };
    if (ring_has_changed(network, before) || ring->changes() != changes || !is_known(from) || !is_known(to))
        changed.code = Errc::unstable;
    if (changed.code != Errc::none) co_return changed;
    compute_delays(nodes);
    const std::int64_t way_ns = delay_between_ns(nodes[from - 1], nodes[to - 1]);
    // Both parts have latched different frames.
    const std::int64_t longest_ns = 1'000'000 + 4'000 * std::int64_t{network.count};
    if (std::abs(way_ns) > longest_ns)
        co_return Error{.code = Errc::unstable, .step = kClockStep, .slave = slave.number};
    co_return way_ns;
}

Task<Result<>> write_clock_register(Station station, wire::Register r, std::uint64_t value) {
    std::array<std::byte, 8> bytes{};
    store_le<std::uint64_t>(bytes, 0, value);
    co_await required(write_bytes(station, r.address, Bytes(bytes).first(r.length), kClockStep));
    co_return Nothing{};
}

// When the group is exchanged the next time, if it keeps the interval.
static Time next_cycle(const ProcessGroup& group) { return group.pace.last + (group.pace.last - group.pace.before); }

// The group whose next cycle takes queued datagrams with it; nullptr: they are sent at once.
static const ProcessGroup* next_carrier(Network& network) {
    const ProcessGroup* next = nullptr;
    if (!network.engine.link().cycling(network.engine.now())) return next;
    for (const ProcessGroup& group : network.process.groups)
        if (group.mapped && group.pace.budget_bytes != 0 && group.pace.before != Time::min() &&
            (next == nullptr || next_cycle(group) < next_cycle(*next)))
            next = &group;
    return next;
}

Time leaves_at(Network& network) {
    const ProcessGroup* const carrier = next_carrier(network);
    const Time now = network.engine.now();
    return carrier == nullptr ? now : std::max(now, next_cycle(*carrier));
}

Task<Result<>> send_time(Network& network) {
    const Slave& reference = network.slave(network.clocks.reference);
    const bool wide = network.clocks.of(reference).kind == ClockKind::bits64;
    std::array<std::byte, 8> time{};
    // Taken by all clocks if the reference is lost.
    store_le<std::uint64_t>(time, 0, network.clocks.system_at_ns(leaves_at(network)));
    const TimeSource source = time_source_of(network.slaves(), reference, network.clocks.settings.by_position);
    TimedDatagram carry(network.engine.link(), source.command, {source.address, reg::kSystemTime.address},
                        MutableBytes(time).first(wide ? 8U : 4U), Repeat::no);
    carry.send_alone();
    auto reply = co_await carry;
    if (!reply.ok() || reply.wkc == 0) co_return Nothing{};  // a lost frame is no error: the next frame brings the time
    Clocks& clocks = network.clocks;
    ++clocks.times_sent;
    clocks.note_seen_time(load_le<std::uint64_t>(time), wide, carry.sent_at());
    constexpr std::uint8_t kFewOdd = 2;
    if (clocks.odd_times < kFewOdd) co_return Nothing{};
    co_await required(check_offset(network));
    clocks.trust_times(network.engine.now());
    co_return Nothing{};
}

Task<Result<>> check_offset(Network& network) {
    const Slave& reference = network.slave(network.clocks.reference);
    const auto offset =
        co_await required(read<std::uint64_t>(network.station(reference), reg::kSystemTimeOffset, kClockStep));
    if (offset == 0 && network.clocks.of(reference).offset_ns != 0)
        co_return Error{.code = Errc::unstable, .step = kClockStep, .slave = reference.number};
    co_return Nothing{};
}

Task<Result<std::uint32_t>> read_greatest_difference(Network& network) {
    if (any_unsynchronised(network)) co_return co_await read_each_difference(network);
    std::array<std::byte, 4> all{};
    Datagram look(network.engine.link(), Command::BRD, broadcast(reg::kSystemTimeDifference), MutableBytes(all));
    auto reply = co_await look;
    if (!reply.ok()) co_return Error{.code = reply.errc, .step = kClockStep};
    co_return load_greatest_difference_ns(load_le<std::uint32_t>(all));
}

Task<Result<>> read_difference(Network& network, Slave& slave) {
    const auto raw =
        co_await required(read<std::uint32_t>(network.station(slave), reg::kSystemTimeDifference, kClockStep));
    network.clocks.of(slave).difference_ns = load_difference_ns(raw);
    co_return Nothing{};
}

Task<Result<>> write_clock(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    ClockEntry& clock = network.clocks.of(slave);
    clock.knows_rate = false;
    wire::Register offset = reg::kSystemTimeOffset;
    if (clock.kind == ClockKind::bits32) offset.length = 4;
    auto written = co_await write_clock_register(station, offset, clock.offset_ns);
    if (written) written = co_await write_clock_register(station, reg::kSystemTimeDelay, clock.delay_ns);
    if (written) written = co_await reset_control_loop(station);
    co_return written;
}

Task<Result<>> reset_control_loop(Station station) {
    co_return co_await required(write_clock_register(station, reg::kSpeedCounterStart, kSpeedCounterDefault));
}

Task<Result<std::uint16_t>> configure_clocks(Network& network, ClockSettings settings) {
    Clocks& clocks = network.clocks;
    while (clocks.watching) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    clocks.forget();
    clocks.settings = settings;
    co_await required(reset_clocks(network));
    Error first;
    const auto probe = [&network, &first](Slave& s) { return probe_if_there(network, s, first); };
    co_await required(for_each_slave(network, probe));
    if (first.code != Errc::none) co_return first;
    const auto reference = choose_reference(network, settings.reference);
    if (!reference) co_return reference;
    clocks.reference = clocks.rate_of = *reference;
    for (Slave& slave : network.slaves()) (void)note_reach(network, slave);
    clocks.prepare = prepare_clock;
    clocks.watch = watch_clocks;
    clocks.is_near = is_near;
    clocks.resume = resume_time;
    auto set = co_await set_clocks(network);
    if (set && network.redundancy != nullptr) set = co_await network.redundancy->begin_second_part(network);
    if (set) set = co_await send_burst(network);
    if (set) set = co_await improve_delays(network);
    if (set) set = co_await wait_until_in_sync(network);
    co_return set ? Result<std::uint16_t>(*reference) : Result<std::uint16_t>(set.error());
}

}  // namespace margay
