#include "network/supervisor.hpp"

#include "network/attempts.hpp"
#include "network/boot.hpp"
#include "network/coincidence.hpp"
#include "network/configure.hpp"
#include "network/doubt.hpp"
#include "network/expectation.hpp"
#include "network/line_errors.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/recovery.hpp"
#include "network/ring_reading.hpp"
#include "network/search.hpp"
#include "network/settings.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

constexpr unsigned kLooksBeforeDoubt = 3;
constexpr std::uint32_t kNotWalked = 0xFFFF'FFFF;

// The state of the supervision between two rolls.
struct Watch {
    Network& network;
    const SuperviseRequest& wanted;
    BroadcastState last{};
    std::uint16_t reported_count = 0;  // number of answering slaves, as last reported
    unsigned looks = 0;                // consecutive looks that have not explained a short working counter
    std::uint64_t heard = 0;           // frames received
    std::uint64_t lost_before = 0;     // frames lost when a frame was received last
    std::uint32_t walked = 0;          // slaves in the ring when it was last read by a search
    RingParts parts{};                 // with two NICs: where the ring was broken in the last round
    std::uint32_t changes = 0;         // how often the ring was broken or closed until the last round
    bool ring_moved = false;  // since the last search, the ring was closed, or the place of its break has changed
    Time retry_at = Time::min();
    Time look_at = Time::min();   // when the state of all slaves is read again, whatever the roll says
    std::size_t next_helped = 0;  // index of the slave that the next choice starts with: no slave blocks another one
    bool unplaced = false;        // a slave answers, and its place in the ring is not known
    Time search_at = Time::min();
    Time lines_at = Time::min();
    Time groups_at = kNever;  // when a hot connect group should be complete
    [[nodiscard]] Arena& arena() { return network.arena(); }
};

std::uint16_t answering(Network& network) {
    return static_cast<std::uint16_t>(
        std::ranges::count_if(network.slaves(), [](const Slave& s) { return s.al.state != AlState::none; }));
}

// Whether the supervision may look at the slave: no sequence changes it now, or a sequence executes commands and hooks
// of the application, which may take long.
bool may_look_at(Network& network, const Slave& slave) {
    const SlaveWork* work = find_work(network, slave);
    return !network.marks(slave).in_use || (work != nullptr && work->since != kNever);
}

// Ends the start-up of a slave that has left its state meanwhile, by itself or because of its hook. The next attempt
// comes after a pause. If the next attempt ends in the same way, the failure is reported.
void end_start_up(Network& network, Slave& slave, const AlStatus& now) {
    SlaveMarks& marks = network.marks(slave);
    if (marks.repeating) note_state(network, slave, now);
    drop_work(network, slave);
    if (marks.attempts == 0) {
        marks.cause_reported = 0;
    } else {
        Error cause{.code = Errc::other_state, .step = Step::request_state, .slave = slave.number};
        cause.expected = static_cast<std::uint32_t>(goal(network, slave));
        cause.actual = static_cast<std::uint32_t>(now.state);
        cause.detail = now.code;
        report_failure(network, slave, now, cause);
    }
    if (marks.attempts == 0) marks.attempts = 1;
}

// Reads the state of one slave.
Task<Result<>> look_at(Network& network, Slave& slave, SumConfirmation& confirmation) {
    if (slave.al.state == AlState::none && !slave.seen) co_return Nothing{};
    // The mapping or a request changes the slave and reads its state. This look only notes that the slave was away.
    if (is_being_mapped(network, slave) || !may_look_at(network, slave)) {
        auto there = co_await read_al_status(network.station(slave));
        if (!does_not_answer(there.error()) || !is_known(slave)) co_return Nothing{};
        network.marks(slave).doubt(true);
        settle_groups(network);
        co_return Nothing{};
    }
    const bool was_there = slave.al.state != AlState::none;
    auto seen = co_await read_al_status(network.station(slave));
    // The copy of the frame that reaches the slave may not have been sent.
    const bool breaks = network.redundancy != nullptr && network.redundancy->is_breaking();
    if (breaks && was_there && does_not_answer(seen.error())) seen = co_await read_al_status(network.station(slave));
    // While the slave is in use, the reading may be older than a change of the state.
    if (!may_look_at(network, slave) || (!seen && !does_not_answer(seen.error()))) co_return Nothing{};
    if (!seen) {
        if (!was_there || slave.al.state == AlState::none) co_return Nothing{};
        drop_work(network, slave);
        note_lost(network, slave);
        co_return Nothing{};
    }
    if (seen->state != slave.al.state && find_work(network, slave) != nullptr) end_start_up(network, slave, *seen);
    if (network.marks(slave).in_use) co_return Nothing{};
    if (slave.al.state == AlState::none && seen->state != AlState::none) {
        if (network.is_reserved()) co_return Nothing{};
        co_return co_await required(readmit_slave(network, slave, *seen));
    }
    if (seen->state == AlState::init || seen->state == AlState::preop) set_takes_part(network, slave, false);
    if (seen->state == AlState::boot) note_boot(network, slave);
    note_state(network, slave, *seen);
    confirmation.note(slave, seen);
    if (!network.is_reserved()) settle_request(network, slave);
    co_return Nothing{};
}

// All slaves answer without an error, but the working counter is short: checks whether this slave has lost its FMMUs.
Task<Result<>> check_fmmus(Network& network, Slave& slave) {
    if (network.marks(slave).in_use || !slave.takes_part || is_being_mapped(network, slave) ||
        !is_mapped(network, slave) || !is_as_mapped(slave))
        co_return Nothing{};
    auto same = co_await has_fmmus(network, slave, network.process.groups[slave.image.group].layout);
    if (!same || *same) co_return Nothing{};
    set_takes_part(network, slave, false);
    co_return Nothing{};
}

bool needs_help(const Network& network, const Slave& slave) {
    if (network.marks(slave).in_use || slave.al.state == AlState::none || is_being_mapped(network, slave)) return false;
    if (stays_in_boot(network, slave)) return false;
    if (network.redundancy != nullptr && !network.redundancy->may_restore()) return false;
    if (network.is_doubted(slave) || is_unread(slave)) return true;
    const AlState to = goal(network, slave);
    if (slave.al.error || slave.al.state != to || is_to_be_asked(network, slave)) return true;
    if (is_unfinished(network, slave)) return true;
    return to >= AlState::safeop && !slave.takes_part && exchanges(slave);
}

// The application may change wanted.target at any time.
void apply_target(Watch& watch) {
    const AlState target = watch.wanted.target;
    if (target == watch.network.target_read) return;
    watch.network.target_read = target;
    if (can_be_target(target)) {
        watch.network.target = target;
        return;
    }
    Error error{.code = Errc::invalid_argument, .step = Step::supervise};
    error.detail = static_cast<std::uint32_t>(Argument::state);
    watch.network.note(error);
}

Task<Result<>> help(Watch& watch, Slave& slave) {
    Network& network = watch.network;
    const SlaveToken token(network.marks(slave));
    SlaveWork work(slave.number, kNever);
    if (goal(network, slave) >= slave.al.state) work.upwards_to = goal(network, slave);
    network.works.push_back(work);
    const bool well = is_well(network, slave);
    Result<> done;
    {
        const Attempt attempt(network, slave);
        done = co_await bring_back(network, slave);
    }
    if (done) {
        network.marks(slave).attempts = 0;
        network.marks(slave).settled = slave.al.state;
        const bool there = slave.al.state == wanted_state(network, slave) && !slave.al.error && !slave.held;
        if (there) slave.error = {};  // an old error must not be reported when the slave leaves its state again
        if (!well && there) network.report({.kind = EventKind::recovered, .slave = slave.number, .now = slave.al});
        co_return Nothing{};
    }
    if (network.is_doubted(slave) && slave.al.state != AlState::none) {
        watch.look_at = network.engine.now();
        if (does_not_answer(done.error()) && done.error().step == Step::read_state) note_lost(network, slave);
        if (slave.al.state == AlState::none || is_first_silence(network, slave, done.error())) co_return Nothing{};
        co_await completion(clear_fmmus(network, slave));  // the slave gets no outputs until its identity is compared
    }
    // The next look reports a slave that is lost again. The search reports another slave at its place.
    if (!does_not_answer(done.error()) && slave.al.state != AlState::none)
        report_failure(network, slave, slave.al, done.error());
    if (network.marks(slave).attempts < SlaveMarks::kMostAttempts) ++network.marks(slave).attempts;
    if (slave.al.state != AlState::none) await_slave(network, slave);
    watch.look_at = network.engine.now();  // the last roll does not show a slave that has lost its state since
    watch.retry_at = later(network.engine.now(), watch.wanted.retry);
    co_return Nothing{};
}

Task<Result<>> search(Watch& watch) {
    watch.ring_moved = false;
    auto found = co_await find_lost(watch.network);
    const Time now = watch.network.engine.now();
    // An unknown slave remains unknown for a while, so the next search waits. If the ring has changed during the
    // search, the search is repeated soon.
    watch.search_at = later(now, found.error().code == Errc::unstable ? watch.wanted.interval : watch.wanted.retry);
    watch.walked = found ? watch.network.ring_count : kNotWalked;
    if (found && *found > 0) watch.groups_at = later(now, watch.wanted.retry);
    co_return Nothing{};
}

// Reports members of hot connect groups that have not come with the first slaves of their groups.
void report_missing(Watch& watch) {
    Network& network = watch.network;
    watch.groups_at = kNever;
    for (Slave& slave : network.slaves()) {
        const ExpectedSlave* wanted = slave.wanted;
        if (wanted == nullptr || wanted->hot_connect == 0 || wanted->optional || slave.al.state != AlState::none ||
            network.marks(slave).missing_reported)
            continue;
        const auto first = std::ranges::find_if(network.slaves(), [&](const Slave& s) {
            return s.wanted != nullptr && s.wanted->hot_connect == wanted->hot_connect &&
                   is_located(network.expected, *s.wanted);
        });
        if (first == network.slaves().end() || first->al.state == AlState::none) continue;
        network.marks(slave).missing_reported = true;
        await_slave(network, slave);
        network.report({.kind = EventKind::missing, .slave = slave.number, .other = first->number});
    }
}

void report_count(Watch& watch, std::uint16_t count) {
    const auto before = std::exchange(watch.reported_count, count);
    if (before != count) watch.network.report({.kind = EventKind::slave_count, .expected = before, .actual = count});
}

// Reports working counters that fell short or are right again. Returns whether the slaves must be looked at.
bool report_working_counters(Watch& watch) {
    bool unexpected = false;
    for (ProcessGroup& group : watch.network.process.groups) {
        if (!group.mapped || group.mapping) continue;
        std::uint32_t got = 0;
        bool right = true, came = true, right_number = true;
        for (const DatagramStatus& d : group.statuses) {
            got += d.got;
            right &= d.right();
            came &= d.came;
            right_number &= d.got == d.expected || d.got == d.full;
        }
        unexpected |= group.unexpected && group.cycles_lost == 0;
        group.unexpected = false;
        if (group.settling) group.settling = static_cast<std::int32_t>(group.cycle_received - group.settled_after) <= 0;
        if (!came || group.settling || right != group.short_reported || right != right_number) continue;
        group.short_reported = !right;
        watch.network.report({.kind = right ? EventKind::right_again : EventKind::fell_short,
                              .group = group.number,
                              .expected = group.expected_wkc,
                              .actual = got});
    }
    return unexpected;
}

// Without cycles only few frames are sent: kFewFrames lost frames are enough in a silence of more than kSilence.
constexpr std::uint32_t kFewFrames = 4;
constexpr Duration kSilence = std::chrono::milliseconds(60);
constexpr Duration kShortSilence = std::chrono::milliseconds(30);

// The time between two rolls. Overlapping cycles carry no rolls, and Link::cycling() does not count these cycles: so
// beside overlapping cycles a roll is sent every millisecond.
Duration roll_interval(const Watch& watch, Time now) {
    constexpr Duration kBesideOverlapped = std::chrono::milliseconds(1);
    constexpr Duration kCycles = std::chrono::milliseconds(10);
    Link& link = watch.network.engine.link();
    if (link.cycling(now)) return Duration{0};
    const bool overlapped = watch.network.overlapping && now < later(link.last_cycle(), kCycles);
    return overlapped ? std::min(kBesideOverlapped, watch.wanted.interval) : watch.wanted.interval;
}

// Doubts the slaves after a silence since the last roll that came back: a device may have been exchanged meanwhile.
// Call this function before the time of the present roll is noted.
void doubt_after_silence(Watch& watch) {
    Network& network = watch.network;
    const std::uint32_t lost = network.engine.link().take_longest_silence();
    const Time now = network.engine.now();
    const Duration interval = roll_interval(watch, now);
    const auto silent_for = [&](Duration time) { return now > later(network.states_read, interval + time); };
    const bool silent = lost >= kSilentFrames || (lost >= kFewFrames && silent_for(kSilence));
    if (!silent && (lost == 0 || !silent_for(kShortSilence))) return;
    watch.last = {};
    doubt_all(network, silent);
}

// Returns the number of frames that were lost since a frame was received.
std::uint64_t count_lost_frames(Watch& watch) {
    const LinkStatistics& link = watch.network.engine.link().statistics();
    const std::uint64_t lost = link.lost + link.send_refused;  // without a link the NIC refuses to send frames
    if (link.frames_received != watch.heard) watch.lost_before = lost;
    watch.heard = link.frames_received;
    return lost - watch.lost_before;
}

void report_silent_segment(Watch& watch) {
    if (count_lost_frames(watch) < kSilentFrames || watch.network.silent) return;
    watch.network.report({.kind = EventKind::lost});
    watch.network.silent = true;
    doubt_all(watch.network, true);
}

void start_helpers(Watch& watch, Crew& crew) {
    const Time now = watch.network.engine.now();
    const bool again = now >= watch.retry_at;
    const auto slaves = watch.network.slaves();
    const std::size_t first = watch.next_helped;
    for (Slave& slave : slaves) {
        // The slave is missing, and it has no process data, or no part in the cycle.
        if (slave.al.state == AlState::none && !exchanges(slave) && !slave.unplaced) continue;
        const bool asked = watch.network.marks(slave).attempts > 0 || !is_to_be_asked(watch.network, slave);
        // The image lacks the data of the slave, or SlaveConfiguration::highest keeps the slave from exchanging data.
        const bool missed = (slave.unplaced && asked) || !is_highest(slave.config.highest);
        if (missed && slave.al.state == AlState::preop) watch.network.marks(slave).awaited = true;
        update_counted(watch.network, slave);
        if (is_mapped(watch.network, slave)) (void)is_joining(watch.network.process.groups[slave.image.group], slave);
        end_work_upwards(watch.network, slave);
    }
    if (watch.network.is_reserved()) return;
    if (again) watch.retry_at = later(now, watch.wanted.retry);
    for (std::size_t n = 0; n < slaves.size(); ++n) {
        const std::size_t at = first + n < slaves.size() ? first + n : first + n - slaves.size();
        Slave& slave = slaves[at];
        const bool waits = watch.network.marks(slave).attempts > 0 && !again;
        if (crew.full() || waits || !needs_help(watch.network, slave)) continue;
        const TaskReference task = help(watch, slave);
        if (!crew.start(task)) return;
        if (SlaveWork* begun = find_work(watch.network, slave)) begun->sequence = task;
        watch.next_helped = at + 1;
    }
}

// Whether the ring has changed, or contains a slave that is not identified.
bool walk_is_due(Watch& watch, const BroadcastState& roll) {
    if (watch.network.searching || watch.network.is_reserved()) return false;
    if (watch.ring_moved || (roll.count != watch.walked && watch.walked != kNotWalked)) return true;
    return (watch.walked == kNotWalked || roll.count > answering(watch.network)) &&
           watch.network.engine.now() >= watch.search_at;
}

Task<Result<>> look(Watch& watch, Crew& crew, const BroadcastState& roll, bool unexpected) {
    Network& network = watch.network;
    SumConfirmation confirmation(network);
    const auto look = [&network, &confirmation](Slave& s) { return look_at(network, s, confirmation); };
    co_await required(for_each_slave(network, look));
    confirmation.end();
    if (std::exchange(network.group_is_back, false)) watch.groups_at = later(network.engine.now(), watch.wanted.retry);
    // A slow group may have had no cycle since the last look.
    const bool falls_short = std::ranges::any_of(
        network.process.groups, [](const ProcessGroup& group) { return group.mapped && group.short_reported; });
    if (unexpected)
        ++watch.looks;
    else if (!falls_short)
        watch.looks = 0;
    if (watch.looks >= kLooksBeforeDoubt) {
        watch.looks = 0;
        const auto doubt = [&network](Slave& s) { return check_fmmus(network, s); };
        co_await required(for_each_slave(network, doubt));
    }
    report_count(watch, roll.count);
    // A slave that has replaced another slave does not change the number of slaves. The first search does not wait.
    const auto has_no_place = [](const Slave& s) { return s.al.state != AlState::none && s.ring_position == 0; };
    const bool before = std::exchange(watch.unplaced, std::ranges::any_of(network.slaves(), has_no_place));
    if (roll.count == watch.walked && watch.unplaced) watch.walked = kNotWalked;
    if (watch.unplaced && !before) watch.search_at = network.engine.now();
    if (walk_is_due(watch, roll)) (void)crew.start(search(watch));
    co_return Nothing{};
}

// Whether the ring was broken or closed, or the place of its break has changed, since the last call. Between two rolls,
// one slave may have come, and another slave may be gone.
bool ring_has_changed(Watch& watch) {
    const RedundancyPart* const redundancy = watch.network.redundancy;
    if (redundancy == nullptr) return false;
    const RingParts before = std::exchange(watch.parts, redundancy->parts());
    const std::uint32_t changes = std::exchange(watch.changes, redundancy->changes());
    const bool moved = !watch.parts.divides_like(before);
    watch.ring_moved |= moved && before.two_nics && !before.whole;
    return changes != watch.changes || moved;
}

// Watches the clocks beside the rounds while a clock becomes the reference. False: the round must watch the clocks.
bool watch_beside(Network& network, Crew& crew) {
    Clocks& clocks = network.clocks;
    if (clocks.watch == nullptr || clocks.watching) return true;
    if (clocks.returning == 0 || network.redundancy != nullptr) return false;
    (void)crew.start(clocks.watch(network));
    return true;
}

// One roll and the actions that follow from it.
Task<Result<>> round(Watch& watch, Crew& crew) {
    Network& network = watch.network;
    const bool turn = network.supervision_turn;
    auto roll = co_await read_all_states(network);
    if (network.redundancy != nullptr) network.redundancy->watch(network);
    if (!roll) {
        report_silent_segment(watch);
        if (turn && watch.network.silent) network.supervision_turn = false;
        if (roll.error().code == Errc::capacity) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
        if (!watch_beside(network, crew)) co_await completion(network.clocks.watch(network));
        co_return Nothing{};
    }
    doubt_after_silence(watch);
    // No reading of the ports during a search: the search uses the places that it has read until its end.
    const bool in_use = network.segment_in_use || network.searching;
    if (network.redundancy != nullptr && network.redundancy->are_ports_old() && !in_use) {
        co_await required(network.redundancy->read_ports(network));
    }
    (void)count_lost_frames(watch);
    const Time now = network.engine.now();
    const Time latest = later(later(network.compared, watch.wanted.interval), std::chrono::milliseconds(100));
    network.slept_long = network.is_unobserved() && now <= latest;  // false if the application has paused
    if (network.is_unobserved()) {                                  // the slaves may belong to another machine now
        watch.last = {};
        doubt_all(network, false);
    }
    network.states_read = network.compared = now;
    if (std::exchange(watch.network.silent, false)) {
        network.report({.kind = EventKind::found});
        watch.last = {};
        doubt_all(network, true);  // the slaves may belong to another machine
    }
    apply_target(watch);
    const bool unexpected = report_working_counters(watch);
    const bool changed =
        ring_has_changed(watch) || roll->count != watch.last.count || roll->al_status != watch.last.al_status;
    watch.last = *roll;
    if (changed || unexpected || network.engine.now() >= watch.look_at || walk_is_due(watch, *roll)) {
        const Time begun = network.engine.now();
        watch.look_at = kNever;
        auto looked = co_await look(watch, crew, *roll, unexpected);
        if (!looked && looked.error().code != Errc::capacity) co_return looked;
        // Without memory for a task now, the next round looks again. help() may have asked for a look meanwhile.
        if (watch.look_at == kNever)
            watch.look_at = looked ? next_look(network, watch.wanted, begun, roll->al_status) : begun;
    }
    if (network.engine.now() >= watch.groups_at) report_missing(watch);
    start_helpers(watch, crew);
    if (turn) network.supervision_turn = false;
    if (watch_beside(network, crew)) co_return Nothing{};
    auto watched = co_await network.clocks.watch(network);
    if (!watched && watched.error().code == Errc::capacity) watch.look_at = network.engine.now();
    co_return Nothing{};
}

// The sleep between two rounds; a request that gives the supervision its turn ends it.
struct RoundSleep {
    RoundSleep(Network& n, Duration duration) : network(n), until_woken(n.engine.sleep_for(duration)) {
        network.supervision_sleep = &until_woken.timer;
    }
    RoundSleep(const RoundSleep&) = delete;
    RoundSleep& operator=(const RoundSleep&) = delete;
    ~RoundSleep() { network.supervision_sleep = nullptr; }
    Network& network;
    Engine::Sleep until_woken;
};

// The supervision may end at any time, also while the cycles carry no time for some rounds.
struct TimeGuard {
    explicit TimeGuard(Network& n) : network(n) {}
    TimeGuard(const TimeGuard&) = delete;
    ~TimeGuard() {
        if (network.clocks.resume != nullptr) network.clocks.resume(network);
    }
    Network& network;
};

}  // namespace

Task<Result<>> supervise(Network& network, const SuperviseRequest& wanted) {
    Watch watch{network, wanted};
    watch.reported_count = answering(network);
    watch.walked = network.ring_count;
    // The last supervision ended in a silence.
    if (std::exchange(network.silent, false)) network.compared = Time::min();
    // With supervisions that are submitted repeatedly, slaves that never recover must not block the other slaves.
    if (network.count != 0) watch.next_helped = (network.stranger_address & 0xFFU) % network.count;
    network.stranger_address = static_cast<std::uint16_t>(0x0F00 | ((network.stranger_address + 1) & 0xFF));
    for (Slave& slave : network.slaves()) {
        network.marks(slave).attempts = 0;
        network.marks(slave).settled = AlState::none;
    }
    begin_line_errors(wanted.line_errors);
    const TimeGuard guard(network);
    Crew crew(network.tasks);
    for (;;) {
        co_await required(round(watch, crew));
        const Time now = network.engine.now();
        if (wanted.line_interval > Duration{0} && now >= watch.lines_at && !watch.network.silent) {
            watch.lines_at = later(now, wanted.line_interval);
            (void)crew.start(read_all_line_errors(network, wanted.line_errors));
        }
        const Duration interval = roll_interval(watch, network.engine.now());
        if (interval <= Duration{0}) continue;
        RoundSleep sleep(network, interval);
        co_await sleep.until_woken;
    }
}

}  // namespace margay
