// Process data by the public API: mapping, and the cycle.
#include "context_access.hpp"
#include "network/network.hpp"
#include "osal/osal.hpp"
#include "request_queue.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

Error refused(Errc code, std::uint8_t group) {
    return {.code = code,
            .step = Step::exchange_process_data,
            .index = code == Errc::unknown_group ? std::uint16_t{group} : std::uint16_t{0}};
}

// A hook finds its slave in PREOP, also when the group was mapped before.
void go_back(Context& ctx, const Slave& slave) {
    StateRequest request;
    request.slave = slave.position;
    request.state = AlState::preop;
    (void)submit_and_wait(ctx, request);  // the slave's own mapping tells what is wrong with it
}

void call_hooks(Context& ctx, std::uint8_t group) {
    Network& network = *ContextAccess::network(ctx);
    for (Slave& slave : network.slaves()) {
        if (slave.config.group != group || slave.hooks.preop_to_safeop == nullptr || !slave.seen) continue;
        if (slave.al.state == AlState::safeop || slave.al.state == AlState::op) go_back(ctx, slave);
        const auto done = slave.hooks.preop_to_safeop(ctx, slave.position, slave.hooks.user);
        slave.hook_failed = !done.ok();
        if (!done) network.note(slave, done.error());
    }
}

// Not all frames of the cycle are here yet.
[[gnu::noinline]] Result<std::uint32_t> wait_for_cycle(Context& ctx, ProcessGroup& group, Duration timeout) {
    group.cycle_received = group.cycles_sent;
    group.under_way = false;
    Engine& engine = ContextAccess::network(ctx)->engine;
    Osal& osal = *ContextAccess::osal(ctx);
    Nic& nic = engine.link().nic();
    Time now = osal.now();
    const Time give_up = now + timeout;
    while (now < give_up) {
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handle());
        now = osal.now();
        if (engine.receive_cycle(group.prepared, now) != CycleEnd::missing) break;
    }
    return judge_cycle(group, group.prepared, engine.link(), now);
}

// The oldest cycle that is under way, or the one that another thread sends while this one waits for it. Its time counts
// from when it was sent.
[[gnu::noinline]] Result<std::uint32_t> receive_overlapped(Context& ctx, ProcessGroup& group, Duration timeout) {
    Network& network = *ContextAccess::network(ctx);
    Engine& engine = network.engine;
    Osal& osal = *ContextAccess::osal(ctx);
    Nic& nic = engine.link().nic();
    if (!group.mapped) return refused(Errc::unknown_group, group.number);
    Time now = osal.now();
    const Time start = now;
    Time from = start;
    bool none = false;
    note_cycle(network.queue, osal, now);
    for (;;) {
        const auto frames = oldest_cycle(group);
        // The other thread has sent it meanwhile, however long ago it has read its clock for that.
        if (none && !frames.empty()) from = now;
        none = frames.empty();
        const bool all = !none && engine.receive_overlapped(frames, now);
        while (none && engine.receive_one(now)) {
        }
        const Time give_up = (none ? start : std::max(from, sent_at(group))) + timeout;
        if (all || (now >= give_up && !none)) return end_overlapped(group, engine.link(), now);
        if (now >= give_up) return refused(Errc::timeout, group.number);
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handle());
        now = osal.now();
    }
}

// A group without a cycle of its own that is under way.
[[gnu::noinline]] Result<std::uint32_t> receive_special(Context& ctx, ProcessGroup& group, Duration timeout) {
    if (group.overlap.sets > 1) return receive_overlapped(ctx, group, timeout);
    return nothing_sent(group);
}

[[gnu::noinline]] Result<> send_special(Context& ctx, ProcessGroup& group, Time now) {
    Network& network = *ContextAccess::network(ctx);
    if (group.overlap.sets > 1) return send_overlapped(group, network.engine.link(), now);
    note_cycle(network.queue, *ContextAccess::osal(ctx), now);
    return send_cycle(group, network.engine.link(), now);
}

}  // namespace

Result<std::size_t> config_map(Context& ctx, std::span<std::byte> image, std::uint8_t group) {
    if (ContextAccess::network(ctx) == nullptr) return Error{.code = Errc::wrong_state, .step = Step::map_process_data};
    call_hooks(ctx, group);
    MapRequest request;
    request.group = group;
    request.image = image;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    return request.bytes;
}

namespace {

// `now` is called when it is known that there is something to be sent.
template <class Now>
[[gnu::always_inline]] inline Result<> send_group(Context& ctx, std::uint8_t group, Now now) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr) return refused(Errc::wrong_state, group);
    if (group >= network->process.groups.size()) return refused(Errc::unknown_group, group);
    Osal& osal = *ContextAccess::osal(ctx);
    const Time at = now(osal);
    ProcessGroup& wanted = network->process.groups[group];
    if (wanted.special) [[unlikely]]
        return send_special(ctx, wanted, at);
    note_cycle(network->queue, osal, at);
    return send_frames(wanted, network->engine.link(), at);
}

}  // namespace

Result<> send_processdata(Context& ctx, std::uint8_t group) {
    return send_group(ctx, group, [](Osal& osal) { return osal.now(); });
}

Result<> send_processdata(Context& ctx, Time now, std::uint8_t group) {
    return send_group(ctx, group, [now](Osal&) { return now; });
}

Result<std::uint32_t> receive_processdata(Context& ctx, Duration timeout, std::uint8_t group) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr) return refused(Errc::wrong_state, group);
    if (group >= network->process.groups.size()) return refused(Errc::unknown_group, group);
    ProcessGroup& wanted = network->process.groups[group];
    if (!wanted.under_way) [[unlikely]]
        return receive_special(ctx, wanted, timeout);
    Engine& engine = network->engine;
    const Time sent = engine.link().last_cycle();
    const CycleEnd end = engine.receive_cycle(wanted.prepared, sent);
    if (end == CycleEnd::missing) [[unlikely]]
        return wait_for_cycle(ctx, wanted, timeout);
    return end_cycle(wanted, engine.link(), end, sent);
}

bool inputs_fresh(Context& ctx, std::uint16_t slave) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr || slave < 1 || slave > network->count) return false;
    const Slave& asked = network->slave(slave);
    if (asked.config.group >= network->process.groups.size()) return false;
    return is_fresh(network->process.groups[asked.config.group], asked);
}

}  // namespace margay
