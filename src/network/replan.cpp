#include "network/replan.hpp"

#include "network/members.hpp"
#include "network/settings.hpp"

#include <algorithm>
#include <array>

namespace margay {
namespace {

Error cannot_replan(Errc code, std::uint8_t group) {
    Error error{.code = code, .step = Step::map_process_data};
    if (code == Errc::unknown_group) error.index = group;
    return error;
}

Result<std::size_t> plan_frames(Network& network, const ProcessGroup& group, bool block_lrw) {
    GroupConfiguration wanted = group.config;
    wanted.dc_reference = group.dc_reference;
    wanted.block_lrw = block_lrw;
    return plan_datagrams(network.slaves(), group.number, wanted, group.layout, network.process.scratch);
}

// The datagram of the time as it is sent now. The reference may have changed or may have been lost since the frames
// were built.
struct SentTime {
    static constexpr std::size_t kAddress = 2;  // offset in the datagram header, behind command and index
    wire::Command command{};
    std::array<std::byte, 4> address{};
    std::array<std::byte, 8> data{};
    std::uint16_t standby = 0;
    bool known = false;
};

// Calls `use` with the reading of the time and with the octets of its datagram.
template <class Use>
void with_time_datagram(ProcessGroup& group, Use use) {
    for (PreparedReading& reading : group.readings)
        if (reading.into == &group.dc_time && !group.prepared.empty())
            use(reading, MutableBytes(group.prepared.front().bytes).subspan(reading.offset));
}

SentTime sent_time(ProcessGroup& group) {
    SentTime sent;
    with_time_datagram(group, [&](PreparedReading& reading, MutableBytes head) {
        if (reading.changes) change_time(group.prepared.front(), reading);
        sent.command = wire::DatagramLayout::command::load(head);
        std::ranges::copy(head.subspan(SentTime::kAddress, sent.address.size()), sent.address.begin());
        std::ranges::copy(head.subspan(wire::kDatagramHeaderBytes, reading.bytes), sent.data.begin());
        sent.standby = reading.standby;
        sent.known = true;
    });
    return sent;
}

void send_time_as(ProcessGroup& group, const SentTime& sent) {
    if (!sent.known) return;
    with_time_datagram(group, [&sent](PreparedReading& reading, MutableBytes head) {
        wire::DatagramLayout::command::store(head, sent.command);
        std::ranges::copy(sent.address, head.subspan(SentTime::kAddress).begin());
        std::ranges::copy(std::span(sent.data).first(reading.bytes), head.subspan(wire::kDatagramHeaderBytes).begin());
        reading.standby = sent.standby;
    });
}

// Gives up frames in flight and builds others. Then the working counters count all slaves. After an error
// the group has no frames.
Result<> prepare_again(ProcessTables& tables, ProcessGroup& group, std::size_t count, Link& link, Time now) {
    for (PreparedFrame& frame : group.prepared) link.give_up_prepared(frame, now);
    const SentTime time = sent_time(group);
    group.prepared = {};
    group.plans = {};
    group.statuses = {};
    group.datagrams = {};
    group.expected_wkc = 0;
    group.under_way = false;
    group.pace.unlink();  // prepare() adds it
    const auto built = prepare(tables, group, count, link);
    if (built) send_time_as(group, time);
    return built;
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
    if (group.mapping) return cannot_replan(Errc::busy, number);
    if (!group.mapped) return cannot_replan(Errc::unknown_group, number);
    if (group.overlap.sets > 1 || group.config.cycles_in_flight > 1) return cannot_replan(Errc::unsupported, number);
    if (group.config.cycles_in_flight == 0) return invalid_mapping(Argument::cycles_in_flight);
    const bool blocked =
        std::ranges::none_of(group.plans, [](const DatagramPlan& plan) { return plan.command == wire::Command::LRW; });
    const auto count = plan_frames(network, group, group.config.block_lrw);
    if (!count) return count.error();
    Engine& engine = network.engine;
    const auto built = prepare_again(network.process, group, *count, engine.link(), engine.now());
    if (!built) {  // the frames of the group are free now, so its old frames fit
        const auto before = plan_frames(network, group, blocked);
        if (before) static_cast<void>(prepare_again(network.process, group, *before, engine.link(), engine.now()));
    }
    count_again(network, group);
    return built;
}

}  // namespace margay
