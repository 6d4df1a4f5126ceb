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

// Where the ring is broken, by the slaves that answer to each copy. False: the counts do not fit the slaves that are
// known to be present. So a slave was lost or has come back, and this is not known yet.
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
    // A slave that answers and is not known to be present is in the part whose count does not fit.
    if (there_between(network, 1, end) != front && there_between(network, begin, ring_slaves_) == behind)
        end = std::min(end, static_cast<std::uint16_t>(begin - 1));
    front_end_ = end;
    behind_begin_ = std::max<std::uint16_t>(begin, static_cast<std::uint16_t>(end + 1));
    // If the same slave would belong to both parts, a slave answers that is not known to be present.
    return ring_.counts_are_new() && begin > end && there_between(network, 1, end) == front &&
           there_between(network, begin, ring_slaves_) == behind;
}

bool RingWatch::is_behind(Network& network, const Slave& slave) const {
    if (!has_beside_) return is_behind_front(network, slave);
    const ClockEntry& clock = network.clocks.of(slave);
    return behind_begin_ > ring_slaves_ && front_end_ == ring_slaves_ ? parts().whole && clock.beside
                                                                      : clock.ring_slave >= behind_begin_;
}

// When the frame passes the slave in the present ring. Only the times of slaves in the same part can be compared.
std::int64_t RingWatch::passes_at_ns(Network& network, const Slave& slave) const {
    const ClockEntry& clock = network.clocks.of(slave);
    if (!has_beside_) return slave.ring_position;
    if (!clock.beside || (is_behind(network, slave) && behind_begin_ > ring_slaves_)) return clock.passed_ns;
    const bool behind = is_behind(network, slave);
    const ClockEntry* const at = timed_ring_slave(network, behind ? behind_begin_ : front_end_, behind ? 1 : -1);
    if (at == nullptr) return clock.passed_ns;
    return std::int64_t{clock.passed_ns} - (behind ? at->return_ns : at->away_ns);
}

// Behind a break, the frames pass the branches beside the ring before the ring slaves. If a branch behind the second
// reference is lost, the way from the second reference to the ring slaves is shorter than their delays, by the returned
// time at most.
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

// Whether a frame that was on the wire at the change may have brought the slave a wrong time, because the delay
// register of the slave, or of the clock that it follows, still has the delay of the earlier way.
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
    if (!has_beside_ && parts().whole) lose_own_rate(network);
    // The clocks behind the break now receive the time of the reference for the first time.
    const bool corrected = guessed_ && parts().whole;
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
    // The other clocks are compared with the reference.
    if (is_misled(network, network.slave(network.clocks.reference))) return;
    for (const Slave& slave : network.slaves()) {
        ClockEntry& clock = network.clocks.of(slave);
        if (!clock.misled || is_misled(network, slave)) continue;
        clock.in_sync = true;
        clock.misled = false;
    }
}

Task<Result<>> RingWatch::write_delay(Network& network, Slave& slave, std::int64_t earliest_ns) {
    ClockEntry& clock = network.clocks.of(slave);
    clock.delay_waits |= clock.measured && !clock.synchronised;  // the clock is being set
    if (!clock.synchronised || !clock.measured) co_return Nothing{};
    // A register of the chip cannot be negative.
    const std::int64_t later = is_behind(network, slave) ? std::max<std::int64_t>(-earliest_ns, 0) : 0;
    const auto delay = static_cast<std::uint32_t>(std::max<std::int64_t>(passes_at_ns(network, slave) + later, 0));
    const bool same = clock.delay_ns == delay && !clock.beside && !clock.delay_waits;
    clock.delay_ns = delay;
    if (same) co_return Nothing{};
    clock.delay_waits = true;  // the delay of a lost slave is written when the slave is back
    if (slave.al.state == AlState::none) co_return Nothing{};
    co_await required(write_clock_register(network.station(slave), wire::reg::kSystemTimeDelay, delay));
    clock.delay_waits = clock.delay_ns != delay;
    co_return Nothing{};
}

// Whether the second reference needs a lesson: it has not learned the rate, and only large corrections keep it in step;
// or it drifts away faster than the corrections, so that the controller cannot learn the drift.
bool RingWatch::needs_lesson(const Network& network) const {
    if (comparison_ == Comparison::unsure) return true;
    const std::int64_t cycle_ms = network.clocks.settings.watch_interval / std::chrono::milliseconds(1);
    const std::int64_t step_ns = std::abs(std::int64_t{phase_.drift_ppb()}) * cycle_ms / 2000;
    return has_beside_ && comparison_ == Comparison::known &&
           (step_ns > network.clocks.settings.limit_ns / 2 || std::abs(ahead_ns_) > kNear_ns);
}

// Whether a lesson is possible now. A search reads the ports of the slaves, and teach() closes one of them. The delays
// must belong to the open ring with its present slaves. A slave that has come back and is not readmitted yet makes the
// ways longer. A slave that is reported as a stranger does not prevent a lesson.
bool RingWatch::may_teach(Network& network) {
    constexpr std::uint8_t kMostRounds = 200;
    if (network.searching || network.clocks.rounds_old != 0 || network.clocks.paused) return false;
    // During a lesson the clocks are not compared. So each clock must have been compared with its present reference
    // before the lesson.
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

// Prepares the clocks beside a whole ring before they follow the second reference. While the ring is open, the copy of
// the head brings these clocks the time of the reference. Then the constant of the first of these clocks is measured.
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

// The constant contains the delay of the reference, and not the delay of the second reference.
Task<Result<>> RingWatch::find_constant(Network& network) {
    const Clocks& clocks = network.clocks;
    // If the number of slaves has changed during the lesson, this is known when both copies come back again.
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
        lose_behind(network);  // the clock is not in step, or the time of a NIC has changed: a lesson shows which
    else if (whole != nullptr)
        constant_ns_ = whole->ns;
    if (!is_in_step(network) && has_beside_) {
        // If there are clocks beside the ring, the ways are not measured. In the whole ring a lesson brings these
        // clocks in step. Behind a break the clocks keep their difference, and are not in sync.
        begin_to_steer(network);
        comparison_ = Comparison::unsure;
        if (!std::exchange(learns_, false)) lesson_rounds_ = 0;
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

// How far the second reference was ahead when the first differences were measured, if the change has kept the second
// reference. Since the last correction the clock has run at its own rate.
std::int64_t RingWatch::carried_ns(std::uint32_t now_us) const {
    if (!carried_) return 0;
    const std::int64_t since_us = std::uint32_t{now_us - steered_us_} - std::uint32_t{now_us - first_us_} / 2;
    const std::int64_t ahead_ns = std::abs(ahead_ns_) <= jitter_ns_ / 2 ? 0 : ahead_ns_;  // as in followed_clock()
    return ahead_ns - moved_ns_ + phase_.drift_ppb() * since_us / 1'000'000;
}

// Ends the constant if a branch behind the break was lost or has come back: then the way of the second copy has
// changed, and so has the constant.
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

// Writes the delays of the present ways to all clocks, and sets the second reference for the clocks that the copy of
// the head does not reach. Until this is done, no frame carries a time.
Task<Result<>> RingWatch::arrange(Network& network) {
    constexpr std::uint8_t kMostRounds = 20;  // after these rounds, the best division that was found is used
    const std::uint32_t ways = ring_.ways();
    if (!find_sides(network) && ++rounds_unclear_ < kMostRounds) co_return Nothing{};
    judges_ = false;  // the delay registers change now
    std::int64_t earliest = 0;
    for (const Slave& slave : network.slaves())
        if (network.clocks.of(slave).synchronised && is_behind(network, slave))
            earliest = std::min(earliest, passes_at_ns(network, slave));
    const auto write = [this, &network, earliest](Slave& s) { return write_delay(network, s, earliest); };
    co_await required(for_each_slave(network, write));
    if (ring_.ways() != ways) co_return Nothing{};  // the next round tries again
    rounds_unclear_ = 0;
    // In the whole ring, a clock that was away needs a lesson first. Until then there is no second reference. During
    // configdc() all slaves are below SAFEOP.
    const std::uint16_t wanted = first_behind(network, !network.segment_in_use);
    const bool ready = !parts().whole || wanted == second_ || comparison_ == Comparison::taught || wanted == 0 ||
                       network.clocks.entries[wanted - 1U].is_in_step();
    co_await required(change_second(network, ready ? wanted : std::uint16_t{0}));
    if (ring_.ways() != ways) co_return Nothing{};
    first_ = {};  // do not mix differences with old and with new delays
    (void)end_constant(network);
    arranged_ = true;
    ring_.release_times();
    co_return Nothing{};
}

}  // namespace margay
