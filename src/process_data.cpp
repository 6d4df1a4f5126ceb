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
    return {.code = code, .step = Step::exchange_process_data, .index = code == Errc::unknown_group ? std::uint16_t{group} : std::uint16_t{0}};
}

void call_hooks(Context& ctx, std::uint8_t group) {
    Network& network = *ContextAccess::network(ctx);
    for (Slave& slave : network.slaves()) {
        if (slave.config.group != group || slave.hooks.preop_to_safeop == nullptr) continue;
        const auto done = slave.hooks.preop_to_safeop(ctx, slave.position, slave.hooks.user);
        slave.hooks.failed = !done.ok();
        if (!done) network.note(slave, done.error());
    }
}

}  // namespace

Result<std::size_t> config_map(Context& ctx, std::span<std::byte> image, std::uint8_t group) {
    if (ContextAccess::network(ctx) == nullptr) return Error{.code = Errc::wrong_state, .step = Step::map_process_data};
    call_hooks(ctx, group);
    MapRequest request;
    request.group = group;
    request.image = image;
    const auto submitted = submit(ctx, request);
    if (!submitted) return submitted.error();
    const auto done = wait(ctx, request);
    if (!done) return done.error();
    return request.bytes;
}

Result<> send_processdata(Context& ctx, std::uint8_t group) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr) return refused(Errc::wrong_state, group);
    if (group >= network->process.groups.size()) return refused(Errc::unknown_group, group);
    note_cycle(ctx);
    return send_cycle(network->process.groups[group], group, network->engine.link(), ContextAccess::osal(ctx)->now());
}

Result<std::uint32_t> receive_processdata(Context& ctx, Duration timeout, std::uint8_t group) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr) return refused(Errc::wrong_state, group);
    if (group >= network->process.groups.size()) return refused(Errc::unknown_group, group);
    ProcessGroup& wanted = network->process.groups[group];
    Engine& engine = network->engine;
    Osal& osal = *ContextAccess::osal(ctx);
    Time now = engine.link().last_cycle();
    Time give_up = kNever;
    while (!cycle_complete(wanted)) {
        if (engine.receive_one(now)) continue;
        now = osal.now();
        if (give_up == kNever) give_up = now + timeout;
        if (now >= give_up) break;
        Nic& nic = engine.link().nic();
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handle());
        now = osal.now();
    }
    return end_cycle(wanted, group, network->slaves(), engine.link(), now);
}

}  // namespace margay
