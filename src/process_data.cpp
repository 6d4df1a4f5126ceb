// Process data for the public API: the cycle.
#include "api/master.hpp"
#include "network/doubt.hpp"
#include "network/search.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

Error refused(Errc code, std::uint8_t group) {
    const bool of_group = code == Errc::unknown_group || code == Errc::timeout;
    return {
        .code = code, .step = Step::exchange_process_data, .index = of_group ? std::uint16_t{group} : std::uint16_t{0}};
}

// Inlined, it costs each cycle a load of the number of groups.
[[gnu::noinline, gnu::cold]] Error refused_number(const Network& network, std::uint8_t group) {
    Error error = refused(Errc::unknown_group, group);
    error.expected = static_cast<std::uint32_t>(network.process.groups.size());
    return error;
}

Error negative_timeout(std::uint8_t group) {
    Error error = refused(Errc::invalid_argument, group);
    error.detail = static_cast<std::uint32_t>(Argument::timeout);
    return error;
}

// Waits for frames of the cycle that have not arrived yet.
[[gnu::noinline]] Result<std::uint32_t> wait_for_cycle(Master& master, ProcessGroup& group, Duration timeout) {
    if (timeout < Duration{0}) return negative_timeout(group.number);
    group.cycle_received = group.cycles_sent;
    group.under_way = false;
    Engine& engine = master.network.engine;
    Osal& osal = master.osal;
    Nic& nic = engine.link().nic();
    Time now = osal.now();
    const Time give_up = later(std::max(now, engine.link().last_cycle()), timeout);  // the cycle may leave later
    while (now < give_up) {
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handles());
        now = osal.now();
        if (engine.receive_cycle(group.prepared, now) != CycleEnd::missing) break;
    }
    return evaluate_cycle(group, group.prepared, engine.link(), now);
}

// Receives the oldest cycle on the wire. If there is none, waits for another thread to send one. The timeout counts
// from the sending of the cycle.
[[gnu::noinline]] Result<std::uint32_t> receive_overlapped(Master& master, ProcessGroup& group, Duration timeout) {
    Engine& engine = master.network.engine;
    Osal& osal = master.osal;
    Nic& nic = engine.link().nic();
    if (!group.mapped) return refused(Errc::unknown_group, group.number);
    if (timeout < Duration{0}) return negative_timeout(group.number);
    Time now = osal.now();
    const Time start = now;
    Time from = start;
    bool none = false;
    for (;;) {
        const bool was_none = std::exchange(none, !is_cycle_sent(group));  // a cycle may have no frames
        // Read after `none`, because the other thread may send the cycle at any time.
        const auto frames = oldest_cycle(group);
        // The other thread has sent the cycle meanwhile. The time it was sent with may be old, so count from now.
        if (was_none && !none) from = now;
        const bool all = !none && engine.receive_overlapped(frames, now);
        while (none && engine.receive_one(now)) {
        }
        const Time give_up = later(none ? start : std::max(from, sent_at(group)), timeout);
        if (all || (now >= give_up && !none)) {
            doubt_reply(master.network);
            return end_overlapped(group, engine.link(), now);
        }
        if (now >= give_up) return refused(Errc::timeout, group.number);
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handles());
        now = osal.now();
    }
}

// Receives a group with overlapping cycles. For any other group, no cycle was sent.
[[gnu::noinline]] Result<std::uint32_t> receive_special(Master& master, ProcessGroup& group, Duration timeout) {
    if (group.overlap.sets > 1) return master.network.overlap->receive(master, group, timeout);
    return nothing_sent(group);
}

[[gnu::noinline]] Result<> send_special(Master& master, ProcessGroup& group, Time now) {
    Link& link = master.network.engine.link();
    if (group.overlap.sets > 1) return master.network.overlap->send(group, link, now);
    if (!master.owned_by_caller()) return refused(Errc::not_owner, group.number);
    return send_cycle(group, link, now);
}

// Calls `now` only if there is a group to send.
template <class Now>
[[gnu::always_inline]] inline Result<> send_group(Context& ctx, std::uint8_t group, Now now) {
    Master* master = master_of(ctx);
    if (master == nullptr) return refused(Errc::wrong_state, group);
    Network& network = master->network;
    if (group >= network.process.groups.size()) return refused_number(network, group);
    const Time at = now(master->osal);
    ProcessGroup& wanted = network.process.groups[group];
    // Another thread may only send a group whose cycles overlap.
    if (!master->owned_by_caller()) [[unlikely]]
        return network.overlapping.load(std::memory_order_acquire) ? send_special(*master, wanted, at)
                                                                   : refused(Errc::not_owner, group);
    if (wanted.special) [[unlikely]]
        return send_special(*master, wanted, at);
    return send_frames(wanted, network.engine.link(), at);
}

}  // namespace

const OverlapFeature kOverlapFeature{.send = send_overlapped, .receive = receive_overlapped};

Result<> send_processdata(Context& ctx, std::uint8_t group) {
    return send_group(ctx, group, [](Osal& osal) { return osal.now(); });
}

Result<> send_processdata(Context& ctx, Time now, std::uint8_t group) {
    return send_group(ctx, group, [now](Osal&) { return now; });
}

Result<std::uint32_t> receive_processdata(Context& ctx, Duration timeout, std::uint8_t group) {
    Master* master = master_of(ctx);
    if (master == nullptr) return refused(Errc::wrong_state, group);
    if (!master->owned_by_caller()) [[unlikely]]
        return refused(Errc::not_owner, group);
    Network& network = master->network;
    if (group >= network.process.groups.size()) return refused_number(network, group);
    ProcessGroup& wanted = network.process.groups[group];
    if (!wanted.under_way) [[unlikely]]
        return receive_special(*master, wanted, timeout);
    Engine& engine = network.engine;
    const Time sent = engine.link().last_cycle();
    const CycleEnd end = engine.receive_cycle(wanted.prepared, sent);
    if (end == CycleEnd::missing) [[unlikely]]
        return wait_for_cycle(*master, wanted, timeout);
    return end_cycle(wanted, engine.link(), end, sent);
}

bool inputs_fresh(Context& ctx, std::uint16_t slave) {
    Master* master = master_of(ctx);
    if (master == nullptr || slave < 1 || slave > master->network.count) return false;
    const Slave& asked = master->network.slave(slave);
    const auto groups = master->network.process.groups;
    return asked.image.group < groups.size() && is_fresh(groups[asked.image.group], asked);
}

PlannedDatagram process_datagram(Context& ctx, std::size_t n, std::uint8_t group) {
    Master* master = master_of(ctx);
    if (master == nullptr || group >= master->network.process.groups.size()) return {};
    const ProcessGroup& mapped = master->network.process.groups[group];
    if (!mapped.mapped || n >= mapped.datagrams.size()) return {};
    const DatagramPlan& plan = mapped.plans[n];
    return {static_cast<std::uint8_t>(plan.command), plan.address, plan.bytes, plan.frame};
}

}  // namespace margay
