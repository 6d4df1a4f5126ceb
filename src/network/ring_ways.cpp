// Clocks at branches in a ring with two NICs. A ring slave is a slave that the frames pass on their way from one NIC to
// the other. A frame leaves a slave by its ports in the order 0, 3, 1, 2. So a branch whose port comes after the way to
// the next ring slave is "beside the ring": while the ring is whole, the copy of the head never comes back to this
// port, and only the other copy reaches the branch. These clocks follow a second reference, the first of them.
//
// The way to a branch beside the ring changes with each break:
//
// - The break is behind its ring slave: the copy of the head turns before the break and reaches the branch, earlier
//   than in the line by which the delays are measured (`away_ns` of the ring slave before the break).
// - The break is before its ring slave: the other copy reaches the branch before the ring slaves, which it passes when
//   it has turned at the break (`return_ns` of the ring slave behind the break).
//
// The delays of the ring slaves to each other are always as in the line.
#include "network/ring_watch.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

std::size_t there_between(Network& network, std::size_t first, std::size_t last) {
    std::size_t count = 0;
    for (const Slave& slave : network.slaves()) {
        const std::uint16_t at = network.clocks.of(slave).ring_slave;
        if (slave.al.state != AlState::none && at >= first && at <= last) ++count;
    }
    return count;
}

// The ring slave `at`, or the next one with receive times towards the head (`step` -1) or away from it (1); nullptr:
// none.
const ClockEntry* timed_ring_slave(Network& network, std::size_t at, int step) {
    const ClockEntry* best = nullptr;
    for (const ClockEntry& clock : network.clocks.entries.first(network.count)) {
        const bool side = step < 0 ? clock.ring_slave <= at : clock.ring_slave >= at;
        if (!clock.in_ring || !clock.measured || !side) continue;
        if (best == nullptr || (step < 0) == (clock.ring_slave > best->ring_slave)) best = &clock;
    }
    return best;
}

}  // namespace

void RingWatch::note_ways(Network& network) {
    if (!measured_whole_) return;
    guessed_ = false;
    Clocks& clocks = network.clocks;
    const auto ring = network.seen_ring();
    const auto nodes = clocks.nodes.first(std::min(clocks.nodes.size(), ring.size()));
    for (ClockEntry& clock : clocks.entries.first(network.count)) {
        clock.ring_slave = 0;
        clock.in_ring = clock.beside = false;
    }
    ring_slaves_ = 0;
    for (std::size_t at = measured_last_; at != 0 && at <= nodes.size() && ring_slaves_ < nodes.size();
         at = nodes[at - 1].parent)
        ++ring_slaves_;
    std::uint16_t number = ring_slaves_;
    std::int64_t away = 0;
    for (std::size_t at = measured_last_; number != 0; --number) {
        const DelayNode& node = nodes[at - 1];
        if (ring[at - 1].slave != 0) {
            ClockEntry& clock = clocks.entries[ring[at - 1].slave - 1U];
            clock.ring_slave = number;
            clock.in_ring = true;
            clock.away_ns = static_cast<std::int32_t>(away / 1000);
            clock.return_ns = static_cast<std::int32_t>(way_back_ps(node) / 1000);
        }
        at = node.parent;
        if (at != 0) away = away_ps(nodes[at - 1], node.parent_port);
    }
    const std::size_t front = parts().front;
    has_beside_ = false;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (ring[n].slave == 0) continue;
        ClockEntry& clock = clocks.entries[ring[n].slave - 1U];
        std::size_t at = n + 1;
        for (std::size_t steps = 0; at != 0 && steps < nodes.size() && clock.ring_slave == 0; ++steps) {
            const std::uint16_t slave = ring[at - 1].slave;
            if (slave != 0 && clocks.entries[slave - 1U].in_ring)
                clock.ring_slave = clocks.entries[slave - 1U].ring_slave;
            at = nodes[at - 1].parent;
        }
        clock.beside = !clock.in_ring && n >= front;
        has_beside_ |= clock.beside && is_clock(clock.kind);
    }
    ways_known_ = true;
    arranged_ = false;
    front_end_ = ring_slaves_;
    behind_begin_ = static_cast<std::uint16_t>(ring_slaves_ + 1);
    ring_.guard_times(has_beside_);
    noted_ways_ = static_cast<std::uint16_t>(ring_.ways());
    judges_ = false;
}

// Where the ring is broken, by the slaves that answer to each copy. False: the counts do not belong to the slaves that
// are known to be there, so one of them is lost or has come back and this is not known yet.
bool RingWatch::find_sides(Network& network) {
    front_end_ = ring_slaves_;
    behind_begin_ = static_cast<std::uint16_t>(ring_slaves_ + 1);
    if (parts().whole) return true;
    const std::size_t front = ring_.reached_by(ring_.head());
    const std::size_t behind = ring_.reached_by(1 - ring_.head());
    std::uint16_t end = 0;
    while (end < ring_slaves_ && there_between(network, 1, end) < front) ++end;
    std::uint16_t begin = static_cast<std::uint16_t>(ring_slaves_ + 1);
    while (begin > 1 && there_between(network, begin, ring_slaves_) < behind) --begin;
    front_end_ = end;
    behind_begin_ = std::max<std::uint16_t>(begin, static_cast<std::uint16_t>(end + 1));
    // Where both parts would have the same slave, one that answers is not known to be there.
    return ring_.counts_are_new() && begin > end && there_between(network, 1, end) == front &&
           there_between(network, begin, ring_slaves_) == behind;
}

bool RingWatch::is_behind(Network& network, const Slave& slave) const {
    if (!has_beside_) return is_behind_front(network, slave);
    const ClockEntry& clock = network.clocks.of(slave);
    return behind_begin_ > ring_slaves_ && front_end_ == ring_slaves_ ? parts().whole && clock.beside
                                                                      : clock.ring_slave >= behind_begin_;
}

// When the frame passes the slave, as the ring is now. For the slaves of each part by itself.
std::int64_t RingWatch::passes_at_ns(Network& network, const Slave& slave) const {
    const ClockEntry& clock = network.clocks.of(slave);
    if (!has_beside_) return slave.ring_position;
    if (!clock.beside || (is_behind(network, slave) && behind_begin_ > ring_slaves_)) return clock.passed_ns;
    const bool behind = is_behind(network, slave);
    const ClockEntry* const at = timed_ring_slave(network, behind ? behind_begin_ : front_end_, behind ? 1 : -1);
    if (at == nullptr) return clock.passed_ns;
    return std::int64_t{clock.passed_ns} - (behind ? at->return_ns : at->away_ns);
}

// Behind a break, the frames pass the branches beside the ring before the ring slaves. A branch that is lost behind the
// second reference makes the way from there to the ring slaves shorter than their delays say, by this at most.
std::int64_t RingWatch::lost_way_ns(Network& network, const Slave& slave) const {
    const ClockEntry& second = network.clocks.entries[second_ - 1U];
    if (!has_beside_ || parts().whole || network.clocks.of(slave).beside || !second.beside) return 0;
    std::int64_t lost_ns = 0;
    for (const Slave& other : network.slaves()) {
        const ClockEntry& clock = network.clocks.of(other);
        if (other.al.state != AlState::none || !clock.beside || !is_behind(network, other)) continue;
        const ClockEntry* const at = timed_ring_slave(network, clock.ring_slave, 1);
        if (at != nullptr && clock.passed_ns > second.passed_ns) lost_ns += at->return_ns;
    }
    return lost_ns;
}

// Whether a frame that was on the wire at the change has brought the slave a wrong time: its register, or that of the
// clock whose time comes, has the delay of the ways before.
bool RingWatch::is_misled(Network& network, const Slave& slave) const {
    const Clocks& clocks = network.clocks;
    const bool behind = is_behind(network, slave);
    const std::uint16_t source = behind ? second_ : clocks.reference;
    if (source == 0 || source == slave.number) return false;
    const Slave& other = network.slave(source);
    if (other.al.state == AlState::none || is_behind(network, other) != behind) return true;
    const std::int64_t now_ns = passes_at_ns(network, slave) - passes_at_ns(network, other);
    const std::int64_t before_ns =
        std::int64_t{clocks.entries[slave.number - 1U].delay_ns} - std::int64_t{clocks.entries[source - 1U].delay_ns};
    return std::abs(now_ns - before_ns) > clocks.settings.limit_ns;
}

// Until it is known where the ring is broken, each clock counts as misled. Then judge_change() finds the clocks that
// are not misled.
void RingWatch::note_change(Network& network) {
    const auto ways = static_cast<std::uint16_t>(ring_.ways());
    if (std::exchange(noted_ways_, ways) == ways) return;
    Clocks& clocks = network.clocks;
    const bool corrected = guessed_ && parts().whole;  // clocks behind the break get the first time of the reference
    if (clocks.reference == 0 || (!has_beside_ && !corrected)) return;
    judges_ = has_beside_;
    for (ClockEntry& clock : clocks.entries.first(network.count)) {
        const bool is_safe =
            has_beside_ ? &clock == &clocks.entries[clocks.reference - 1U] : clock.follows == clocks.reference;
        if (is_safe || !clock.in_sync) continue;
        clock.in_sync = clocks.all_in_sync = false;
        clock.misled = true;
    }
}

void RingWatch::judge_change(Network& network) {
    if (network.clocks.reference == 0) judges_ = false;  // a new scan has forgotten the clocks
    if (!judges_ || !find_sides(network)) return;
    judges_ = false;
    if (is_misled(network, network.slave(network.clocks.reference))) return;  // the others are compared with it
    for (const Slave& slave : network.slaves()) {
        ClockEntry& clock = network.clocks.of(slave);
        if (!clock.misled || is_misled(network, slave)) continue;
        clock.in_sync = true;
        clock.misled = false;
    }
}

Task<Result<>> RingWatch::write_delay(Network& network, Slave& slave, std::int64_t earliest_ns) {
    ClockEntry& clock = network.clocks.of(slave);
    clock.delay_waits |= clock.measured && !clock.synchronised;  // it is being set
    if (!clock.synchronised || !clock.measured) co_return Nothing{};
    // A register of the chip cannot be negative.
    const std::int64_t later = is_behind(network, slave) ? std::max<std::int64_t>(-earliest_ns, 0) : 0;
    const auto delay = static_cast<std::uint32_t>(std::max<std::int64_t>(passes_at_ns(network, slave) + later, 0));
    const bool same = clock.delay_ns == delay && !clock.beside && !clock.delay_waits;
    clock.delay_ns = delay;
    if (same) co_return Nothing{};
    clock.delay_waits = true;  // a slave that is lost, until it is back
    if (slave.al.state == AlState::none) co_return Nothing{};
    co_await required(write_clock_register(network.station(slave), wire::reg::kSystemTimeDelay, delay));
    clock.delay_waits = clock.delay_ns != delay;
    co_return Nothing{};
}

// The clock has not learned the rate, and is kept in step by corrections that are too great; or it runs away faster
// than it is corrected, and then the controller learns no drift.
bool RingWatch::needs_lesson(const Network& network) const {
    if (comparison_ == Comparison::unsure) return true;
    const std::int64_t cycle_ms = network.clocks.settings.watch_interval / std::chrono::milliseconds(1);
    const std::int64_t step_ns = std::abs(std::int64_t{phase_.drift_ppb()}) * cycle_ms / 2000;
    return has_beside_ && comparison_ == Comparison::known &&
           (step_ns > network.clocks.settings.limit_ns / 2 || std::abs(ahead_ns_) > kNear_ns);
}

// A search reads the ports, and teach() closes one. The delays belong to the open ring with its present slaves.
// A slave that frames pass already and that is not brought back yet makes the ways longer; a stranger stays one.
bool RingWatch::may_teach(Network& network) {
    constexpr std::uint8_t kMostRounds = 200;
    if (network.searching || network.clocks.rounds_old != 0 || network.clocks.paused) return false;
    // In a lesson the clocks are not compared. So the master must know before which clocks a new reference misleads.
    const auto is_compared = [](const ClockEntry& clock) {
        return clock.follows == 0 || clock.beside || clock.times_seen >= 2 * ClockEntry::kTimesOfMean;
    };
    if (!std::ranges::all_of(network.clocks.entries.first(network.count), is_compared)) return false;
    const auto is_there = [](const Slave& one) { return one.ring_position != 0 && one.al.state != AlState::none; };
    const auto there = static_cast<std::size_t>(std::ranges::count_if(network.slaves(), is_there));
    const std::size_t seen = std::size_t{ring_.reached_by(0)} + ring_.reached_by(1);
    if (there >= seen) rounds_unsettled_ = 0;
    return there >= seen || rounds_unsettled_ >= kMostRounds || ++rounds_unsettled_ >= kMostRounds;
}

Task<Result<>> RingWatch::teach(Network& network) {
    constexpr unsigned kMostLessons = 5;
    if (comparison_ == Comparison::taught) comparison_ = Comparison::unknown;
    taught_ways_ = ring_.ways();
    bool done = false;
    for (unsigned n = 0; n < kMostLessons && !done; ++n) {
        const std::uint16_t reference = network.clocks.reference;
        const auto greatest = co_await required(teach_once(network));
        done = greatest <= network.clocks.settings.limit_ns / 4 && network.clocks.reference == reference;
    }
    if (done) comparison_ = Comparison::taught;
    co_return Nothing{};
}

// The clocks beside a whole ring, before they follow a reference of their own: while the ring is open, the copy of the
// head brings them the time of the reference. Then the constant of their first clock is measured.
Task<Result<>> RingWatch::teach_beside(Network& network) {
    constexpr unsigned kComparisons = 32;
    co_await required(teach(network));
    co_await required(arrange(network));
    for (unsigned n = 0; n < kComparisons; ++n) co_await required(send_time(network));
    co_return co_await required(steer(network));
}

RingWatch::Constant RingWatch::present_constant() const {
    return {.slave = second_,
            .front = static_cast<std::uint16_t>(parts().front),
            .behind = ring_.reached_by(1 - ring_.head()),
            .head = static_cast<std::uint16_t>(ring_.head()),
            .ns = constant_ns_};
}

const RingWatch::Constant* RingWatch::known_constant() const {
    const Constant now = present_constant();
    const auto known = std::span(constants_).subspan(parts().whole ? 0 : 1, parts().whole ? 1 : constants_.size() - 1);
    const auto found = std::ranges::find_if(known, [&now](const Constant& one) {
        return one.slave == now.slave && one.front == now.front && one.behind == now.behind && one.head == now.head;
    });
    return second_ == 0 || found == known.end() ? nullptr : &*found;
}

// The constant contains the delay of the reference, and not that of the second reference.
Task<Result<>> RingWatch::find_constant(Network& network) {
    const Clocks& clocks = network.clocks;
    // A slave has appeared during the lesson, which is seen when both copies come back again.
    if (comparison_ == Comparison::taught && ring_.ways() != taught_ways_) comparison_ = Comparison::unknown;
    const std::uint16_t second = second_;
    const std::int64_t mean_ns = first_.sum_ns / first_.count;
    const std::int64_t jitter_ns = std::int64_t{first_.most_ns} - first_.least_ns;
    first_ = {};
    constant_ns_ = mean_ns + clocks.entries[second - 1U].delay_ns;
    const bool in_step = is_in_step(network);
    if (in_step) constant_ns_ -= carried_ns(us_of(network.engine.now()));
    const Constant* const whole =
        in_step && parts().whole && comparison_ != Comparison::taught ? known_constant() : nullptr;
    if (whole != nullptr && std::abs(constant_ns_ - whole->ns) > clocks.settings.limit_ns + jitter_ns / 2)
        lose_behind(network);  // it is not in step, or a NIC needs another time: a lesson shows it
    else if (whole != nullptr)
        constant_ns_ = whole->ns;
    if (!is_in_step(network) && has_beside_) {
        // The ways are not measured with clocks beside the ring. In the whole ring they are taught; behind a break the
        // clocks stay where they are, and are not in sync.
        begin_to_steer(network);
        comparison_ = Comparison::unsure;
        if (!std::exchange(learns_, false)) rests_ = 0;
        co_return Nothing{};
    }
    if (!is_in_step(network)) {
        const Slave& reference = network.slave(clocks.reference);
        if (!are_places_new(network)) co_return Nothing{};  // the next differences
        const auto way = co_await measure_way(network, network.slave(second), reference);
        // The ring changes now, or there is another second reference: the next differences show the constant.
        if (!way && way.error().code == Errc::unstable) co_return Nothing{};
        if (!way) co_return way.error();
        if (second != second_ || is_steered() || reference.number != clocks.reference) co_return Nothing{};
        constant_ns_ = *way + clocks.entries[reference.number - 1U].delay_ns;
    }
    (void)ring_.take_difference();
    constants_[parts().whole ? 0 : 1 + next_constant_++ % (constants_.size() - 1)] = present_constant();
    begin_to_steer(network);
    ahead_ns_ = mean_ns - (constant_ns_ - clocks.entries[second - 1U].delay_ns);
    co_return Nothing{};
}

// How far the second reference was ahead when the first differences were measured, if it is the same clock as before
// the change. It has run at its rate since the last correction.
std::int64_t RingWatch::carried_ns(std::uint32_t now_us) const {
    if (!carried_) return 0;
    const std::int64_t since_us = std::uint32_t{now_us - steered_us_} - std::uint32_t{now_us - first_us_} / 2;
    const std::int64_t ahead_ns = std::abs(ahead_ns_) <= jitter_ns_ / 2 ? 0 : ahead_ns_;  // as in followed_clock()
    return ahead_ns - moved_ns_ + phase_.drift_ppb() * since_us / 1'000'000;
}

// A branch behind the break is lost, or back: the way of the second copy is another one, and the constant too.
bool RingWatch::end_constant(Network& network) {
    const std::uint16_t behind = ring_.reached_by(1 - ring_.head());
    const bool known = ring_.counts_are_new() && behind != 0;
    if (!known || std::exchange(compared_behind_, behind) == behind) return false;
    carried_ |= comparison_ == Comparison::known && rounds_deaf_ < kDeaf;
    if (comparison_ == Comparison::known) comparison_ = Comparison::unknown;
    first_ = {};
    use_known_constant(network);
    return true;
}

// Gives all clocks the delays of the ways as they are now, and the part that the head does not reach its reference.
// Until then, no clock gets a time.
Task<Result<>> RingWatch::arrange(Network& network) {
    constexpr std::uint8_t kMostRounds = 20;  // then the order that fits the counts best is used
    const std::uint32_t ways = ring_.ways();
    if (!find_sides(network) && ++rounds_unclear_ < kMostRounds) co_return Nothing{};
    judges_ = false;  // the registers change now
    std::int64_t earliest = 0;
    for (const Slave& slave : network.slaves())
        if (network.clocks.of(slave).synchronised && is_behind(network, slave))
            earliest = std::min(earliest, passes_at_ns(network, slave));
    const auto write = [this, &network, earliest](Slave& s) { return write_delay(network, s, earliest); };
    co_await required(for_each_slave(network, write));
    if (ring_.ways() != ways) co_return Nothing{};  // the next round
    rounds_unclear_ = 0;
    // In the whole ring, a clock that was away is taught first: until then there is no second reference.
    const std::uint16_t wanted = first_behind(network, !network.segment_in_use);  // in configdc(): all are below SAFEOP
    const bool ready = !parts().whole || wanted == second_ || comparison_ == Comparison::taught || wanted == 0 ||
                       network.clocks.entries[wanted - 1U].is_in_step();
    co_await required(change_second(network, ready ? wanted : std::uint16_t{0}));
    if (ring_.ways() != ways) co_return Nothing{};
    first_ = {};  // differences with the old and with the new delays give a wrong constant
    (void)end_constant(network);
    arranged_ = true;
    ring_.release_times();
    co_return Nothing{};
}

}  // namespace margay
