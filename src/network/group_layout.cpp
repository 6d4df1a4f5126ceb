#include "network/group_layout.hpp"

#include "network/members.hpp"
#include "network/settings.hpp"
#include "network/wanted.hpp"

#include <margay/features.hpp>
#include <margay/shared_image.hpp>

#include <algorithm>
#include <functional>

namespace margay {
namespace {

// Whether the application has left the logical address at its default.
bool is_usual_start(const ProcessGroup& group) {
    return group.config.start.value == group.number * GroupConfiguration::kSpacing;
}

// Whether the image can begin at `start` without sharing logical addresses with another group: otherwise the slaves of
// both groups would exchange both images. `all`: also avoids the addresses that the application has chosen for groups
// that are not mapped yet.
bool clear_of_others(const ProcessTables& tables, const ProcessGroup& group, LogicalAddress start, bool all) {
    const std::uint64_t begin = start.value;
    const std::uint64_t end = begin + group.layout.logical_bytes();
    if (end > 0x1'0000'0000) return false;
    return std::ranges::none_of(tables.groups, [&](const ProcessGroup& other) {
        if (&other == &group) return false;
        const std::uint64_t first = other.layout.start.value;
        if (other.mapped && begin < first + other.layout.logical_bytes() && first < end) return true;
        const std::uint64_t chosen = other.config.start.value;
        return all && !is_usual_start(other) && begin <= chosen && chosen < end;
    });
}

// Checks the additional work of each cycle: the slaves of all copies exist, and the copied bits are part of their data.
Result<> check_extras(ProcessGroup& group) {
    group.extras = !group.config.copies.empty() || group.config.shared != nullptr;
    for (const SlaveToSlave& copy : group.config.copies) {
        const std::uint16_t number = invalid_end(group, copy);
        if (number == 0 && copy.from_slave != 0 && copy.to_slave != 0) continue;
        Error error{.code = Errc::unknown_slave, .step = Step::map_process_data, .slave = number};
        error.expected = static_cast<std::uint32_t>(group.slaves.size());
        if (number < 1 || number > group.slaves.size()) return error;
        return invalid_mapping(Argument::copy, number);
    }
    if (SharedImageAccess::attach(group.config.shared, group.output_bytes, group.input_bytes)) return Result<>();
    Error error = group_fault(Errc::capacity, 0);
    error.expected = static_cast<std::uint32_t>(SharedImage::memory_bytes(group.output_bytes, group.input_bytes));
    error.actual = static_cast<std::uint32_t>(group.config.shared->memory_size());
    return error;
}

bool share_octets(Bytes a, Bytes b) {
    const std::less<> before;
    return before(a.data(), b.data() + b.size()) && before(b.data(), a.data() + a.size());
}

bool is_lost(Network& network, std::uint16_t number) {
    return number <= network.count && network.slave(number).al.state == AlState::none;
}

// The slave whose time the cycle of the group carries. The frame passes the slaves before it with the time that the
// master expects, if configdc() has chosen the slave; with zeros otherwise. A lost slave has no place in the ring: the
// reference clock of configdc() is taken in its place, if there is one.
Result<std::uint16_t> choose_time_source(Network& network, const ProcessGroup& group) {
    const Clocks& clocks = network.clocks;
    const std::uint16_t usual = group.number == clocks.settings.group ? clocks.reference : std::uint16_t{0};
    const std::uint16_t wanted = group.config.dc_reference != 0 ? group.config.dc_reference : usual;
    if (wanted == 0 || wanted > network.count) return wanted;  // plan_datagrams() reports a wrong number
    if (is_lost(network, wanted)) return clocks.reference != 0 ? clocks.reference : wanted;
    const bool by_configdc =
        group.config.dc_reference == 0 || (wanted == clocks.reference && wanted == clocks.settings.reference);
    if (by_configdc) return wanted;
    Error error{.code = Errc::clock_before_reference, .step = Step::map_process_data, .slave = wanted};
    error.expected = clock_before(network, wanted);
    return error.expected == 0 ? Result<std::uint16_t>(wanted) : Result<std::uint16_t>(error);
}

// A slave that is away keeps its FMMUs. So each mapping uses other logical addresses, unless the application has chosen
// the address: then the old FMMUs match nothing when the slave comes back.
LogicalAddress next_start(const ProcessTables& tables, ProcessGroup& group) {
    constexpr std::uint32_t kStep = 0x0004'0000;
    constexpr std::uint32_t kSteps = GroupConfiguration::kSpacing / kStep;
    const LogicalAddress start = group.config.start;
    if (!is_usual_start(group) || group.layout.logical_bytes() > kStep) return start;
    for (std::uint32_t n = 0; n < kSteps; ++n) {
        const LogicalAddress next{start.value + group.next_place++ % kSteps * kStep};
        if (clear_of_others(tables, group, next, true)) return next;
    }
    return start;
}

}  // namespace

Result<> lay_out_group(Network& network, std::uint8_t number, MutableBytes image) {
    ProcessTables& tables = network.process;
    ProcessGroup& group = tables.groups[number];
    const Error wrong = invalid_setting(network, group);
    if (wrong.code != Errc::none) return wrong;
    const auto layout = lay_out(network.slaves(), number, group.config, image);
    if (!layout) return layout.error();
    if (group.config.cycles_in_flight > 1 && network.overlap == nullptr) {
        Error error = group_fault(Errc::unsupported, number);
        error.detail = static_cast<std::uint32_t>(Feature::overlap);
        return error;
    }
    group.layout = *layout;
    group.layout.start = next_start(tables, group);
    group.holds_inputs = group.config.hold_inputs;
    if (++group.mappings == 0) group.mappings = 1;
    group.image = image.first(layout->image_bytes());
    group.output_bytes = layout->output_bytes;
    group.input_bytes = layout->input_bytes;
    if (!clear_of_others(tables, group, group.layout.start, false)) return invalid_mapping(Argument::image_start);
    for (const ProcessGroup& other : tables.groups) {
        if (!other.mapped || other.number == number || !share_octets(other.image, group.image)) continue;
        Error error = group_fault(Errc::image_overlaps, 0);
        error.index = other.number;
        return error;
    }
    group.slaves = network.slaves();
    group.marks = network.mark_table;
    const auto extras = check_extras(group);
    if (!extras) return extras;
    const auto reference = choose_time_source(network, group);
    if (!reference) return reference.error();
    for (Slave& slave : network.slaves())
        if (slave.image.group == number) slave.takes_part = exchanges(slave);
    GroupConfiguration wanted = group.config;
    wanted.dc_reference = group.dc_reference = *reference;
    group.by_position = network.clocks.settings.by_position;
    const auto count = plan_datagrams(network.slaves(), number, wanted, group.layout, tables.scratch);
    if (!count) return count.error();
    const auto prepared = prepare(tables, group, *count, network.engine.link());
    if (prepared) group.was_mapped = true;
    if (prepared && network.clocks.begin_cycles != nullptr) network.clocks.begin_cycles(group);
    if (group.overlap.sets > 1) network.overlapping.store(true, std::memory_order_release);
    if (prepared) begin_counting(network, group);
    // No slave takes part before its configuration has ended, because the mapping may be cut meanwhile.
    for (Slave& slave : network.slaves())
        if (slave.image.group == number) set_takes_part(network, slave, false);
    return prepared;
}

}  // namespace margay
