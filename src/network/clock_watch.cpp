// The supervision of the clocks: differences, and a reference clock that is lost.
#include "network/clock_restore.hpp"
#include "network/network.hpp"
#include "network/wanted.hpp"
#include "util/scoped_flag.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

namespace reg = wire::reg;

bool is_there(Network& network, std::uint16_t number) {
    return number != 0 && network.slave(number).al.state != AlState::none;
}

// Below SAFEOP, the clock of a slave that has come back may not be set yet: prepare_clock() sets it.
bool has_its_state(Network& network, const Slave& slave) {
    return slave.al.state >= AlState::safeop || slave.al.state == wanted_state(network, slave);
}

// The first slave in the ring whose clock is synchronised and that stays present when the slave `without` is lost. With
// `without`, the clock must also be in step with the others, because it is not compared before it becomes the
// reference. A clock beside a ring is left out, unless the reference is beside the ring too: its time does not reach
// the other clocks.
std::uint16_t next_reference(Network& network, std::uint16_t without) {
    const auto ring = network.seen_ring();
    const std::size_t lost = without == 0 ? 0 : network.slave(without).ring_position;
    bool behind = false;  // the slaves behind the lost one are the next ones in the ring
    for (std::size_t n = 0; n < ring.size(); ++n) {
        const std::size_t place = n + 1;
        if (place == lost) behind = true;
        if (place > lost) behind = behind && ring[n].parent >= lost;
        const std::uint16_t slave = ring[n].slave;
        if (behind || slave == 0 || !is_there(network, slave) || !has_its_state(network, network.slave(slave)))
            continue;
        const ClockEntry& clock = network.clocks.entries[slave - 1U];
        if (!clock.synchronised || (without != 0 && !clock.is_in_step())) continue;
        if (!clock.beside || network.clocks.entries[network.clocks.reference - 1U].beside) return slave;
    }
    return 0;
}

// The cycle itself changes to the next clock when the reference does not answer, so that the other clocks are without
// the time for one cycle only.
void choose_standby(Network& network) {
    Clocks& clocks = network.clocks;
    const std::uint16_t next = clocks.settings.replace_lost_reference && !clocks.paused
                                   ? next_reference(network, clocks.reference)
                                   : std::uint16_t{0};
    for (ProcessGroup& group : network.process.groups)
        if (group.mapped && group.dc_reference == clocks.reference)
            set_time_standby(group, next == 0 ? StationAddress{} : network.slave(next).station_address);
}

// Frames of overlapping cycles keep their reference.
bool is_time_overlapped(const Network& network) {
    return std::ranges::any_of(network.process.groups, [&network](const ProcessGroup& group) {
        return group.mapped && group.overlap.sets > 1 && group.dc_reference == network.clocks.reference;
    });
}

// Sends the slave its own time: reads the time of the slave, adds the time since the reading, and writes the sum.
// False: a frame was lost.
Task<Result<bool>> compare_with_itself(Network& network, const Slave& slave) {
    const Station station = network.station(slave);
    const bool wide = network.clocks.of(slave).kind == ClockKind::bits64;
    std::array<std::byte, 8> time{};
    const auto bytes = MutableBytes(time).first(wide ? 8U : 4U);
    const wire::DatagramAddress own{station.address, reg::kSystemTime.address};
    const Time seen_at = network.engine.now();
    Datagram look(station.engine.link(), wire::Command::FPRD, own, bytes, Repeat::no);
    const auto seen = co_await look;
    if (!seen.ok() || seen.wkc == 0) co_return false;
    const Duration since = network.engine.now() - seen_at;
    store_le<std::uint64_t>(time, 0, load_le<std::uint64_t>(time) + static_cast<std::uint64_t>(since.count()));
    Datagram show(station.engine.link(), wire::Command::FPWR, own, Bytes(bytes), Repeat::no);
    const auto shown = co_await show;
    co_return shown.ok() && shown.wkc != 0;
}

// When the reference was lost, the clocks took the time that the master had sent, and the way of the frame may have
// become shorter. So the mean of the differences leads the slave away from its rate, and no comparison corrects the
// clock of a reference. A write to the depth of the filter clears the mean. Then one comparison, through the deepest
// filter, restores the rate that the slave has learned. False: the slave may have another rate.
Task<Result<bool>> calm_rate(Network& network, Slave& slave) {
    constexpr unsigned kMostTries = 3;
    constexpr std::int64_t kMostAway =
        16;  // in multiples of the limit: a greater difference has also changed the learned rate
    const Station station = network.station(slave);
    const std::int64_t near_ns = network.clocks.settings.limit_ns / 8;
    const auto found =
        co_await required(read<std::uint8_t>(station, reg::kSystemTimeDifferenceFilter, Step::configure_clocks));
    const std::uint8_t depth =
        found == kDeepestFilter ? kUsualFilter : found;  // an earlier execution of this sequence may have been cut
    co_await required(read_difference(network, slave));
    const std::int64_t away_ns = std::abs(std::int64_t{network.clocks.of(slave).difference_ns});
    if (found == depth && away_ns <= near_ns) co_return true;
    if (found == depth && away_ns > kMostAway * network.clocks.settings.limit_ns) co_return false;
    co_await required(write_clock_register(station, reg::kSystemTimeDifferenceFilter, kDeepestFilter));
    bool compared = false;
    for (unsigned n = 0; n < kMostTries && !compared; ++n)
        compared = co_await required(compare_with_itself(network, slave));
    co_await required(write_clock_register(station, reg::kSystemTimeDifferenceFilter, depth));
    co_return compared;
}

// A reference clock that was switched off comes back with another time, which must reach no clock. The cycles carry the
// time again when the reference clock is set, see restore_clock() and note_time_of_cycle().
void stop_time(Network& network) {
    (void)carry_time_of(network, nullptr);
    network.clocks.paused = false;
}

// The new reference shows the time of the lost reference, because it has followed that clock and the chip subtracts
// register 0x0928 when the master reads the time. So all delays stay right, and no clock makes a step.
Task<Result<>> replace_reference(Network& network) {
    Clocks& clocks = network.clocks;
    const bool known = std::exchange(clocks.loss_reported, true);
    if (!known) network.report({.kind = EventKind::reference_lost, .slave = clocks.reference});
    const bool replaced = clocks.settings.replace_lost_reference && !is_time_overlapped(network);
    const std::uint16_t next = replaced ? next_reference(network, 0) : std::uint16_t{0};
    if (next == 0) {
        stop_time(network);
        co_return Nothing{};
    }
    Slave& slave = network.slave(next);
    const bool is_ring = network.redundancy != nullptr;  // a frame has two copies there
    const bool calm = is_ring ? false : co_await required(calm_rate(network, slave));
    const bool restarted = calm ? false : co_await required(settle_rate(network, slave));
    // No clock is in step with a clock that was not in step with the lost reference.
    if (restarted || (is_ring && !clocks.of(slave).is_in_step())) {
        lose_sync_of_others(network, slave);
        if (!restarted) clocks.rate_of = 0;  // not known
    }
    if (!carry_time_of(network, &slave)) co_return Nothing{};
    clocks.loss_reported = false;
    co_return co_await required(set_reference(network, slave));
}

// The greatest possible difference to the reference of a clock that is `own_ns` ahead of the clock that it follows.
std::int64_t greatest_ahead_ns(const FollowedClock& followed, std::int64_t own_ns) {
    const std::int64_t ahead = own_ns + followed.ahead_ns;
    return ahead < 0 ? ahead - followed.moves_ns : ahead + followed.moves_ns;
}

}  // namespace

void lose_sync_of_others(Network& network, const Slave& reference) {
    network.clocks.rate_of = reference.number;
    for (const Slave& other : network.slaves())
        if (other.number != reference.number) network.clocks.lose_sync(other);
}

void take_own_rate(Network& network, const Slave& reference) {
    const Clocks& clocks = network.clocks;
    if (clocks.rate_of != reference.number || clocks.is_driven) lose_sync_of_others(network, reference);
}

bool is_reference_silent(Network& network) {
    const Clocks& clocks = network.clocks;
    if (network.redundancy != nullptr || clocks.paused) return false;  // paused: the library has stopped the time
    return std::ranges::any_of(network.process.groups, [&](const ProcessGroup& group) {
        if (!group.mapped || group.dc_reference != clocks.reference || !group.dc_time.came) return false;
        const TimeSource source = time_source(group);
        const bool of_reference =
            source.command == wire::Command::ARMW || source == by_station(network.slave(clocks.reference));
        return group.dc_time.slaves == 0 || !of_reference;
    });
}

namespace {

void note_difference(Network& network, const Slave& slave, std::int64_t before_ns) {
    Clocks& clocks = network.clocks;
    ClockEntry& clock = clocks.of(slave);
    if (is_reference_silent(network)) return;
    const FollowedClock followed = followed_clock(network, slave);
    // The difference register of the reference shows a comparison with a time for other clocks. It is valid only when
    // the application writes times to the reference, or when the cycles carry the time of the standby: then the
    // reference follows the time that the master sends.
    const bool own_time = slave.number == clocks.reference && !clocks.is_driven && clocks.without_time < 2;
    const bool may_end = clock.in_sync && clock.follows != 0 && clock.times_seen >= clocks.times_of_grace;
    const bool known = clock.knows_difference() || may_end || (own_time && network.redundancy == nullptr);
    if (!known || followed.slave != clock.follows) return;
    if (followed.slave != clocks.reference) {
        const std::int64_t own =
            followed.slave == slave.number ? 0 : clock.difference_ns;  // a reference clock follows no other clock
        clock.difference_ns = static_cast<std::int32_t>(
            std::clamp<std::int64_t>(greatest_ahead_ns(followed, own), -INT32_MAX, INT32_MAX));
    }
    const SyncLimit limit{.limit_ns = clocks.settings.limit_ns, .settle = clocks.settings.settle};
    if (clock.in_sync != clock.watch.in_sync()) clock.watch.set(clock.in_sync);
    const std::int32_t difference = own_time ? 0 : clock.difference_ns;
    // In a ring, clocks are led away and come back more often. The register has a mean, which is about two rounds late:
    // a clock that passes the reference shows a small difference, and is not in sync.
    const std::int64_t soon_ns = difference + 2 * (difference - before_ns);
    const bool passes = network.redundancy != nullptr && followed.slave == clocks.reference && !own_time &&
                        !clock.in_sync && std::abs(soon_ns) > limit.limit_ns;
    const auto change = clock.watch.update(passes ? INT32_MAX : difference, limit, network.engine.now());
    clock.in_sync = clock.watch.in_sync();
    if (!clock.in_sync && !clock.out_of_reach) clocks.all_in_sync = false;
    clock.knows_rate |= clock.in_sync;
    // The clock may have lost `in_sync` before this comparison: after a loss of the reference, or while the bus is
    // shifted.
    const bool away = std::abs(std::int64_t{difference}) > limit.limit_ns;
    const bool out = change == SyncWatch::Change::out_of_sync || (clock.told_in_sync && !clock.in_sync && away);
    const bool in = change == SyncWatch::Change::in_sync;
    const bool was_misled = clock.misled;
    if (in || away) clock.misled = false;
    if ((!in && !out) || (in && was_misled)) return;
    clock.told_in_sync = in;
    network.report({.kind = in ? EventKind::clock_in_sync : EventKind::clock_out_of_sync,
                    .slave = slave.number,
                    .expected = limit.limit_ns,
                    .actual = static_cast<std::uint32_t>(clock.difference_ns)});
}

Task<Result<>> look_at_clock(Network& network, Slave& slave) {
    if (!network.clocks.of(slave).synchronised || !is_there(network, slave.number)) co_return Nothing{};
    const std::int32_t before_ns = network.clocks.of(slave).difference_ns;
    auto seen = co_await read_difference(network, slave);
    if (seen && network.clocks.of(slave).synchronised) note_difference(network, slave, before_ns);
    co_return Nothing{};
}

// Finds out whether the time of another clock was written to the reference: by a frame with ARMW while another slave
// had its position, or by another program. Then the rate of the reference is wrong and would stay wrong, so its control
// loop starts again. This check is left out if the application or MasterClock writes times to the reference.
Task<Result<>> check_reference(Network& network) {
    Clocks& clocks = network.clocks;
    if (clocks.is_driven) co_return Nothing{};
    Slave& slave = network.slave(clocks.reference);
    const std::int32_t before = clocks.of(slave).difference_ns;
    co_await required(read_difference(network, slave));
    const std::int32_t now = clocks.of(slave).difference_ns;
    if (std::abs(std::int64_t{now}) <= clocks.settings.limit_ns || now != before) co_return Nothing{};
    const bool calm = network.redundancy != nullptr ? false : co_await required(calm_rate(network, slave));
    if (calm) co_return Nothing{};
    take_own_rate(network, slave);
    co_return co_await required(reset_control_loop(network.station(slave)));
}

// While all clocks are in sync, each round reads the difference of one clock, in turn.
Task<Result<>> look_at_next_clock(Network& network) {
    std::uint16_t& last = network.clocks.looked_at;
    for (std::uint16_t n = 0; n < network.count; ++n) {
        last = last < network.count ? static_cast<std::uint16_t>(last + 1) : std::uint16_t{1};
        Slave& slave = network.slave(last);
        if (network.clocks.of(slave).synchronised && is_there(network, last)) {
            co_return co_await required(look_at_clock(network, slave));
        }
    }
    co_return Nothing{};
}

bool all_in_sync(Network& network) {
    return std::ranges::all_of(network.slaves(), [&network](const Slave& slave) {
        const ClockEntry& clock = network.clocks.of(slave);
        return !is_clock(clock.kind) || clock.in_sync || clock.out_of_reach || !is_there(network, slave.number);
    });
}

// How far the second reference of a ring with two NICs is ahead of the reference, whichever clocks follow it.
std::uint32_t second_ahead_ns(Network& network) {
    if (network.redundancy == nullptr) return 0;
    std::int64_t most = 0;
    for (const Slave& slave : network.slaves())
        if (network.clocks.of(slave).follows == slave.number)
            most = std::max(most, std::abs(greatest_ahead_ns(followed_clock(network, slave), 0)));
    return static_cast<std::uint32_t>(std::min<std::int64_t>(most, INT32_MAX));
}

}  // namespace

bool carry_time_of(Network& network, const Slave* slave) {
    Clocks& clocks = network.clocks;
    clocks.without_time = 0;
    clocks.paused = slave == nullptr;
    bool all = true;
    for (ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.dc_reference == 0) continue;
        all &= redirect_time(group, slave);
    }
    return all;
}

void resume_time(Network& network) {
    Clocks& clocks = network.clocks;
    clocks.returning = 0;
    if (!clocks.paused || !is_there(network, clocks.reference)) return;
    const Slave& reference = network.slave(clocks.reference);
    (void)carry_time_of(network, &reference);
}

TimePause::~TimePause() {
    if (ended_) return;
    if (!network_.silent) resume_time(network_);
    network_.clocks.returning = 0;
    network_.clocks.paused = false;
}

Task<Result<>> set_reference(Network& network, const Slave& slave) {
    Clocks& clocks = network.clocks;
    network.report({.kind = EventKind::reference_clock, .slave = slave.number, .other = clocks.reference});
    clocks.reference = slave.number;
    clocks.returning = 0;
    if (network.redundancy == nullptr) co_return Nothing{};
    co_return co_await required(network.redundancy->follow_reference(network));
}

namespace {

bool cycle_carries_time(const Network& network) {
    return std::ranges::any_of(network.process.groups,
                               [](const ProcessGroup& group) { return group.mapped && group.dc_reference != 0; });
}

// While no cycle carries the time, the clocks drift apart: the next round does not wait for the interval of the watch.
constexpr Duration kSoon = std::chrono::milliseconds(10);
void watch_soon(Network& network) {
    const Time soon = later(network.engine.now(), kSoon);
    if (soon >= network.clocks.watch_at) return;
    network.clocks.watch_at = soon;
    network.clocks.watched_soon = true;
}

// Keeps the time of the last cycle. A cycle that has stopped to carry the time of the reference, though the reference
// is there, carries it again after some rounds: the supervision needs some time to see that the reference is lost.
// True: the cycle carries no time now, so the caller reads the registers of the reference to find out early whether the
// reference was reset.
bool note_time_of_cycle(Network& network) {
    Clocks& clocks = network.clocks;
    constexpr std::uint8_t kEnough = 20;
    const Slave& reference = network.slave(clocks.reference);
    const bool settled = has_its_state(network, reference);
    constexpr Duration kRecent = std::chrono::milliseconds(100);
    const bool cycles = network.engine.now() <= later(network.engine.link().last_cycle(), kRecent);
    bool stopped = false;
    for (const ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.dc_reference != clocks.reference || !group.dc_time.came) continue;
        const TimeSource source = time_source(group);
        const TimeSource wanted = time_source_of(group.slaves, reference, group.by_position);
        const bool of_reference = source.command == wire::Command::ARMW || source == by_station(reference);
        if (of_reference && source != wanted) {  // while a slave was lost, the station address was used
            (void)carry_time_of(network, &reference);
            continue;
        }
        if (group.dc_time.slaves != 0 && settled)
            clocks.note_seen_time(group.dc_time.value, is_time_whole(group),
                                  time_sent_at(group, network.engine.link()));
        // The next time is predicted from two consecutive replies. With long cycles this takes several rounds.
        const bool reads = group.overlap.sets == 1 && source.address == wanted.address &&
                           (source.command == wire::Command::FPRD || source.command == wire::Command::APRD);
        if (group.dc_time.slaves != 0 && of_reference)
            clocks.without_time = 0;
        else if (reads)
            clocks.without_time = 1;
        else if (!clocks.paused && settled && ++clocks.without_time >= kEnough)
            (void)carry_time_of(network, &reference);
        else
            stopped |= !clocks.paused && settled && cycles;
        if (clocks.without_time != 0 && network.redundancy == nullptr) watch_soon(network);
    }
    return stopped && network.redundancy == nullptr;
}

Task<Result<>> compare_clocks(Network& network) {
    Clocks& clocks = network.clocks;
    // Bus shift moves the reference at the rate of an earlier shift perhaps, which the reference has learned as a
    // follower: it gets its own rate again. A reference that has its own rate does not change.
    if (std::exchange(clocks.shifted_far, false))
        co_await required(reset_control_loop(network.station(network.slave(clocks.reference))));
    auto greatest = co_await required(read_greatest_difference(network));
    greatest = std::max(greatest, second_ahead_ns(network));
    clocks.greatest_ns = greatest;
    // A slave that was away may have come back since the last round.
    clocks.all_in_sync = clocks.all_in_sync && all_in_sync(network);
    if (greatest <= clocks.settings.limit_ns && clocks.all_in_sync) {
        co_return co_await required(look_at_next_clock(network));
    }
    co_await required(check_reference(network));
    const auto look = [&network](Slave& s) { return look_at_clock(network, s); };
    auto all = co_await for_each_slave(network, look);
    clocks.all_in_sync = all_in_sync(network);
    co_return all;
}

// The cycles bring times of the reference that no rate explains. They count if the reference was not reset.
Task<Result<>> judge_odd_times(Network& network) {
    const auto kept = co_await check_offset(network);
    if (kept) network.clocks.trust_times(network.engine.now());
    if (!kept && kept.error().code == Errc::unstable) co_await completion(restore_reference(network));
    co_return Nothing{};
}

// Compares the clocks in the intervals of the watch, until `done`.
Task<Result<>> compare_until(Network& network, const bool& done) {
    constexpr Duration kLook =
        std::chrono::milliseconds(10);  // short, because the supervision waits for the end of this sequence
    for (Time due = later(network.engine.now(), network.clocks.settings.watch_interval);;) {
        co_await network.engine.sleep_for(std::min(kLook, network.clocks.settings.watch_interval));
        if (done || network.silent || !is_there(network, network.clocks.reference)) co_return Nothing{};
        if (network.engine.now() < due) continue;
        co_await required(compare_clocks(network));
        due = later(network.engine.now(), network.clocks.settings.watch_interval);
    }
}

// Measures the delays and compares the clocks meanwhile, because each latching of the receive times takes some cycles.
Task<Result<>> improve_and_compare(Network& network) {
    bool done = false;
    Crew comparing(1);
    if (network.redundancy == nullptr)
        (void)comparing.start(compare_until(network, done));  // with two NICs the ring is open meanwhile
    auto improved = co_await improve_delays(network);
    done = true;
    co_await comparing.all();
    co_return improved;
}

}  // namespace

Task<Result<>> watch_clocks(Network& network) {
    Clocks& clocks = network.clocks;
    const Time now = network.engine.now();
    if (clocks.settings.watch_interval <= Duration{0} || now < clocks.watch_at || network.segment_in_use)
        co_return Nothing{};
    const std::int64_t rounds =
        clocks.watch_at == Time::min() ? 1 : 1 + (now - clocks.watch_at) / clocks.settings.watch_interval;
    clocks.watch_at = later(now, clocks.settings.watch_interval);
    clocks.shifted_ns = 0;
    clocks.rounds_soon = std::exchange(clocks.watched_soon, false) ? static_cast<std::uint16_t>(clocks.rounds_soon + 1)
                                                                   : std::uint16_t{0};
    if (clocks.rounds_soon == 0 || clocks.rounds_soon * kSoon >= clocks.settings.watch_interval) {
        clocks.rounds_soon = 0;
        note_followed_clocks(network, rounds);
    }
    if (network.silent) {
        if (network.redundancy == nullptr && !clocks.paused) {
            stop_time(network);
            watch_soon(network);
        }
        co_return Nothing{};
    }
    const ScopedFlag watching(clocks.watching);  // configdc() forgets the reference
    if (network.redundancy != nullptr) {
        co_await required(network.redundancy->watch_clocks(network));
    }
    if (!is_there(network, clocks.reference)) {
        co_await required(replace_reference(network));
    }
    if (!is_there(network, clocks.reference)) co_return Nothing{};
    clocks.loss_reported = false;
    co_await required(return_to_first_clock(network));
    // A request may use the segment since, and a slave may have been lost: the rounds of the supervision go on.
    if (network.redundancy == nullptr && (network.segment_in_use || !is_there(network, clocks.reference)))
        co_return Nothing{};
    co_await required(set_late_clock(network));
    const bool stopped = note_time_of_cycle(network);
    if (stopped) co_await completion(restore_reference(network));
    if (clocks.odd_times >= Clocks::kManyOdd) co_await completion(judge_odd_times(network));
    note_cycle_time(network);
    choose_standby(network);
    constexpr std::uint8_t kEnoughOld = 5;  // after these rounds, all slaves of a branch are lost or back
    const bool old = clocks.rounds_old >= kEnoughOld;
    const bool guessed = network.redundancy != nullptr && (old || network.redundancy->delays_are_guessed()) &&
                         network.ring_parts().whole && !network.redundancy->are_ports_old() &&
                         network.redundancy->may_restore();
    const bool changed = network.redundancy == nullptr && old;
    const bool measure_again = clocks.settings.delay_interval > Duration{0} && now >= clocks.delays_at;
    // The measurement opens a ring for a moment, and a search reads its ports.
    if ((guessed || changed || measure_again) && !network.searching) {
        clocks.delays_at = later(now, clocks.settings.delay_interval);
        auto improved = co_await improve_and_compare(network);
        // While the ring is open, the cycles bring the time to no clock. The control loops need more time than that.
        constexpr int kRests = 8;
        const Time end = network.engine.now();
        if (network.redundancy != nullptr)
            clocks.delays_at = std::max(clocks.delays_at, later(end, kRests * (end - now)));
        if (!improved && improved.error().code == Errc::capacity) co_return improved;
    }
    if (!cycle_carries_time(network)) {
        co_await completion(send_time(network));
    }
    co_return co_await required(compare_clocks(network));
}

}  // namespace margay
