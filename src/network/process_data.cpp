#include "network/process_data.hpp"

#include "network/coincidence.hpp"
#include "network/doubt.hpp"
#include "network/entries.hpp"
#include "util/bits.hpp"

#include <margay/shared_image.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

namespace margay {
namespace {

// Whether [a, a + n) and the run have an element in common.
template <class T>
bool overlaps(std::size_t a, std::size_t n, std::span<T> run, std::span<T> all) {
    if (run.empty()) return false;
    const auto first = static_cast<std::size_t>(run.data() - all.data());
    return a < first + run.size() && first < a + n;
}

// Returns the first run of `n` free elements, or all.size().
template <class T, class RunOf>
std::size_t find_free(std::span<T> all, std::size_t n, std::span<ProcessGroup> groups, RunOf run_of) {
    for (std::size_t at = 0; at + n <= all.size(); ++at) {
        const bool taken =
            std::ranges::any_of(groups, [&](const ProcessGroup& g) { return overlaps(at, n, run_of(g), all); });
        if (!taken) return at;
    }
    return all.size();
}

// The first slave of datagram `n` that is known not to take part, or at whose address another slave may answer; 0: none
// is known.
std::uint16_t lost_slave(const ProcessGroup& group, std::size_t n) {
    for (const Slave& slave : group.slaves) {
        const bool counted = group.marks[slave.number - 1U].counted;
        const bool absent = slave.al.state == AlState::none || (counted && !slave.takes_part) ||
                            group.marks[slave.number - 1U].was_away;
        if (slave.image.group != group.number || !absent) continue;
        if (slave.unplaced && counted && n == 0) return slave.number;
        if (n >= group.plans.size()) continue;
        if (working_counter_of(exchanged_ranges(slave, group.layout), group.plans[n]) > 0) return slave.number;
    }
    return 0;
}

// Whether inputs of another slave than `named` were left out, because its identity is not compared yet.
bool others_are_doubted(const ProcessGroup& group, std::uint16_t named) {
    return std::ranges::any_of(group.slaves, [&](const Slave& slave) {
        return slave.image.group == group.number && slave.takes_part && slave.number != named &&
               group.marks[slave.number - 1U].was_away;
    });
}

// Without a supervision: whether the lost cycles cover so long a time that a device may have been exchanged. With slow
// cycles these are few cycles.
bool is_silent_for_long(const ProcessGroup& group) {
    constexpr Duration kSilence = std::chrono::milliseconds(250);
    const CyclePace& pace = group.pace;
    return pace.before != Time::min() && group.cycles_lost * (pace.last - pace.before) > kSilence;
}

void zero_bits(MutableBytes image, std::uint64_t first, std::uint64_t bits) {
    static constexpr std::array<std::byte, 1> kZero{};
    for (const std::uint64_t end = first + bits; first < end;) {
        const std::uint64_t count = std::min<std::uint64_t>(end - first, 8 - first % 8);
        copy_bits(image, first, kZero, 0, count);
        first += count;
    }
}

// Copies the inputs of the slaves that take part, and their mailbox status bits, but no bit of the other slaves.
void copy_inputs(void* user, const PreparedFrame& frame, std::size_t n, Bytes inputs) {
    const auto& group = *static_cast<const ProcessGroup*>(user);
    const DatagramPlan& plan = group.plans[static_cast<std::size_t>(frame.datagrams[n].status - group.statuses.data())];
    const std::uint64_t first = std::uint64_t{plan.image_input} * 8;
    const std::uint64_t end = first + std::uint64_t{plan.input_bytes} * 8;
    const auto copy = [&](std::uint64_t from, std::uint64_t bits) {
        const std::uint64_t begin = std::max(first, from);
        const std::uint64_t stop = std::min(end, from + bits);
        if (begin < stop) copy_bits(group.image, begin, inputs, begin - first, stop - begin);
    };
    for (const Slave& slave : group.slaves) {
        if (slave.image.group != group.number || !slave.takes_part) continue;
        if (group.marks[slave.number - 1U].was_away) continue;  // another device may have sent these inputs
        copy(slave.image.inputs.offset_bits, slave.image.inputs.bits);
        if (slave.image.mailbox_status_bit != SlaveImage::kNone) copy(slave.image.mailbox_status_bit, 1);
    }
}

constexpr FrameOwner kOwner{
    .copy_inputs = copy_inputs,
    .is_sure = [](void* user, const DatagramStatus& status,
                  bool changed) { return is_sure(*static_cast<ProcessGroup*>(user), status, changed); },
};

PreparedDatagram append_datagram(ProcessGroup& group, std::size_t n, wire::FrameBuilder& builder) {
    const DatagramPlan& plan = group.plans[n];
    const auto offset = static_cast<std::uint16_t>(builder.size());
    (void)builder.append(plan.command, 0, plan.address, plan.bytes);
    return {.output = group.image.subspan(plan.image_output, plan.output_bytes),
            .input = group.image.subspan(plan.image_input, plan.input_bytes),
            .input_at = plan.input_at,
            .offset = offset,
            .bytes = plan.bytes,
            .status = &group.statuses[n]};
}

std::span<PreparedReading> append_readings(ProcessGroup& group, const ReadingPlans& plans,
                                           wire::FrameBuilder& builder) {
    for (std::size_t n = 0; n < plans.count; ++n) {
        const ReadingPlan& plan = plans.at[n];
        group.readings[n] = {.into = &(group.*plan.into)};
        group.readings[n].offset = builder.size() & 0xFFFU;
        group.readings[n].bytes = plan.bytes & 15U;
        (void)builder.append(plan.command, 0, plan.address, plan.bytes);
    }
    return std::span(group.readings).first(plans.count);
}

void finish(PreparedFrame& frame, wire::FrameBuilder& builder) {
    frame.last = static_cast<std::uint16_t>(builder.last());
    frame.size = static_cast<std::uint16_t>(builder.finish().size());
    frame.datagram_count = static_cast<std::uint16_t>(frame.datagrams.size() + frame.readings.size());
    frame.wire_bytes = static_cast<std::uint16_t>(wire::bytes_on_the_wire(frame.size));
    frame.slot = nullptr;
    frame.refused = frame.parked = frame.no_time = false;
    frame.own.prepared = &frame;
    frame.own.length = static_cast<std::uint16_t>(frame.size - wire::kFramePrefixBytes);
    frame.end = CycleEnd::missing;
    frame.settle();
}

// Assigns free elements of the tables to the group and returns its datagrams. Errors: too_many_frames.
Result<std::span<PreparedDatagram>> reserve(ProcessTables& tables, ProcessGroup& group, std::size_t frames,
                                            std::size_t count) {
    const std::size_t frames_at =
        find_free(tables.frames, frames, tables.groups, [](const ProcessGroup& g) { return g.prepared; });
    const std::size_t datagrams_at =
        find_free(tables.plans, count, tables.groups, [](const ProcessGroup& g) { return g.plans; });
    if (frames_at + frames > tables.frames.size() || datagrams_at + count > tables.plans.size()) {
        Error error{.code = Errc::too_many_frames, .step = Step::map_process_data};
        error.expected = static_cast<std::uint32_t>(frames);
        error.actual = static_cast<std::uint32_t>(tables.frames.size());
        for (const ProcessGroup& g : tables.groups) error.actual -= static_cast<std::uint32_t>(g.prepared.size());
        return error;
    }
    group.prepared = tables.frames.subspan(frames_at, frames);
    group.plans = tables.plans.subspan(datagrams_at, count);
    group.statuses = tables.statuses.subspan(datagrams_at, count);
    group.datagrams = group.statuses;
    return tables.datagrams.subspan(datagrams_at, count);
}

void accept_plans(ProcessGroup& group, std::span<const DatagramPlan> planned) {
    for (std::size_t n = 0; n < planned.size(); ++n) {
        group.plans[n] = planned[n];
        const std::uint16_t wkc = planned[n].expected_wkc;
        group.statuses[n] = {.expected = wkc, .accepted = wkc, .full = wkc};
        group.expected_wkc += wkc;
    }
}

// Datagrams of a frame: from `begin` up to, but not including, `end`.
struct DatagramRange {
    std::size_t begin = 0;
    std::size_t end = 0;
};

void build_frame(ProcessGroup& group, PreparedFrame& frame, std::span<PreparedDatagram> datagrams, DatagramRange range,
                 const ReadingPlans& readings, Link& link) {
    wire::FrameBuilder builder(frame.bytes, link.nic().source_mac());
    for (std::size_t n = range.begin; n < range.end; ++n) datagrams[n] = append_datagram(group, n, builder);
    frame.datagrams = datagrams.subspan(range.begin, range.end - range.begin);
    frame.readings = {};
    if (readings.count > 0) frame.readings = append_readings(group, readings, builder);
    finish(frame, builder);
    // Overlapped frames do not send inputs: the inputs belong to the owner's thread, not to the sending thread.
    frame.overlapped = group.overlap.sets > 1;
    frame.apart = group.layout.overlapped || frame.overlapped;
    frame.set_park(group.holds_inputs, group.number);
    frame.owner = &kOwner;
    frame.group = &group;
}

// Whether the reply to the frame came back without the mark of the first ESC. Resets the flag: call it once for each
// cycle.
bool reset_unmarked(PreparedFrame& frame) {
    const bool riders = frame.slot != nullptr && frame.slot->unmarked;
    return std::exchange(frame.own.unmarked, false) || riders;
}

Error cycle_error(Errc code, std::uint8_t group) {
    return {.code = code, .step = Step::exchange_process_data, .index = group};
}

}  // namespace

void unprepare(ProcessGroup& group, Link& link, Time now) {
    for (PreparedFrame& frame : group.prepared) {
        link.give_up_prepared(frame, now);
        if (frame.overlapped) link.forget_overlapped(frame, now);
    }
    release_entries(group);
    const GroupConfiguration config = group.config;
    const std::uint8_t number = group.number;
    const std::uint32_t mappings = group.mappings;
    const bool was_mapped = group.was_mapped;
    const std::uint8_t next_place = group.next_place;
    std::destroy_at(&group);
    std::construct_at(&group);
    group.config = config;
    group.number = number;
    group.mappings = mappings;
    group.was_mapped = was_mapped;
    group.next_place = next_place;
}

Result<> prepare(ProcessTables& tables, ProcessGroup& group, std::size_t count, Link& link) {
    const auto planned = tables.scratch.first(count);
    GroupConfiguration wanted = group.config;
    wanted.dc_reference = group.dc_reference;
    const ReadingPlans readings = plan_readings(group.slaves, wanted, group.by_position);
    // A first frame without datagrams of the group, whose space is completely reserved, is not sent.
    const std::uint16_t first = planned.empty() || readings.count > 0 ? std::uint16_t{0} : planned.front().frame;
    const std::size_t end = planned.empty() ? readings.count > 0 : planned.back().frame + 1U;
    const std::size_t frame_count = end - first;
    const std::uint8_t sets = group.config.cycles_in_flight;
    const auto datagrams = reserve(tables, group, frame_count * sets, count);
    if (!datagrams) return datagrams.error();
    group.frames = static_cast<std::uint16_t>(frame_count);
    group.overlap.sets = sets;
    accept_plans(group, planned);
    // The frames of all sets have the same datagrams.
    for (std::size_t set = 0; set < sets; ++set) {
        for (std::size_t n = 0, f = 0; f < frame_count; ++f) {
            const std::size_t begin = n;
            while (n < count && planned[n].frame == f + first) ++n;
            build_frame(group, group.prepared[set * frame_count + f], *datagrams, {begin, n},
                        f == 0 ? readings : ReadingPlans{}, link);
        }
    }
    if (sets > 1)
        link.allow_overlapping();
    else
        link.add_pace(group.pace);
    group.mapped = true;
    group.complete = true;
    group.special = group.extras || sets > 1 || frame_count == 0;
    return Result<>();
}

void set_time_standby(ProcessGroup& group, StationAddress standby) {
    if (group.overlap.sets > 1) return;
    for (PreparedReading& reading : group.readings)
        if (reading.into == &group.dc_time && !reading.changes) reading.standby = standby.value;
}

void begin_by_reading(ProcessGroup& group) {
    for (PreparedFrame& frame : group.prepared) {
        for (const PreparedReading& reading : frame.readings) {
            if (reading.into != &group.dc_time) continue;
            std::byte& command = frame.bytes[reading.offset];
            if (command == static_cast<std::byte>(wire::Command::FRMW))
                command = static_cast<std::byte>(wire::Command::FPRD);
            if (command == static_cast<std::byte>(wire::Command::ARMW))
                command = static_cast<std::byte>(wire::Command::APRD);
        }
    }
}

TimeSource time_source(const ProcessGroup& group) {
    for (const PreparedFrame& frame : group.prepared) {
        for (const PreparedReading& reading : frame.readings) {
            if (reading.into != &group.dc_time) continue;
            const Bytes head = Bytes(frame.bytes).subspan(reading.offset);
            return {wire::DatagramLayout::command::load(head), load_le<std::uint16_t>(head, 2)};
        }
    }
    return {};
}

bool is_time_whole(const ProcessGroup& group) {
    if (group.dc_reference == 0 || group.dc_reference > group.slaves.size()) return true;
    const auto found = std::ranges::find(group.readings, &group.dc_time, &PreparedReading::into);
    const Slave& reference = group.slaves[group.dc_reference - 1U];
    const TimeSource source = time_source(group);
    const bool by_position = source.command == wire::Command::ARMW || source.command == wire::Command::APRD;
    return found != group.readings.end() && found->bytes == sizeof(std::uint64_t) && reference.dl.dc_64bit &&
           (by_position || source.address == reference.station_address.value);
}

std::uint16_t cycles_with_time(const ProcessGroup& group) {
    const auto found = std::ranges::find(group.readings, &group.dc_time, &PreparedReading::into);
    return found == group.readings.end() ? std::uint16_t{0} : found->times;
}

bool redirect_time(ProcessGroup& group, const Slave* reference) {
    if (group.overlap.sets > 1) {
        for (PreparedReading& reading : group.readings)
            if (reading.into == &group.dc_time) reading.held = reference == nullptr;
        return false;
    }
    const TimeSource source =
        reference == nullptr ? TimeSource{} : time_source_of(group.slaves, *reference, group.by_position);
    for (PreparedFrame& frame : group.prepared) {
        for (PreparedReading& reading : frame.readings) {
            if (reading.into != &group.dc_time) continue;
            reading.changes = true;
            reading.by_position = source.command == wire::Command::ARMW;
            reading.standby = source.address;
            // If a frame is on the wire, the next frame is built with the new address: a loop that sends before it
            // polls always has a frame on the wire.
            if (frame.slot == nullptr && !frame.parked) change_time(frame, reading);
        }
    }
    if (reference != nullptr) group.dc_reference = reference->number;
    return true;
}

Result<> send_cycle(ProcessGroup& group, Link& link, Time now) {
    if (!group.mapped) return cycle_error(Errc::unknown_group, group.number);
    if (group.extras) set_outputs(group);
    return send_frames(group, link, now);
}

Error nothing_sent(const ProcessGroup& group) {
    return cycle_error(group.mapped ? Errc::no_cycle : Errc::unknown_group, group.number);
}

std::uint32_t sent_cycles(const ProcessGroup& group) {
    return group.overlap.sets > 1 ? group.overlap.sent.load(std::memory_order_acquire) : group.cycles_sent;
}

bool is_fresh(const ProcessGroup& group, const Slave& slave) {
    if (!slave.takes_part || !group.mapped || group.mapping || is_joining(group, slave)) return false;
    if (group.marks[slave.number - 1U].was_away) return false;  // another slave may have sent the inputs
    const bool has_inputs = slave.image.inputs.bits > 0;
    const ImagePart& part = has_inputs ? slave.image.inputs : slave.image.outputs;
    const std::uint64_t end = part.offset_bits + std::uint64_t{part.bits};
    bool any = false;
    for (std::size_t n = 0; n < group.plans.size(); ++n) {
        const DatagramPlan& plan = group.plans[n];
        const std::uint64_t first = std::uint64_t{has_inputs ? plan.image_input : plan.image_output} * 8;
        const std::uint64_t bits = std::uint64_t{has_inputs ? plan.input_bytes : plan.output_bytes} * 8;
        if (first >= end || first + bits <= part.offset_bits) continue;
        if (!group.statuses[n].fresh) return false;
        any = true;
    }
    return any;
}

void settle_lost_inputs(ProcessGroup& group) {
    if (group.config.lost_inputs == LostInputs::keep || !group.mapped) return;
    for (const Slave& slave : group.slaves)
        if (slave.image.group == group.number && (!slave.takes_part || group.marks[slave.number - 1U].was_away))
            zero_bits(group.image, slave.image.inputs.offset_bits, slave.image.inputs.bits);
}

std::uint16_t invalid_end(const ProcessGroup& group, const SlaveToSlave& copy) {
    for (const bool out : {false, true}) {
        const std::uint16_t number = out ? copy.to_slave : copy.from_slave;
        if (number < 1 || number > group.slaves.size()) return number;
        const SlaveImage& image = group.slaves[number - 1U].image;
        const std::uint64_t end = std::uint64_t{out ? copy.to_bit : copy.from_bit} + copy.bits;
        if (image.group != group.number || copy.bits == 0 || end > (out ? image.outputs : image.inputs).bits)
            return number;
    }
    return 0;
}

void set_outputs(ProcessGroup& group) {
    if (!group.mapped) return;
    SharedImageAccess::take_outputs(group.config.shared, group.image.first(group.output_bytes));
    for (const SlaveToSlave& copy : group.config.copies) {
        if (invalid_end(group, copy) != 0) continue;  // a slave has left the group, or the list has changed
        // Old inputs, or inputs of another device, are not copied: the outputs of the application are sent.
        if (!group.slaves[copy.from_slave - 1U].takes_part || group.marks[copy.from_slave - 1U].was_away) continue;
        const ImagePart& from = group.slaves[copy.from_slave - 1U].image.inputs;
        const ImagePart& to = group.slaves[copy.to_slave - 1U].image.outputs;
        copy_bits(group.image, std::uint64_t{to.offset_bits} + copy.to_bit, group.image,
                  std::uint64_t{from.offset_bits} + copy.from_bit, copy.bits);
    }
}

void give_inputs(ProcessGroup& group) {
    SharedImageAccess::give_inputs(group.config.shared, group.image.subspan(group.output_bytes));
}

Error not_sent(ProcessGroup& group, Link& link) {
    if (!group.mapped) return cycle_error(Errc::unknown_group, group.number);
    // The application may not receive this cycle. Where cycles overlap, the thread that receives has the results.
    for (PreparedFrame& frame : group.prepared)
        if (!frame.overlapped && frame.slot == nullptr && frame.end == CycleEnd::missing) {
            Link::mark_not_received(frame);
            note_refusal(group);
        }
    Error error = cycle_error(Errc::nic, group.number);
    error.actual = static_cast<std::uint32_t>(link.nic().last_error());
    return error;
}

bool is_silent(const ProcessGroup& group, Link& link, Time now) {
    if (!group.prepared.empty()) return false;
    link.look_at_cable(now, 10 * kCableKnown);  // unless poll() has asked the NIC already
    return link.silence() >= kSilentFrames || link.is_down();
}

Result<std::uint32_t> evaluate_cycle(ProcessGroup& group, std::span<PreparedFrame> frames, Link& link, Time now) {
    if (!group.mapped) return cycle_error(Errc::unknown_group, group.number);
    Error error = cycle_error(Errc::working_counter, group.number);
    std::uint32_t missing = 0;
    for (PreparedFrame& frame : frames) {
        if (frame.is_held()) Link::commit_held(frame);  // a frame before this one has not come back
        if (frame.end != CycleEnd::missing || link.take_half(frame, now)) continue;
        if (reset_unmarked(frame)) error.detail = Error::kUnmarked;
        link.give_up_prepared(frame, now);
        Link::mark_not_received(frame);
        ++missing;
    }
    std::uint32_t got = 0;
    bool right = group.complete;
    bool fresh = true;
    for (const DatagramStatus& d : group.datagrams) {
        if (d.came) got += d.got;
        right &= d.right();
        fresh &= d.fresh;
        group.unexpected |= !d.fresh || d.got != d.accepted;
        group.fell_short |= d.came && (!d.fresh || d.got != d.accepted);
    }
    note_cycle(group, fresh && missing == 0);
    settle_lost_inputs(group);
    if (missing > 0 || is_silent(group, link, now)) {
        error.code = Errc::no_frame;
        error.actual = missing;
        if (group.cycles_lost < 0xFFFF) ++group.cycles_lost;
        group.fell_short |= is_silent_for_long(group);
        return error;
    }
    group.cycles_lost = 0;
    if (fresh) give_inputs(group);
    if (right && fresh) return got;  // not fresh: the sum is right, but perhaps other slaves have answered
    error.detail = fresh ? Error::kOthersFresh : 0;
    if (group.mapping) error.detail = Error::kBeingMapped;
    error.expected = group.expected_wkc;
    error.actual = got;
    if (group.mapping) return error;
    if (!group.complete) error.slave = lost_slave(group, 0);
    for (std::size_t n = 0; n < group.datagrams.size() && error.slave == 0; ++n)
        if (!group.datagrams[n].right()) error.slave = lost_slave(group, n);
    if (error.detail == Error::kOthersFresh && others_are_doubted(group, error.slave)) error.detail = 0;
    return error;
}

Result<> send_overlapped(ProcessGroup& group, Link& link, Time now) {
    if (!group.mapped) return cycle_error(Errc::unknown_group, group.number);
    Overlap& overlap = group.overlap;
    const std::uint32_t sent = overlap.sent.load(std::memory_order_relaxed);
    if (sent - overlap.received.load(std::memory_order_acquire) >= overlap.sets) {
        Error error = cycle_error(Errc::busy, group.number);
        error.expected = overlap.sets;
        return error;
    }
    set_outputs(group);
    const Duration since_last = now - std::exchange(overlap.sent_at[overlap.send_set], now);
    const auto frames = group.prepared.subspan(std::size_t{overlap.send_set} * group.frames, group.frames);
    const SendStatus status = link.send_overlapped(frames, since_last);
    overlap.send_set = static_cast<std::uint8_t>(overlap.send_set + 1 == overlap.sets ? 0 : overlap.send_set + 1);
    ++group.cycles_sent;
    overlap.sent.store(sent + 1, std::memory_order_release);
    return status == SendStatus::sent ? Result<>() : not_sent(group, link);
}

std::span<PreparedFrame> oldest_cycle(ProcessGroup& group) {
    if (!is_cycle_sent(group)) return {};
    return group.prepared.subspan(std::size_t{group.overlap.receive_set} * group.frames, group.frames);
}

Result<std::uint32_t> end_overlapped(ProcessGroup& group, Link& link, Time now) {
    Overlap& overlap = group.overlap;
    const auto frames = oldest_cycle(group);
    link.end_overlapped(frames, sent_at(group), now);
    const auto ended = evaluate_cycle(group, frames, link, now);
    overlap.receive_set =
        static_cast<std::uint8_t>(overlap.receive_set + 1 == overlap.sets ? 0 : overlap.receive_set + 1);
    group.cycle_received = overlap.received.load(std::memory_order_relaxed) + 1;
    overlap.received.store(group.cycle_received, std::memory_order_release);
    return ended;
}

}  // namespace margay
