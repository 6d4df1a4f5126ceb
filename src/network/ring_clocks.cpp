// Distributed clocks in a ring with two NICs. While the ring is whole, the copy of each frame that begins at the head
// of the ring passes the processing units of all slaves, and brings them the time of the reference clock. Behind a
// break, the frames of the second NIC pass the processing units in the same order, so the delays stay right; the first
// clock behind the break becomes the second reference. The two copies of each frame compare both references, and the
// master steers the second reference by its offset.
#include "network/ring_watch.hpp"
#include "network/wanted.hpp"
#include "util/scoped_flag.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr wire::Register kLoops{reg::kDlControl.address, 2};
constexpr std::uint16_t kTemporary = 0x0002;  // the loop settings are valid for about a second

// Shorter than the time after which the chip opens the port by itself.
constexpr Duration kLongest = std::chrono::milliseconds(800);

constexpr std::uint16_t closed(std::uint8_t port) { return static_cast<std::uint16_t>(0x0300U << (2 * port)); }

Error ring_error(Errc code, std::uint16_t slave = 0) {
    return {.code = code, .step = Step::configure_clocks, .slave = slave, .detail = Error::kRedundancy};
}

// While the ring is whole: whether the copy of the head reaches any slave with a clock (`beside` false), or whether
// only the other copy reaches one (`beside` true).
bool has_clock(Network& network, RingParts parts, bool beside) {
    return std::ranges::any_of(network.slaves(), [&](const Slave& slave) {
        const bool other = slave.ring_position > parts.front;
        return other == beside && slave.ring_position != 0 && is_clock(network.clocks.of(slave).kind);
    });
}

// Whether a clock still needs the delay of its present way, because it was being set when arrange() wrote the delays of
// the other clocks.
bool delay_waits(Network& network) {
    return std::ranges::any_of(network.slaves(), [&](const Slave& slave) {
        const ClockEntry& clock = network.clocks.of(slave);
        return clock.delay_waits && clock.synchronised && slave.al.state != AlState::none;
    });
}

// The datagram is sent in a frame of its own, because the frames before it and after it take different ways.
Task<Result<>> write_loops(Station station, int value) {
    std::array<std::byte, 2> bytes{};
    store_le<std::uint16_t>(bytes, 0, static_cast<std::uint16_t>(value));
    Datagram write(station.engine.link(), wire::Command::FPWR, {station.address, kLoops.address}, Bytes(bytes));
    write.send_alone();
    const auto reply = co_await write;
    const Error error = error_of_reply(station, reply, Step::configure_clocks, kLoops.address);
    if (error.code != Errc::none) co_return error;
    co_return Nothing{};
}

}  // namespace

Task<Result<>> RingWatch::open_ring(Network& network) { co_return co_await required(open_ring_with(network, false)); }

Task<Result<>> RingWatch::open_ring_with(Network& network, bool times) {
    const RingParts now = parts();
    last_ = 0;
    measured_whole_ = false;
    if (!now.two_nics) co_return Nothing{};
    std::uint8_t port = 0;
    const Slave* const last = last_slave(network, port);
    const auto known = [](const ClockEntry& clock) { return clock.measured; };
    const bool first_time = std::ranges::none_of(network.clocks.entries.first(network.count), known);
    if (first_time) {
        has_beside_ = ways_known_ = false;
        ring_.guard_times(false);
    }
    if (!now.whole) {
        // If the ring is broken at the cable of a NIC, it is a line without a second part.
        const bool parted = now.front < network.ring_count;
        // Delays that were measured in the whole ring are more exact: now the delay across the break is not known, and
        // the first slave behind the break forwards frames faster than with port 0 open.
        if (parted && !first_time && !guessed_) co_return ring_error(Errc::wrong_state);
        guessed_ = parted;
        co_return Nothing{};
    }
    // The counts show which clocks are beside the ring; the counts of the broken ring would be wrong.
    if (!ring_.counts_are_new()) co_return ring_error(Errc::unstable);
    std::ranges::fill(constants_.begin() + (first_time ? 0 : 1), constants_.end(), Constant{});
    if (comparison_ == Comparison::taught) comparison_ = Comparison::unknown;  // the lesson may have used other delays
    if (last == nullptr) co_return ring_error(Errc::wrong_state);
    const Slave& reference = network.slave(network.clocks.reference);
    if (reference.ring_position > now.front && has_clock(network, now, false))
        co_return ring_error(Errc::unsupported, reference.number);
    measured_whole_ = true;
    measured_last_ = last->ring_position;
    const Station station = network.station(*last);
    const auto control = co_await required(read<std::uint16_t>(station, reg::kDlControl, Step::configure_clocks));
    ring_.begin_opening(times);
    opened_ = network.engine.now();
    last_ = last->number;
    // An earlier open_ring() may have left the port closed; the chip opens it soon. So close_ring() must not restore
    // the value "closed".
    last_control_ = (control & closed(port)) == closed(port) ? control & ~closed(port) : control;
    const auto written = co_await write_loops(station, control | kTemporary | closed(port));
    if (!written) {  // perhaps only the reply was lost
        co_await completion(close_ring(network));
    }
    co_return written;
}

Task<Result<>> RingWatch::close_ring(Network& network) {
    if (last_ == 0 || last_ > network.count) co_return Nothing{};
    ring_.begin_closing();
    const auto written = co_await write_loops(network.station(network.slave(last_)), last_control_ & ~kTemporary);
    last_ = 0;
    ring_.end_opening();
    if (written && network.engine.now() - opened_ > kLongest) co_return ring_error(Errc::unstable);
    co_return written;
}

std::uint16_t RingWatch::reference_of(Network& network, const Slave& slave) const {
    const bool behind = is_behind(network, slave);
    return behind && second_ != 0 && second_ != slave.number ? second_ : network.clocks.reference;
}

// The first clock behind the break; 0: none.
std::uint16_t RingWatch::first_behind(Network& network, bool only_settled) const {
    std::uint16_t best = 0;
    const Slave& reference = network.slave(network.clocks.reference);
    // If the reference itself is behind the front, it is the first clock there. A clock of a branch before it does not
    // become the reference.
    if (has_beside_ && is_behind(network, reference) && reference.al.state != AlState::none) return reference.number;
    for (const Slave& slave : network.slaves()) {
        // Below SAFEOP, the clock of a slave that has come back may not be set yet, unless the slave is the reference.
        const bool settled = !only_settled || slave.number == second_ || slave.number == network.clocks.reference ||
                             slave.al.state >= AlState::safeop || slave.al.state == wanted_state(network, slave);
        const bool candidate = is_behind(network, slave) && slave.al.state != AlState::none && settled &&
                               network.clocks.of(slave).synchronised;
        if (candidate && (best == 0 || passes_at_ns(network, slave) < passes_at_ns(network, network.slave(best))))
            best = slave.number;
    }
    return best;
}

Task<Result<>> RingWatch::begin_second_part(Network& network) {
    const RingParts now = parts();
    const bool broken = now.two_nics && !now.whole;
    // The second reference will be another clock, or the same clock with another time.
    ring_.set_second_reference({});
    second_ = 0;
    if (has_beside_ && now.whole) co_return co_await required(teach_beside(network));
    wanted_second_ = broken ? first_behind(network, false) : std::uint16_t{0};
    if (wanted_second_ != 0 && wanted_second_ != network.clocks.reference) {
        Slave& second = network.slave(wanted_second_);
        co_await required(teach_rate(network, second));
        network.clocks.of(second).knows_rate = true;
        co_await required(set_second_part(network, second));
    }
    co_return co_await required(change_second(network, wanted_second_));
}

// Whether a cycle has come back in which a slave is missing whose loss is not known yet.
static bool falls_short(const Network& network) {
    const auto is_short = [](const DatagramStatus& status) { return status.came && !status.usable(); };
    return std::ranges::any_of(network.process.groups, [&is_short](const ProcessGroup& group) {
        return group.mapped && std::ranges::any_of(group.statuses, is_short);
    });
}

// Returns the greatest difference of a clock beside the ring after the lesson. While the ring is open, a break leaves
// the slaves behind it without process data: then the lesson ends at once.
Task<Result<std::uint32_t>> RingWatch::teach_once(Network& network) {
    constexpr Duration kLesson = std::chrono::milliseconds(400);
    Clocks& clocks = network.clocks;
    // While a slave becomes the reference, or while a clock is set, the ways are measured, and no time may reach the
    // slave.
    if (clocks.paused || clocks.measuring) co_return ring_error(Errc::unstable);
    const ScopedFlag measuring(clocks.measuring);
    co_await required(open_ring_with(network, true));
    const Time give_up = network.engine.now() + kLesson;
    constexpr unsigned kEnough = 3;
    const bool was_short = falls_short(network);
    unsigned times_short = 0;
    bool same = true;
    for (std::uint16_t n = 0; n < clocks.settings.burst_frames && network.engine.now() < give_up && same; ++n) {
        const auto sent = co_await send_time(network);
        times_short = !was_short && falls_short(network) ? times_short + 1 : 0;
        same = sent.ok() && !find_old_delays(network) && !clocks.paused && times_short < kEnough;
    }
    std::int64_t greatest = 0;
    // A clock whose rate is still wrong shows the right time at single moments, so it is compared several times.
    for (unsigned looks = 0; looks < 8 && same; ++looks) {
        for (unsigned times = 0; times < 4 && same; ++times) {
            const auto sent = co_await send_time(network);
            same = sent.ok();
        }
        for (Slave& slave : network.slaves()) {
            const ClockEntry& clock = clocks.of(slave);
            if (!clock.synchronised || !clock.beside || slave.al.state == AlState::none) continue;
            const auto read = co_await read_difference(network, slave);
            same = same && read.ok() && !clocks.paused;
            greatest = std::max(greatest, std::abs(std::int64_t{clock.difference_ns}));
        }
    }
    co_await required(close_ring(network));
    // A slave was lost or has come back: the times belong to other ways.
    if (!same) co_return ring_error(Errc::unstable);
    co_return static_cast<std::uint32_t>(greatest);
}

// Sets the clocks behind the break by the clock of the reference: all of them latch the same frame.
Task<Result<>> RingWatch::set_second_part(Network& network, Slave& second) {
    Clocks& clocks = network.clocks;
    Slave& reference = network.slave(clocks.reference);
    co_await required(latch_receive_times(network));
    co_await required(read_receive_times(network, reference, Keep::no));
    const ClockEntry& source = clocks.of(reference);
    const std::uint64_t system_ns = source.local_ns + source.offset_ns;
    for (Slave& slave : network.slaves()) {
        ClockEntry& clock = clocks.of(slave);
        if (slave.ring_position <= parts().front || !clock.synchronised || slave.al.state == AlState::none) continue;
        co_await required(read_receive_times(network, slave, Keep::no));
        clock.offset_ns = clock_offset_ns(system_ns, clock.passed_ns, clock.local_ns);
        if (slave.number != second.number) {
            co_await required(write_clock(network, slave));
            continue;
        }
        wire::Register offset = reg::kSystemTimeOffset;  // the control loop continues
        if (clock.kind == ClockKind::bits32) offset.length = 4;
        co_await required(write_clock_register(network.station(slave), offset, clock.offset_ns));
    }
    co_return Nothing{};
}

// The clock behind the break that follows the reference; 0 while the ring is whole.
std::uint16_t RingWatch::choose_second(Network& network) const {
    const RingParts now = parts();
    if (!now.two_nics || (now.whole && !has_beside_) || network.clocks.reference == 0) return 0;
    // If some copies of a NIC were lost, the link regards this NIC as silent. Then the counts do not describe the ring.
    std::size_t there = 0;
    for (const Slave& slave : network.slaves())
        if (slave.al.state != AlState::none && slave.ring_position != 0) ++there;
    const std::size_t seen = std::size_t{ring_.reached_by(0)} + ring_.reached_by(1);
    if (!ring_.counts_are_new() || seen < there) return second_;
    return first_behind(network, true);
}

Task<Result<>> RingWatch::change_second(Network& network, std::uint16_t second) {
    const Slave& reference = network.slave(network.clocks.reference);
    const bool is_first = second != 0 && (has_beside_ ? is_behind(network, reference) : second == reference.number);
    const StationAddress address = second == 0 ? StationAddress{} : network.slave(second).station_address;
    const StationAddress first = is_first ? reference.station_address : StationAddress{};
    if (second == second_ && is_first == second_is_first_) {
        // The reference has changed, or the link has stopped to use the second reference: a reply was lost or contained
        // the time that was sent, or the ways have changed. Then the counts show whether the break has moved.
        const bool clear = has_beside_ || ring_.counts_are_new();
        const bool held = !has_beside_ && ring_.are_times_held();
        if (clear && (held || !ring_.has_second_reference(address, first))) ring_.set_second_reference(address, first);
        co_return Nothing{};
    }
    if (second != second_) lose_own_rate(network);
    second_ = second;
    // The first frames after the change of the ways may have found no reference, so the cycle may carry the time of the
    // standby. Its frames would bring the reference the time that the master has sent.
    const bool returns = std::exchange(second_is_first_, is_first) && !is_first;
    if (returns && !network.clocks.paused && reference.al.state != AlState::none)
        (void)carry_time_of(network, &reference);
    learns_ = carried_ = false;
    // Unless the ring is whole, the clocks beside the ring have followed other clocks since the last lesson.
    if (comparison_ != Comparison::taught || !parts().whole) comparison_ = Comparison::unknown;
    first_ = {};
    compared_behind_ = ring_.reached_by(1 - ring_.head());
    use_known_constant(network);
    ring_.set_second_reference(address, first);
    if (second == 0 || is_first) co_return Nothing{};
    network.report({.kind = EventKind::second_reference, .slave = second, .other = network.clocks.reference});
    ClockEntry& clock = network.clocks.entries[second - 1U];
    // After a loss of power, the control loop may correct the clock at the greatest rate, although the difference is
    // small at this moment.
    const bool runs_away = !clock.knows_rate && comparison_ != Comparison::taught;
    const auto restarted = co_await required(settle_rate(network, network.slave(second)));
    if (runs_away && !restarted) {
        co_await required(reset_control_loop(network.station(network.slave(second))));
    }
    const bool disturbed = std::abs(std::int64_t{clock.difference_ns}) > network.clocks.settings.limit_ns / 2;
    const bool leads_away = !is_in_step(network) && !parts().whole;
    if ((restarted || runs_away || disturbed || leads_away) && second == second_) distrust_second_part(network);
    co_return Nothing{};
}

void RingWatch::lose_behind(Network& network) const {
    for (const Slave& slave : network.slaves())
        if (is_behind(network, slave)) network.clocks.lose_sync(slave);
}

// The clocks that the reference clock does not reach are not in step with the reference clock. A known constant, or a
// measurement of the ways, shows the difference.
void RingWatch::distrust_second_part(Network& network) {
    lose_behind(network);
    first_ = {};
    comparison_ = Comparison::unknown;
    use_known_constant(network);
}

void RingWatch::use_known_constant(Network& network) {
    const Constant* const constant = known_constant();
    if (constant == nullptr || is_in_step(network)) return;
    constant_ns_ = constant->ns;
    begin_to_steer(network);
    rounds_deaf_ = kDeaf;  // until the first comparison, it is not known how far this clock is ahead
}

// The reference has changed, so the second reference is chosen again at once. Otherwise the copies of the other NIC
// would carry no time for some rounds. While the ring changes, the rounds of the watch choose it.
Task<Result<>> RingWatch::follow_reference(Network& network) {
    // The lesson used the time of the previous reference.
    if (comparison_ == Comparison::taught) comparison_ = Comparison::unknown;
    if (!is_steered()) first_ = {};
    if (has_beside_ && (!arranged_ || ring_.are_times_held())) co_return Nothing{};
    wanted_second_ = choose_second(network);
    co_return co_await required(change_second(network, wanted_second_));
}

// Whether the second reference is in step with the reference, before the first comparison.
bool RingWatch::is_in_step(const Network& network) const {
    return second_ != 0 && (network.clocks.entries[second_ - 1U].is_in_step() || comparison_ == Comparison::taught);
}

FollowedClock RingWatch::followed_clock(Network& network, const Slave& slave) const {
    const Slave& reference = network.slave(network.clocks.reference);
    const std::int64_t passes = passes_at_ns(network, slave);
    const bool behind = is_behind(network, slave);
    if (ring_.are_times_held()) return {};
    if (behind == is_behind(network, reference))
        return {.slave = passes < passes_at_ns(network, reference) ? std::uint16_t{0} : reference.number};
    // If the reference is behind the break, no time arrives before the break.
    if (!behind || second_ == 0 || second_is_first_ || comparison_ != Comparison::known || rounds_deaf_ >= kDeaf)
        return {};
    if (slave.number != second_ && passes < passes_at_ns(network, network.slave(second_))) return {};
    // Between two corrections, the rate of the second reference moves it by half of its drift in one interval to either
    // side.
    const std::int64_t cycle_ms = network.clocks.settings.watch_interval / std::chrono::milliseconds(1);
    const std::int64_t half_ns = std::abs(std::int64_t{phase_.drift_ppb()}) * cycle_ms / 2000;
    // Until the controller has learned this drift, the difference changes from round to round.
    const std::int64_t known_ns = std::abs(ahead_ns_) <= jitter_ns_ / 2 ? 0 : ahead_ns_;
    const std::int64_t change_ns = change_ns_ <= jitter_ns_ ? 0 : change_ns_;
    const std::int64_t moves_ns = half_ns + change_ns + lost_way_ns(network, slave);
    return {.slave = second_, .ahead_ns = known_ns, .moves_ns = moves_ns, .silent = rounds_deaf_ > 1};
}

void RingWatch::begin_to_steer(Network& network) {
    carried_ = false;
    comparison_ = Comparison::known;
    ahead_ns_ = change_ns_ = jitter_ns_ = moved_ns_ = rounds_deaf_ = 0;
    PhaseSettings phase =
        for_bus_shift({.cycle = network.clocks.settings.watch_interval, .gain_ppt = 50, .outlier_ns = 0});
    phase.cycles_late = 0;  // steer() skips differences that were measured before the correction
    phase_.start(phase);
}

// One step of the controller of the second reference.
Task<Result<>> RingWatch::steer(Network& network) {
    constexpr std::uint32_t kEnough = 16;
    const PartDifference seen = ring_.take_difference();
    if (rounds_deaf_ < UINT8_MAX) ++rounds_deaf_;
    if (end_constant(network)) co_return Nothing{};
    if (seen.count == 0) co_return Nothing{};
    rounds_deaf_ = 0;
    const std::uint32_t now_us = us_of(network.engine.now());
    const std::uint32_t interval_us = us_of(Time(network.clocks.settings.watch_interval));
    if (!is_steered()) {
        first_us_ = first_.count == 0 ? now_us - interval_us : first_us_;
        first_.least_ns = first_.count == 0 ? seen.least_ns : std::min(first_.least_ns, seen.least_ns);
        first_.most_ns = first_.count == 0 ? seen.most_ns : std::max(first_.most_ns, seen.most_ns);
        first_.sum_ns += seen.sum_ns;
        first_.count += seen.count;
        if (first_.count < kEnough) co_return Nothing{};
        co_return co_await required(find_constant(network));
    }
    const ClockEntry& clock = network.clocks.entries[second_ - 1U];
    const std::int64_t before_ns = std::exchange(ahead_ns_, seen.sum_ns / seen.count - (constant_ns_ - clock.delay_ns));
    change_ns_ = std::abs(ahead_ns_ - before_ns);
    jitter_ns_ = std::max<std::int64_t>(std::int64_t{seen.most_ns} - seen.least_ns - std::abs(moved_ns_), 0);
    const std::int64_t correction = phase_.update(ahead_ns_, network.engine.now());
    moved_ns_ = correction;
    steered_us_ = now_us - interval_us / 2;
    if (correction == 0) co_return Nothing{};
    const auto moved = co_await move_clock(network, network.slave(second_), -correction);
    (void)ring_.take_difference();
    co_return moved;
}

Task<Result<>> RingWatch::watch_clocks(Network& network) {
    constexpr std::uint8_t kEnough = 2;
    const RingParts now = parts();
    // The delays were measured while the ring was a line, or while the clocks beside the ring were away, and the ring
    // is whole now.
    const bool unknown = !ways_known_ || !has_beside_;
    if (unknown && now.whole && !ports_of_broken_ && has_clock(network, now, true)) guessed_ = true;
    if (has_beside_ && (!arranged_ || ring_.are_times_held())) {
        // After the first measurement in the whole ring, the clocks need a lesson, because they have followed other
        // delays before.
        const bool taught = !now.whole || second_ != 0 || ring_.are_times_held();
        if (!taught && !may_teach(network)) co_return Nothing{};
        if (!taught) co_await completion(teach(network));
        co_return co_await required(arrange(network));
    }
    if (has_beside_ && delay_waits(network)) co_return co_await required(arrange(network));
    const std::uint16_t wanted = choose_second(network);
    if (wanted != std::exchange(wanted_second_, wanted))
        rounds_seen_ = 0;
    else if (rounds_seen_ < kEnough)
        ++rounds_seen_;
    bool waits = false;
    if (rounds_seen_ >= kEnough) {
        waits = co_await required(is_second_late(network, wanted));
    }
    if (!waits && (wanted == 0 || wanted == second_ || rounds_seen_ >= kEnough)) {
        if (has_beside_ && now.whole && wanted != 0 && wanted != second_) {
            if (!may_teach(network)) co_return Nothing{};
            // The new clock may have lost its power. The present second reference may be behind it, and then brings it
            // the time that the master has sent.
            ring_.set_second_reference({});
            co_await completion(teach(network));
            forget_differences();  // follow_reference() may have made it the second reference meanwhile
        }
        co_await required(change_second(network, wanted));
    }
    if (second_ == 0 || second_is_first_) co_return Nothing{};
    if (needs_lesson(network) && now.whole && may_teach(network) && lesson_rounds_-- == 0) {
        const auto taught = co_await teach(network);
        constexpr std::uint8_t kRetryRounds = 20;  // the lesson was broken off
        lesson_rounds_ = taught ? UINT8_MAX : kRetryRounds;
        // The constant is measured anew: a constant of clocks that were not in step would lead the clocks back.
        learns_ = comparison_ == Comparison::unsure;
        if (learns_) comparison_ = Comparison::unknown;
        forget_differences();
        co_return Nothing{};
    }
    co_return co_await required(steer(network));
}

}  // namespace margay
