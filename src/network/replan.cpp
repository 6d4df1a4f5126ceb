#include "network/replan.hpp"

#include "network/members.hpp"

#include <algorithm>

namespace margay {
namespace {

Error fault(Errc code, std::uint8_t group) {
    Error error{.code = code, .step = Step::map_process_data};
    if (code == Errc::unknown_group) error.index = group;
    return error;
}

Result<std::size_t> plan(Network& network, const ProcessGroup& group, bool block_lrw) {
    GroupConfiguration wanted = group.config;
    wanted.dc_reference = group.dc_reference;
    wanted.block_lrw = block_lrw;
    return plan_datagrams(network.slaves(), group.number, wanted, group.layout, network.process.scratch);
}

// The frames were planned for all slaves of the group.
void count_again(Network& network, ProcessGroup& group) {
    for (const Slave& slave : network.slaves()) {
        if (slave.image.group != group.number || slave.takes_part) continue;
        const SlaveFmmus ranges = exchanged_ranges(slave, group.layout);
        for (std::size_t n = 0; n < group.statuses.size(); ++n) {
            const std::uint16_t share = working_counter_of(ranges, group.plans[n]);
            group.statuses[n].accepted = static_cast<std::uint16_t>(group.statuses[n].accepted - share);
        }
    }
    begin_counting(network, group);
}

}  // namespace

Result<> replan(Network& network, std::uint8_t number) {
    ProcessGroup& group = network.process.groups[number];
    if (group.mapping) return fault(Errc::busy, number);
    if (!group.mapped) return fault(Errc::unknown_group, number);
    if (group.overlap.sets > 1) return fault(Errc::unsupported, number);
    const bool blocked =
        std::ranges::none_of(group.plans, [](const DatagramPlan& plan) { return plan.command == wire::Command::LRW; });
    const auto count = plan(network, group, group.config.block_lrw);
    if (!count) return count.error();
    Engine& engine = network.engine;
    const auto built = prepare_again(network.process, group, *count, engine.link(), engine.now());
    if (!built) {  // the frames of the group are free now: there is room for those that it had
        const auto before = plan(network, group, blocked);
        if (before) static_cast<void>(prepare_again(network.process, group, *before, engine.link(), engine.now()));
    }
    count_again(network, group);
    return built;
}

}  // namespace margay
