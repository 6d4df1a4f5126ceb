// The supervision of the clocks: differences, and a reference clock that is lost.
#include "network/network.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

bool is_there(Network& network, std::uint16_t number) {
    return number != 0 && network.slave(number).al.state != AlState::none;
}

// The first slave in the ring whose clock is synchronised.
std::uint16_t next_reference(Network& network) {
    for (const RingPlace& place : network.seen_ring())
        if (place.slave != 0 && is_there(network, place.slave) && network.clocks.entries[place.slave - 1U].synchronised)
            return place.slave;
    return 0;
}

// The new reference shows the time of the lost one: it has followed it, and its register 0x0928 is subtracted when the
// master reads the time. So all delays stay right, and no clock makes a step.
//
// The control loop of the new reference starts again. When the old reference was lost, the way of the frame became
// shorter, and a comparison with the time that still was sent then may have set a wrong rate, which no comparison would
// correct any more.
Task<Result<>> replace_reference(Network& network) {
    Clocks& clocks = network.clocks;
    const std::uint16_t next = next_reference(network);
    if (next == 0) co_return Result<>();
    auto reset = co_await reset_control_loop(network.station(network.slave(next)));
    if (!reset || !carry_time_of(network, &network.slave(next))) co_return reset;
    network.report({.kind = EventKind::reference_clock, .slave = next, .other = clocks.reference});
    clocks.reference = next;
    co_return Result<>();
}

void note_difference(Network& network, const Slave& slave) {
    Clocks& clocks = network.clocks;
    ClockEntry& clock = clocks.of(slave);
    const SyncLimit limit{.limit_ns = clocks.settings.limit_ns, .settle = clocks.settings.settle};
    if (clock.in_sync != clock.watch.in_sync()) clock.watch.set(clock.in_sync);
    const auto change = clock.watch.update(clock.difference_ns, limit, network.engine.now());
    clock.in_sync = clock.watch.in_sync();
    if (change == SyncWatch::Change::none) return;
    const bool in = change == SyncWatch::Change::in_sync;
    network.report({.kind = in ? EventKind::clock_in_sync : EventKind::clock_out_of_sync,
                    .slave = slave.number,
                    .expected = limit.limit_ns,
                    .actual = static_cast<std::uint32_t>(clock.difference_ns)});
}

Task<Result<>> look_at_clock(Network& network, Slave& slave) {
    if (!network.clocks.of(slave).synchronised || !is_there(network, slave.number)) co_return Result<>();
    auto seen = co_await read_difference(network, slave);
    if (seen && network.clocks.of(slave).synchronised) note_difference(network, slave);
    co_return Result<>();
}

// A slave that is lost is not in sync when it answers again.
void forget_lost(Network& network) {
    for (const Slave& slave : network.slaves()) {
        ClockEntry& clock = network.clocks.of(slave);
        if (!clock.in_sync || is_there(network, slave.number)) continue;
        clock.in_sync = false;
        clock.watch.reset();
        network.clocks.all_in_sync = false;
    }
}

bool all_in_sync(Network& network) {
    return std::ranges::all_of(network.slaves(), [&network](const Slave& slave) {
        const ClockEntry& clock = network.clocks.of(slave);
        return !clock.synchronised || clock.in_sync || !is_there(network, slave.number);
    });
}

}  // namespace

bool carry_time_of(Network& network, const Slave* slave) {
    Clocks& clocks = network.clocks;
    const std::uint64_t about = clocks.system_at_ns(network.engine.now());
    clocks.without_time = 0;
    clocks.paused = slave == nullptr;
    bool all = true;
    for (ProcessGroup& group : network.process.groups)
        if (group.mapped && group.dc_reference != 0) all &= redirect_time(group, slave, about);
    return all;
}

namespace {

bool cycle_carries_time(const Network& network) {
    return std::ranges::any_of(network.process.groups,
                               [](const ProcessGroup& group) { return group.mapped && group.dc_reference != 0; });
}

// Keeps the time of the last cycle. A cycle that has stopped to carry the time, though the reference is there, carries
// it again after some rounds: the supervision needs some time to see that the reference is lost.
void note_time_of_cycle(Network& network) {
    Clocks& clocks = network.clocks;
    constexpr std::uint8_t kEnough = 20;
    const Slave& reference = network.slave(clocks.reference);
    const bool wide = clocks.of(reference).kind == ClockKind::bits64;
    for (const ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.dc_reference != clocks.reference || !group.dc_time.came) continue;
        if (group.dc_time.slaves != 0)
            clocks.note_time(group.dc_time.value, wide, network.engine.link().last_cycle());
        else if (!clocks.paused && ++clocks.without_time >= kEnough)
            (void)carry_time_of(network, &reference);
    }
}

}  // namespace

Task<Result<>> watch_clocks(Network& network) {
    Clocks& clocks = network.clocks;
    const Time now = network.engine.now();
    if (clocks.settings.watch_interval <= Duration{0} || now < clocks.watch_at || network.segment_in_use)
        co_return Result<>();
    clocks.watch_at = later(now, clocks.settings.watch_interval);
    forget_lost(network);
    if (!is_there(network, clocks.reference)) {
        auto replaced = co_await replace_reference(network);
        if (!replaced) co_return replaced;
    }
    if (!is_there(network, clocks.reference)) co_return Result<>();
    note_time_of_cycle(network);
    if (!cycle_carries_time(network)) {
        auto sent = co_await send_time(network);
        if (!sent) co_return sent;
    }
    auto greatest = co_await read_greatest_difference(network);
    if (!greatest) co_return greatest.error();
    if (*greatest <= clocks.settings.limit_ns && clocks.all_in_sync) co_return Result<>();
    const auto each = [&network](Slave& s) { return look_at_clock(network, s); };
    auto all = co_await for_each_slave(network, each);
    clocks.all_in_sync = all_in_sync(network);
    co_return all;
}

}  // namespace margay
