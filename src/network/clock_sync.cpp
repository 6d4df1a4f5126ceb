// The clock of a slave that comes back, and of a reference that was away.
#include "clock/system_time.hpp"
#include "network/clock_restore.hpp"
#include "network/network.hpp"
#include "util/scoped_flag.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

// Whether the slave has the offset and the delay that were written, so that its clock was not reset.
Task<Result<bool>> has_its_clock(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    std::array<std::byte, 12> there{};
    const Station station = network.station(slave);
    Datagram look(station.engine.link(), wire::Command::FPRD, {station.address, reg::kSystemTimeOffset.address},
                  MutableBytes(there));
    auto reply = co_await look;
    const Error error = error_of_reply(station, reply, Step::configure_clocks, reg::kSystemTimeOffset.address);
    if (error.code != Errc::none) co_return error;
    const std::uint64_t mask = clock.kind == ClockKind::bits64 ? UINT64_MAX : UINT32_MAX;
    const bool same = ((load_le<std::uint64_t>(there) ^ clock.offset_ns) & mask) == 0 &&
                      load_le<std::uint32_t>(there, 8) == clock.delay_ns;
    if (!same) co_return false;
    co_return co_await required(is_near(network, slave));
}

// A clock that has kept its time while the reference was away; this clock runs at the rate that it has learned.
// nullptr: none.
Slave* kept_clock(Network& network) {
    Clocks& clocks = network.clocks;
    for (Slave& slave : network.slaves()) {
        const ClockEntry& clock = clocks.of(slave);
        if (slave.number != clocks.reference && slave.al.state >= AlState::safeop && clock.synchronised &&
            clock.knows_rate && clock.measured && !clock.delay_old)
            return &slave;
    }
    return nullptr;
}

// The slave with the reference clock was reset: its offset is 0, and its clock begins anew. It gets the system time of
// another clock, or the system time by the master's clock if there is no other one, so that the other clocks need not
// follow a jump. The function latches receive times, and no other sequence latches them now.
Task<Result<>> continue_reference(Network& network) {
    Clocks& clocks = network.clocks;
    Slave& reference = network.slave(clocks.reference);
    Slave* const kept = network.redundancy == nullptr ? kept_clock(network) : nullptr;
    co_await required(latch_receive_times(network));
    const Time sent = clocks.latched_at;
    co_await required(read_receive_times(network, reference, Keep::no));
    if (kept != nullptr) {
        co_await required(read_receive_times(network, *kept, Keep::no));
        const ClockEntry& source = clocks.of(*kept);
        clocks.note_time(source.local_ns + source.offset_ns - source.delay_ns, source.kind == ClockKind::bits64, sent);
    }
    ClockEntry& clock = clocks.of(reference);
    clock.end_sync();
    clock.offset_ns = clock_offset_ns(clocks.system_at_ns(sent), clock.delay_ns, clock.local_ns);
    take_own_rate(network, reference);
    const auto written = co_await write_clock(network, reference);
    clocks.forget_times_before(network.engine.now());
    co_return written;
}

// The application or MasterClock writes times to this clock, which may be far from the expected system time.
bool is_moved_freely(const Clocks& clocks, const Slave& reference) {
    return clocks.is_driven && reference.number == clocks.reference;
}

// Whether the reference clock was reset. Then its offset is 0, or, if the bus shift or the controller of a second
// reference has written an offset meanwhile, its time is far from the expected system time. `offset`: receives the
// offset register.
Task<Result<bool>> was_reset(Network& network, const Slave& reference, std::uint64_t& offset) {
    const Clocks& clocks = network.clocks;
    const ClockEntry& clock = clocks.entries[reference.number - 1U];
    const Station station = network.station(reference);
    offset = co_await required(read<std::uint64_t>(station, reg::kSystemTimeOffset, Step::configure_clocks));
    if (offset == 0 && clock.offset_ns != 0) co_return true;
    if (is_moved_freely(clocks, reference)) co_return false;
    // With long cycles, a lost frame is repeated much later.
    std::array<std::byte, reg::kSystemTime.length> time{};
    TimedDatagram look(station.engine.link(), wire::Command::FPRD, {station.address, reg::kSystemTime.address},
                       MutableBytes(time));
    auto reply = co_await look;
    const Error error = error_of_reply(station, reply, Step::configure_clocks, reg::kSystemTime.address);
    if (error.code != Errc::none) co_return error;
    co_return !clocks.is_likely(load_le<std::uint64_t>(time), clock.kind == ClockKind::bits64, look.sent_at());
}

}  // namespace

Task<Result<>> restore_reference(Network& network) {
    Clocks& clocks = network.clocks;
    while (clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const ScopedFlag measuring(clocks.measuring);
    std::uint64_t offset = 0;
    const Slave& reference = network.slave(clocks.reference);
    const auto reset = co_await required(was_reset(network, reference, offset));
    if (reset) co_await required(continue_reference(network));
    // The cycles have carried no time since the reference was lost, unless another slave has become the reference
    // meanwhile.
    if (!clocks.paused && clocks.reference == reference.number) (void)carry_time_of(network, &reference);
    co_return Nothing{};
}

namespace {

Slave& reference_of(Network& network, const Slave& slave) {
    return network.slave(network.redundancy == nullptr ? network.clocks.reference
                                                       : network.redundancy->reference_of(network, slave));
}

// Sets the clock of the slave by the clock of the reference: both latch the same frame. If configdc() has not seen the
// slave, its delay is measured first, together with the delays of its neighbours.
Task<Result<>> set_clock_by_reference(Network& network, Slave& slave) {
    Clocks& clocks = network.clocks;
    if (!clocks.of(slave).measured) co_await required(improve_delays(network));
    if (!clocks.of(slave).measured)  // its place in the ring is not known yet
        co_return Error{.code = Errc::unstable, .step = Step::configure_clocks, .slave = slave.number};
    Slave& reference = reference_of(network, slave);
    const auto way = co_await required(measure_way(network, slave, reference));
    while (clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const ScopedFlag measuring(clocks.measuring);
    (void)find_frame_ways(network);
    std::uint64_t offset = 0;
    const auto reset = co_await required(was_reset(network, reference, offset));
    if (reset && reference.number == clocks.reference) {
        co_await required(continue_reference(network));
        offset = clocks.of(reference).offset_ns;
    }
    // A second reference without its clock leads no other clock: it is set first, when its slave is brought back.
    const Error no_time{.code = Errc::unstable, .step = Step::configure_clocks, .slave = slave.number};
    if (reset && reference.number != clocks.reference) co_return no_time;
    ClockEntry& clock = clocks.of(slave);
    ClockEntry& source = clocks.of(reference);
    // Another program has moved the reference.
    const bool wide = source.kind == ClockKind::bits64;
    const std::uint64_t moved_ns = offset - source.offset_ns;
    const std::int64_t moved = wide ? static_cast<std::int64_t>(moved_ns) : static_cast<std::int32_t>(moved_ns);
    if (std::abs(moved) > kNear_ns) source.offset_ns = offset;
    co_await required(latch_receive_times(network));
    co_await required(read_receive_times(network, slave, Keep::no));
    co_await required(read_receive_times(network, reference, Keep::no));
    const std::uint64_t system = source.local_ns + offset - source.delay_ns;
    // The reference may have lost its power since its offset was read.
    if (!is_moved_freely(clocks, reference) && !clocks.is_likely(system, wide, clocks.latched_at)) co_return no_time;
    clocks.note_time(system, wide, clocks.latched_at);
    clock.offset_ns = clock_offset_ns(clocks.system_ns, way + source.delay_ns, clock.local_ns);
    co_return co_await required(write_clock(network, slave));
}

// A measurement of the delays does not write the delay of a clock that is being set. So the delay is written again
// here, because delays may have been measured meanwhile.
Task<Result<>> write_delay_again(Network& network, Slave& slave) {
    co_return co_await required(
        write_clock_register(network.station(slave), wire::reg::kSystemTimeDelay, network.clocks.of(slave).delay_ns));
}

// Sends the time until the clock of the slave is within the limit, for kLongest at most. If the clock is still outside
// the limit, the supervision reports it later. A reference that is lost meanwhile, and comes back in a lower state, has
// a time of its own, which must reach no clock.
Task<Result<>> wait_for_clock(Network& network, Slave& slave) {
    constexpr Duration kLongest = std::chrono::milliseconds(800);
    const Time give_up = later(network.engine.now(), kLongest);
    unsigned good = 0;
    constexpr unsigned kEnough = 10;
    const Slave& reference = network.slave(network.clocks.reference);
    const AlState begun = reference.al.state;
    const auto is_kept = [&] { return network.clocks.reference == reference.number && reference.al.state >= begun; };
    while (good < kEnough && network.engine.now() < give_up && is_kept()) {
        const auto sent = co_await send_time(network);
        if (!sent) break;
        co_await required(read_difference(network, slave));
        const std::int64_t away = std::abs(std::int64_t{network.clocks.of(slave).difference_ns});
        good = away <= network.clocks.settings.limit_ns ? good + 1 : 0;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    co_return Result<>();
}

}  // namespace

// The slave is before the reference in the ring, so the time of the reference does not reach the slave: it would
// receive the time that the master has sent. So the cycles stop to carry the time, the clock of the slave is set by the
// reference, and the slave becomes the reference. Meanwhile the other clocks run at their rates.
Task<Result<>> become_reference(Network& network, Slave& slave, ClockRate rate) {
    Clocks& clocks = network.clocks;
    constexpr Duration kLongestOther = std::chrono::seconds(8);
    // With long cycles the measurement takes long. The cycles still carry the time meanwhile.
    if (!clocks.of(slave).measured) co_await required(improve_delays(network));
    const Time give_up = later(network.engine.now(), kLongestOther);
    while (network.redundancy == nullptr && clocks.paused && network.engine.now() < give_up)
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));  // another slave becomes the reference now
    (void)carry_time_of(network, nullptr);
    TimePause pause(network);
    const std::uint16_t before = clocks.reference;
    // After a loss of power, the control loop corrects the clock at the greatest rate, and would continue while the
    // clock is being set.
    auto set = co_await reset_control_loop(network.station(slave));
    if (set) set = co_await set_clock_by_reference(network, slave);
    if (set && rate == ClockRate::of_reference) {
        const auto learned = co_await learn_rate(network, slave, reference_of(network, slave));
        if (!learned) set = learned.error();
        if (!learned || !*learned) rate = ClockRate::own;
    }
    // Another slave has become the reference, so the cycles have carried the time again. This slave has taken the time
    // that the master has sent, and has followed it with its rate.
    if (set && clocks.reference != before) {
        rate = ClockRate::own;
        set = co_await reset_control_loop(network.station(slave));
    }
    // Another slave, before this one, may have become the reference meanwhile.
    const bool first =
        set && slave.ring_position != 0 && slave.ring_position < network.slave(clocks.reference).ring_position;
    clocks.of(slave).synchronised = set.ok();
    if (set) set = co_await write_delay_again(network, slave);
    clocks.lose_sync(slave);
    // Before set_reference(), which takes some cycles in a ring with two NICs.
    if (first && rate == ClockRate::own) lose_sync_of_others(network, slave);
    if (first) co_await completion(set_reference(network, slave));
    // If the new reference has another rate, the clocks that follow it need time to learn this rate. The clocks that do
    // not follow the slave are not in step with it.
    for (const Slave& other : network.slaves())
        if (first && (rate == ClockRate::own || followed_clock(network, other).slave != slave.number))
            clocks.lose_sync(other);
    const Slave& reference = network.slave(clocks.reference);
    (void)carry_time_of(network, &reference);
    pause.end();
    co_return set;
}

namespace {

// A branch before the reference has come back: whether another slave with a clock is before this slave. Then the other
// slave becomes the reference, and this slave follows it; until then, this slave receives the time that the master
// sends. If the other slave does not reach its state, return_to_first_clock() makes this slave the reference.
bool follows_another(Network& network, const Slave& slave) {
    if (network.redundancy != nullptr) return false;
    return std::ranges::any_of(network.slaves(), [&network, &slave](const Slave& other) {
        return other.ring_position != 0 && other.ring_position < slave.ring_position &&
               other.al.state != AlState::none && is_clock(network.clocks.of(other).kind) &&
               !note_reach(network, network.slave(other.number));
    });
}

// calm_rate() sets the deepest filter. A slave that was lost meanwhile may still have this filter.
Task<Result<>> restore_filter(Network& network, const Slave& slave) {
    const wire::Register filter = wire::reg::kSystemTimeDifferenceFilter;
    const auto depth = co_await required(read<std::uint8_t>(network.station(slave), filter, Step::configure_clocks));
    if (depth != kDeepestFilter) co_return Nothing{};
    co_return co_await required(write_clock_register(network.station(slave), filter, kUsualFilter));
}

Task<Result<>> restore_clock(Network& network, Slave& slave) {
    Clocks& clocks = network.clocks;
    ClockEntry& clock = clocks.of(slave);
    if (clock.kind == ClockKind::unknown) {
        co_await required(probe_clock(network, slave));
    }
    if (!is_clock(clock.kind) || clocks.reference == 0 || note_reach(network, slave)) co_return Result<>();
    if (clocks.reference == slave.number) co_return co_await required(restore_reference(network));
    if (clock.synchronised) {
        co_await required(restore_filter(network, slave));
        const auto same = co_await required(has_its_clock(network, slave));
        if (same) co_return Result<>();
    }
    clock.synchronised = false;
    clock.end_sync();
    clock.follows = 0;
    clocks.lose_sync(slave);
    // set_late_clock() sets the clock when the reference is back, or when another slave has become the reference.
    if (network.slave(clocks.reference).al.state == AlState::none) co_return Result<>();
    const Slave& reference = network.slave(clocks.reference);
    // 0: its place in the ring is not known yet.
    const bool before = slave.ring_position != 0 && slave.ring_position < reference.ring_position && !clock.beside;
    if (before && !is_way_unknown(network, slave, reference) && !follows_another(network, slave))
        co_return co_await required(become_reference(network, slave, ClockRate::of_reference));
    co_await required(set_clock_by_reference(network, slave));
    clock.synchronised = true;
    co_await required(write_delay_again(network, slave));
    if (before && network.redundancy == nullptr) co_return Result<>();
    co_return co_await required(wait_for_clock(network, slave));
}

}  // namespace

// A slave that was away may not have received a time since then, so its difference register may be old.
Task<Result<bool>> is_near(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    Slave& reference = reference_of(network, slave);
    if (!clock.synchronised || network.clocks.reference == slave.number) co_return true;
    if (reference.al.state == AlState::none) co_return true;  // without the reference, no comparison is possible
    const bool watched = network.clocks.settings.watch_interval > Duration{0};
    if (!watched || (!clock.is_in_step() && !clock.knows_difference())) {
        const auto ahead = co_await required(measure_ahead(network, slave, reference));
        co_return std::abs(ahead) <= kNear_ns;
    }
    co_await required(read_difference(network, slave));
    co_return std::abs(std::int64_t{clock.difference_ns}) <= kNear_ns;
}

Task<Result<>> prepare_clock(Network& network, Slave& slave) {
    co_await required(restore_clock(network, slave));
    co_return co_await required(prepare_sync(network, slave));
}

}  // namespace margay
