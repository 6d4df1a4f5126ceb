// Which time reaches the clock of a slave, and how far a clock is from the reference. "In sync" in
// src/network/README.md says what follows from it.
#include "clock/system_time.hpp"
#include "network/clock_restore.hpp"
#include "network/network.hpp"
#include "network/wanted.hpp"
#include "util/scoped_flag.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace margay {
namespace {

bool is_there(const Slave& slave) { return slave.al.state != AlState::none; }

bool is_before_reference(Network& network, const Slave& slave) {
    return slave.ring_position != 0 && slave.ring_position < network.slave(network.clocks.reference).ring_position;
}

// How many frames have brought the time of the reference since the last round: frames of the cycle, and others. After
// rounds that were left out, frames of the cycle are counted only if the last cycle has brought the time, because the
// other cycles may be old.
std::uint32_t times_since_last_round(Network& network, std::int64_t rounds) {
    Clocks& clocks = network.clocks;
    const std::uint32_t sent = std::exchange(clocks.times_sent, std::uint16_t{0});
    for (const ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.dc_reference != clocks.reference) continue;
        const std::uint16_t now = cycles_with_time(group);
        const auto times = static_cast<std::int16_t>(now - std::exchange(clocks.times_seen, now));
        const bool recent = rounds == 1 || (group.dc_time.came && group.dc_time.slaves != 0);
        // A negative number: the group was mapped again, and its count has started again.
        return sent + (times > 0 && recent ? static_cast<std::uint32_t>(times) : 0U);
    }
    return sent;
}

// After how many frames a great difference ends `in_sync`, although the register still shows old comparisons too. With
// long cycles, the frames of a mean take too long. After five frames the register shows a quarter of the difference.
std::uint8_t find_grace(const Network& network) {
    constexpr Duration kLongest = std::chrono::milliseconds(100);
    constexpr std::int64_t kLeast = 5;
    std::int64_t times = ClockEntry::kTimesOfMean;
    for (const ProcessGroup& group : network.process.groups) {
        const bool carries = group.mapped && group.dc_reference == network.clocks.reference;
        if (!carries || group.pace.before == Time::min() || group.pace.last <= group.pace.before) continue;
        times = std::min<std::int64_t>(times, kLongest / (group.pace.last - group.pace.before));
    }
    return static_cast<std::uint8_t>(std::max(times, kLeast));
}

// Whether the clock follows a second reference that is not in sync, or that may be farther from the reference than the
// limit.
bool is_led_away(const Clocks& clocks, const Slave& slave, const FollowedClock& followed) {
    if (followed.slave == 0 || followed.slave == clocks.reference) return false;
    const bool by_another = followed.slave != slave.number && !clocks.entries[followed.slave - 1U].is_in_step();
    return by_another || std::abs(followed.ahead_ns) + followed.moves_ns > clocks.settings.limit_ns;
}

}  // namespace

void Clocks::forget() {
    for (ClockEntry& entry : entries) entry.reset();
    reference = rate_of = returning = 0;
    measuring = all_in_sync = paused = loss_reported = is_driven = is_paced = trusts_next = false;
    without_time = odd_times = 0;
    times_seen = times_sent = 0;
    greatest_ns = 0;
    paced_ns = 0;
    cycle = {};
    shifted_ns = shift_mean = 0;
    shifted_far = false;
    delays_at = Time::min();
    prepare = nullptr;
    watch = nullptr;
    retry_rounds = rounds_old = 0;
    is_near = nullptr;
    resume = nullptr;
    begin_cycles = nullptr;
}

// Before configdc(), only the features register shows whether a slave has a clock.
std::uint16_t clock_before(Network& network, std::uint16_t reference) {
    const Clocks& clocks = network.clocks;
    if (reference != 0 && reference <= network.count && !network.slave(reference).dl.dc) return 0;
    for (const RingPlace& place : network.seen_ring()) {
        if (place.slave == reference) return 0;
        if (place.slave == 0 || place.slave > network.count) continue;
        const bool unknown = clocks.entries.empty() || clocks.entries[place.slave - 1U].kind == ClockKind::unknown;
        const bool has_clock =
            unknown ? network.slave(place.slave).dl.dc : is_clock(clocks.entries[place.slave - 1U].kind);
        if (has_clock) return place.slave;
    }
    return 0;
}

void note_sync_cycles(Network& network, std::uint64_t cycle_ns, std::uint64_t tolerance) {
    if (cycle_ns == 0 || network.clocks.entries.empty()) return;
    for (const Slave& slave : network.slaves()) {
        ClockEntry& clock = network.clocks.of(slave);
        const std::uint64_t sync0_ns = clock.sync.sync0_cycle_ns;
        if (!clock.sync_active || clock.sync.misfit_told || sync0_ns == 0) continue;
        const std::uint64_t longer = std::max(sync0_ns, cycle_ns);
        const std::uint64_t shorter = std::min(sync0_ns, cycle_ns);
        const std::uint64_t rest = std::min(longer % shorter, shorter - longer % shorter);
        if (longer % shorter == 0 || rest <= longer / tolerance) continue;
        clock.sync.misfit_told = true;
        network.note({.code = Errc::invalid_argument,
                      .step = Step::configure_sync,
                      .slave = slave.number,
                      .detail = static_cast<std::uint32_t>(Argument::sync_cycle),
                      .expected = static_cast<std::uint32_t>(cycle_ns),
                      .actual = clock.sync.sync0_cycle_ns});
    }
}

void MeasuredCycle::note(Time sent_at, std::uint32_t number) {
    constexpr std::uint64_t kAlike = 50;
    const std::uint32_t cycles = number - seen;
    if (begin != Time::min() && cycles == 0) return;
    if (begin == Time::min() || sent_at <= last) {
        *this = {};
        if (sent_at != Time::min()) begin = last = sent_at;
        first = seen = number;
        return;
    }
    const std::uint64_t each_ns = static_cast<std::uint64_t>((sent_at - last).count()) / cycles;
    last = sent_at;
    seen = number;
    ++rounds;
    const std::uint64_t away = each_ns > likely_ns ? each_ns - likely_ns : likely_ns - each_ns;
    if (votes == 0) likely_ns = each_ns;
    votes += votes == 0 || away <= likely_ns / kAlike ? 1 : -1;
}

// If the application has stopped once, or leaves out cycles, the mean is not the cycle of the application. Such a mean
// differs from the cycle that most rounds have measured.
std::uint64_t MeasuredCycle::steady_ns() const {
    constexpr std::uint64_t kAlike = 100;
    if (seen == first || 2 * votes < static_cast<std::int32_t>(rounds)) return 0;
    const std::uint64_t mean_ns = static_cast<std::uint64_t>((last - begin).count()) / (seen - first);
    const std::uint64_t away = mean_ns > likely_ns ? mean_ns - likely_ns : likely_ns - mean_ns;
    return away <= likely_ns / kAlike ? mean_ns : 0;
}

void note_cycle_time(Network& network) {
    constexpr Duration kLong = std::chrono::seconds(2);
    constexpr std::uint32_t kManyRounds = 16;
    constexpr std::uint64_t kMeasured = 50;
    Clocks& clocks = network.clocks;
    MeasuredCycle& cycle = clocks.cycle;
    // The cycle of MasterClock is used. If MasterClock has ended since, the cycle is measured from now on.
    if (std::exchange(clocks.is_paced, false)) {
        note_sync_cycles(network, clocks.paced_ns, UINT64_MAX);
        cycle = {};
        return;
    }
    for (const ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.dc_reference != clocks.reference) continue;
        const bool overlap = group.overlap.sets > 1;
        const Time sent_at = overlap ? network.engine.link().last_cycle() : group.pace.last;
        cycle.note(sent_at, overlap ? group.cycle_received : sent_cycles(group));
        if (cycle.rounds < kManyRounds || cycle.last - cycle.begin < kLong) return;
        note_sync_cycles(network, cycle.steady_ns(), kMeasured);
        cycle = {};
        return;
    }
}

// While the chosen reference is lost, the chosen reference has no place in the ring. A slave that is seen for the first
// time then may be before or behind it. This is known when the reference is back, see set_late_clock().
bool note_reach(Network& network, Slave& slave) {
    const Clocks& clocks = network.clocks;
    ClockEntry& clock = network.clocks.of(slave);
    const std::uint16_t chosen = clocks.settings.reference;
    if (chosen == 0 || chosen == slave.number || !is_clock(clock.kind) || slave.ring_position == 0)
        return clock.out_of_reach;
    const std::uint16_t of_chosen = network.slave(chosen).ring_position;
    const bool unseen = of_chosen == 0 && !clock.measured && is_before_reference(network, slave);
    const bool before = of_chosen != 0 ? slave.ring_position < of_chosen : clock.out_of_reach;
    if (before && !clock.out_of_reach)
        network.report({.kind = EventKind::clock_not_reached, .slave = slave.number, .other = chosen});
    clock.out_of_reach = before;
    if (before || unseen) network.clocks.begin_cycles = begin_by_reading;
    if (before || unseen) clock.synchronised = clock.in_sync = clock.misled = false;
    return before || unseen;
}

bool any_unsynchronised(Network& network) {
    const auto is_unexpected = [](const RingPlace& place) { return place.slave == 0; };
    if (std::ranges::any_of(network.seen_ring(), is_unexpected)) return true;
    return std::ranges::any_of(network.slaves(), [&network](const Slave& slave) {
        const ClockEntry& clock = network.clocks.of(slave);
        return is_there(slave) && !clock.synchronised && (clock.kind == ClockKind::unknown || is_clock(clock.kind));
    });
}

FollowedClock followed_clock(Network& network, const Slave& slave) {
    const Clocks& clocks = network.clocks;
    const Slave& reference = network.slave(clocks.reference);
    if (slave.number == reference.number) return {.slave = slave.number};
    if (!is_there(reference) || slave.ring_position == 0) return {};
    if (network.redundancy != nullptr) return network.redundancy->followed_clock(network, slave);
    return {.slave = is_before_reference(network, slave) ? std::uint16_t{0} : clocks.reference};
}

void note_followed_clocks(Network& network, std::int64_t rounds) {
    constexpr Duration kLongestAlone = std::chrono::seconds(1);
    Clocks& clocks = network.clocks;
    const std::uint32_t times = times_since_last_round(network, rounds);
    clocks.times_of_grace = find_grace(network);
    const bool old = find_old_delays(network);
    clocks.rounds_old = old ? static_cast<std::uint8_t>(std::min(clocks.rounds_old + 1, UINT8_MAX)) : std::uint8_t{0};
    for (const Slave& slave : network.slaves()) {
        ClockEntry& clock = clocks.of(slave);
        if (!clock.synchronised) continue;
        const FollowedClock followed = is_there(slave) ? followed_clock(network, slave) : FollowedClock{};
        const std::uint16_t before = std::exchange(clock.follows, followed.slave);
        // The source has changed again before the clock was compared with the last source: the clock may be disturbed.
        const bool unknown = before != 0 && before != followed.slave && clock.times_seen < ClockEntry::kTimesOfMean;
        if (before != followed.slave) clock.times_seen = 0;
        const bool fed = followed.slave != 0 && !followed.silent && (times != 0 || slave.number == clocks.reference);
        clock.rounds_alone =
            fed ? std::uint8_t{0}
                : static_cast<std::uint8_t>(std::min<std::int64_t>(clock.rounds_alone + rounds, UINT8_MAX));
        if (fed)
            clock.times_seen = static_cast<std::uint8_t>(std::min<std::uint32_t>(clock.times_seen + times, UINT8_MAX));
        // While no time arrives, the register of the clock only shows old comparisons.
        const bool alone =
            clock.rounds_alone == UINT8_MAX || clock.rounds_alone * clocks.settings.watch_interval >= kLongestAlone;
        if (!is_there(slave)) {
            clock.lose_sync();  // all present clocks may still be in sync
            clock.told_in_sync = false;
        } else if (alone || clock.delay_old || unknown || is_led_away(clocks, slave, followed)) {
            clocks.lose_sync(slave);
        }
    }
}

Task<Result<std::int64_t>> measure_ahead(Network& network, Slave& slave, Slave& reference) {
    Clocks& clocks = network.clocks;
    const auto way_ns = co_await required(measure_way(network, slave, reference));
    while (clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const ScopedFlag measuring(clocks.measuring);
    (void)find_frame_ways(network);
    co_await required(latch_receive_times(network));
    co_await required(read_receive_times(network, slave, Keep::no));
    co_await required(read_receive_times(network, reference, Keep::no));
    const ClockEntry& source = clocks.of(reference);
    const ClockEntry& clock = clocks.of(slave);
    const std::uint64_t ahead =
        clock.local_ns + clock.offset_ns - (source.local_ns + source.offset_ns + static_cast<std::uint64_t>(way_ns));
    co_return std::int64_t{static_cast<std::int32_t>(ahead)};  // some clocks have 32 bits
}

Task<Result<bool>> settle_rate(Network& network, Slave& slave) {
    co_await required(read_difference(network, slave));
    if (std::abs(std::int64_t{network.clocks.of(slave).difference_ns}) <= network.clocks.settings.limit_ns)
        co_return false;
    network.clocks.of(slave).knows_rate = false;
    co_await required(reset_control_loop(network.station(slave)));
    co_return true;
}

Task<Result<>> move_clock(Network& network, Slave& slave, std::int64_t by_ns) {
    ClockEntry& clock = network.clocks.of(slave);
    clock.offset_ns += static_cast<std::uint64_t>(by_ns);
    wire::Register offset = wire::reg::kSystemTimeOffset;
    if (clock.kind == ClockKind::bits32) offset.length = 4;
    co_return co_await required(write_clock_register(network.station(slave), offset, clock.offset_ns));
}

namespace {

// The slave is in its state, and no sequence works on the slave. Below SAFEOP, a slave that has come back may not have
// its clock yet.
bool is_settled(Network& network, const Slave& slave) {
    return is_there(slave) && !slave.al.error && !network.marks(slave.number).in_use &&
           (slave.al.state >= AlState::safeop || slave.al.state == wanted_state(network, slave));
}

// The token of the slave that becomes the reference again.
using ReturnToken = std::optional<SlaveToken>;

// Whether the slave still returns to the same reference. While the slave learns, its token is free: the supervision
// sees what happens to the slave, and a request may change the slave.
bool still_returns(Network& network, const Slave& slave, std::uint16_t reference) {
    return network.clocks.reference == reference && is_there(network.slave(reference)) && !network.segment_in_use &&
           is_settled(network, slave) && is_before_reference(network, slave);
}

// Sends frames with the time until the slave has followed the time. The last comparison must be within the limit: the
// register keeps this comparison while the slave is the reference, see check_reference().
Task<Result<>> teach_time(Network& network, Slave& slave, ReturnToken* token) {
    const std::uint16_t reference = network.clocks.reference;
    const auto ends = [&] {  // by odd times: the reference was reset perhaps, see send_time()
        return network.clocks.odd_times > 2 || (token != nullptr && !still_returns(network, slave, reference));
    };
    const Error ended{.code = Errc::unstable, .slave = slave.number};
    if (token != nullptr) token->reset();
    constexpr unsigned kLeast = 200, kMost = 400;
    const std::int64_t limit_ns = network.clocks.settings.limit_ns;
    std::int64_t away_ns = limit_ns;
    for (unsigned frame = 0; frame < kLeast || (frame < kMost && away_ns > limit_ns / 2); ++frame) {
        // With the frame of the same cycle: another cycle without a comparison would make the slave learn later.
        Crew sending(1);
        if (!sending.start(send_time(network))) co_return Error{.code = Errc::capacity, .detail = Error::kTasks};
        Result<> read;
        if (frame + 1 >= kLeast) read = co_await read_difference(network, slave);
        co_await sending.all();
        if (ends()) co_return ended;
        if (!read) co_return read;
        if (frame + 1 < kLeast) continue;
        away_ns = std::abs(std::int64_t{network.clocks.of(slave).difference_ns});
    }
    if (ends()) co_return ended;
    if (token != nullptr) token->emplace(network.marks(slave));
    co_return Nothing{};
}

// Two clocks have the same rate if their difference changes by kMostChange_ns at most in kRateLook: 2.5 ppm.
constexpr Duration kRateLook = std::chrono::milliseconds(20);
constexpr std::int64_t kMostChange_ns = 50;

// Teaches the slave the rate of the reference, at which the other clocks run. If the new reference had another rate,
// the other clocks would leave the limit until they have learned the new rate. Receive times show the rate without the
// jitter of the master. `token` is free during the lessons; nullptr: the caller holds a token.
struct Lesson {
    std::int64_t ahead_ns = 0;  // how far the slave is ahead now
    bool learned = false;       // false: the slave has its own rate
};
Task<Result<Lesson>> teach_rate(Network& network, Slave& slave, Slave& reference, ReturnToken* token) {
    constexpr unsigned kMostLessons = 8;
    const std::int64_t limit_ns = network.clocks.settings.limit_ns;
    // With long cycles a lesson takes seconds, because each frame waits for the next one.
    constexpr Duration kLongest = std::chrono::seconds(6);
    const Time give_up = later(network.engine.now(), kLongest);
    for (unsigned lessons = 0;; ++lessons) {
        const auto before = co_await required(measure_ahead(network, slave, reference));
        co_await network.engine.sleep_for(kRateLook);
        const auto ahead = co_await required(measure_ahead(network, slave, reference));
        co_await required(read_difference(network, slave));
        const bool compared_well = std::abs(std::int64_t{network.clocks.of(slave).difference_ns}) <= limit_ns;
        const bool learned = compared_well && std::abs(ahead - before) <= kMostChange_ns;
        if (!learned && lessons < kMostLessons && network.engine.now() < give_up) {
            co_await required(teach_time(network, slave, token));
            continue;
        }
        if (!learned) co_await required(reset_control_loop(network.station(slave)));
        co_return Lesson{ahead, learned};
    }
}

}  // namespace

Task<Result<bool>> learn_rate(Network& network, Slave& slave, Slave& reference) {
    const auto lesson = co_await required(teach_rate(network, slave, reference, nullptr));
    if (std::abs(lesson.ahead_ns) > kNear_ns) co_return Error{.code = Errc::unstable};  // the reference was reset
    co_await required(move_clock(network, slave, -lesson.ahead_ns));
    co_return lesson.learned;
}

namespace {

// The first clock that is before the reference, and may be the reference.
Slave* first_before_reference(Network& network) {
    Slave* first = nullptr;
    for (Slave& slave : network.slaves()) {
        const ClockEntry& clock = network.clocks.of(slave);
        if (!is_settled(network, slave) || !clock.measured || !is_clock(clock.kind) || clock.beside ||
            !is_before_reference(network, slave) || note_reach(network, slave) ||
            is_way_unknown(network, slave, network.slave(network.clocks.reference)))
            continue;
        if (first == nullptr || slave.ring_position < first->ring_position) first = &slave;
    }
    return first;
}

// In a ring with two NICs the slave does not learn the rate of the reference. Returns how far the slave is ahead.
Task<Result<std::int64_t>> compare_rate(Network& network, Slave& slave, Slave& reference, std::int64_t before_ns) {
    co_await network.engine.sleep_for(kRateLook);
    const auto ahead = co_await required(measure_ahead(network, slave, reference));
    if (std::abs(ahead - before_ns) > kMostChange_ns) lose_sync_of_others(network, slave);
    co_return ahead;
}

// Stops the time, and moves the clock of the slave to the time of the reference. True: the clock shows this time.
Task<Result<bool>> approach_reference(Network& network, Slave& slave, ReturnToken& token) {
    constexpr std::int64_t kMostStep_ns = 6'000;
    constexpr unsigned kMostSteps = 50;
    Clocks& clocks = network.clocks;
    const bool begins = clocks.returning != slave.number;
    if (begins) {
        // Perhaps a slave that is being recovered becomes the reference now.
        if (network.redundancy == nullptr && clocks.paused) co_return Error{.code = Errc::busy, .slave = slave.number};
        clocks.returning = slave.number;
        if (!carry_time_of(network, nullptr)) co_return Error{.code = Errc::busy, .slave = slave.number};
        // While the slave took the time that the master has sent, its rate has followed the jitter of the master.
        if (network.redundancy != nullptr) co_await required(settle_rate(network, slave));
    }
    const std::uint16_t reference = clocks.reference;
    const auto is_other = [&] {
        return clocks.reference != reference || !is_there(slave) || !is_before_reference(network, slave);
    };
    auto ahead = co_await required(measure_ahead(network, slave, network.slave(reference)));
    // With two NICs the slave does not learn the rate: until the next round, its clock would run farther than a step.
    for (unsigned n = 0; network.redundancy != nullptr && n < kMostSteps; ++n) {
        if (is_other() || std::abs(ahead) > kNear_ns || std::abs(ahead) <= kMostStep_ns) break;
        co_await required(move_clock(network, slave, ahead > 0 ? -kMostStep_ns : kMostStep_ns));
        ahead = co_await required(measure_ahead(network, slave, network.slave(reference)));
    }
    if (is_other()) co_return Error{.code = Errc::unstable, .slave = slave.number};
    if (std::abs(ahead) > kNear_ns || !clocks.of(slave).synchronised) {
        constexpr std::uint8_t kRetryRounds = 100;
        clocks.returning = 0;
        clocks.paused = false;               // become_reference() itself stops the time
        clocks.retry_rounds = kRetryRounds;  // if this fails
        const bool sync = clocks.of(slave).sync_active;
        co_await required(become_reference(network, slave, ClockRate::own));
        if (sync) co_await required(prepare_clock(network, slave));
        co_return false;
    }
    const bool learns = begins && network.redundancy == nullptr;
    std::int64_t away = ahead;
    if (learns) {
        const auto lesson = co_await required(teach_rate(network, slave, network.slave(reference), &token));
        if (!lesson.learned) lose_sync_of_others(network, slave);
        away = lesson.ahead_ns;
    }
    if (network.redundancy != nullptr && std::abs(ahead) <= kMostStep_ns)
        away = co_await required(compare_rate(network, slave, network.slave(reference), ahead));
    if (is_other()) co_return Error{.code = Errc::unstable, .slave = slave.number};
    co_await required(move_clock(network, slave, -std::clamp(away, -kMostStep_ns, kMostStep_ns)));
    co_return std::abs(away) <= kMostStep_ns;
}

}  // namespace

Task<Result<>> return_to_first_clock(Network& network) {
    // Value of Clocks::returning: the next round begins to bring a slave to the reference. With one NIC the slave
    // learns the rate of the reference, which takes seconds: from the next round on, the supervision calls the watch
    // beside its own rounds.
    constexpr std::uint16_t kAnnounced = UINT16_MAX;
    Clocks& clocks = network.clocks;
    const bool allowed = network.redundancy == nullptr || network.redundancy->may_restore();
    const bool waits = clocks.retry_rounds != 0 && --clocks.retry_rounds != 0;
    Slave* const first = allowed && !waits ? first_before_reference(network) : nullptr;
    Result<bool> is_at_reference = false;
    if (first != nullptr) {
        if (clocks.measuring) co_return Nothing{};
        if (network.redundancy == nullptr && clocks.returning == 0) {
            clocks.returning = kAnnounced;
            co_return Nothing{};
        }
        ReturnToken token(std::in_place, network.marks(*first));
        TimePause pause(network);
        is_at_reference = co_await approach_reference(network, *first, token);
        pause.end();
        if (is_at_reference && *is_at_reference && carry_time_of(network, first))
            co_return co_await required(set_reference(network, *first));
    }
    // The slave is lost again, or the ring changes now: the next round tries again.
    const bool given_up = first == nullptr || !is_at_reference;
    const std::uint16_t returned = given_up ? std::exchange(clocks.returning, std::uint16_t{0}) : std::uint16_t{0};
    if (returned != 0 && returned != kAnnounced) (void)carry_time_of(network, &network.slave(clocks.reference));
    co_return Nothing{};
}

Task<Result<>> set_late_clock(Network& network) {
    Clocks& clocks = network.clocks;
    constexpr std::uint8_t kRetryRounds = 100;
    if (clocks.retry_rounds != 0 || clocks.returning != 0) co_return Nothing{};
    const auto slaves = network.slaves();
    for (std::size_t n = 0; n < slaves.size(); ++n) {
        Slave& slave = slaves[(clocks.late_first + n) % slaves.size()];
        const ClockEntry& clock = clocks.of(slave);
        if (clock.synchronised || !is_clock(clock.kind) || !is_settled(network, slave) || clock.beside) continue;
        // return_to_first_clock() sets this clock.
        if (clock.measured && is_before_reference(network, slave)) continue;
        if (slave.number == clocks.reference || note_reach(network, slave)) continue;
        const SlaveToken token(network.marks(slave));
        clocks.late_first = slave.number;  // the next search begins with the slaves behind this slave
        auto set = co_await prepare_clock(network, slave);
        const Errc code = set ? Errc::none : set.error().code;
        if (!set) clocks.retry_rounds = kRetryRounds;
        if (std::exchange(clocks.late_error, code) != code && !set) network.note(set.error());
        co_return Nothing{};
    }
    co_return Nothing{};
}

}  // namespace margay
