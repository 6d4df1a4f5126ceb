#include "network/image_datagrams.hpp"

#include <algorithm>

namespace margay {
namespace {

using wire::Command;

constexpr std::uint32_t kOverhead = wire::kDatagramOverheadBytes;
constexpr std::uint32_t kFrameRoom = wire::kMaxDatagramsBytes;

// A range of logical address space that one command exchanges. Offsets in octets from the image's logical start.
struct Range {
    Command command = Command::NOP;
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
};

struct Ranges {
    std::array<Range, 3> at{};
    std::size_t count = 0;
};

// An ESC increments the working counter of a datagram once, however many of its FMMUs were read (ETG.1000.4 "Working
// counter"). The mailbox status can always be read. So it has a datagram of its own: in the datagram of the inputs, it
// would increment the working counter even if the inputs were not read.
Ranges choose_ranges(const ImageLayout& layout, bool block_lrw) {
    const std::uint32_t inputs_begin = layout.overlapped ? 0 : layout.output_bytes;
    const std::uint32_t status_begin = layout.logical_bytes() - layout.status_bytes;
    const std::uint32_t inputs = layout.input_bytes - layout.status_bytes;
    Ranges s;
    if (layout.output_bytes > 0 && inputs > 0 && !block_lrw) {
        s.at[s.count++] = {Command::LRW, 0, status_begin};
    } else {
        if (layout.output_bytes > 0) s.at[s.count++] = {Command::LWR, 0, layout.output_bytes};
        if (inputs > 0) s.at[s.count++] = {Command::LRD, inputs_begin, inputs_begin + inputs};
    }
    if (layout.status_bytes > 0) s.at[s.count++] = {Command::LRD, status_begin, layout.logical_bytes()};
    return s;
}

// The logical octets of one slave's data, to decide where to divide.
struct Octets {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
};
Octets octets(const ImagePart& part, std::uint32_t shift) {
    const auto first = part.offset_bits / 8;
    return {first - shift, first - shift + static_cast<std::uint32_t>(part.bytes.size())};
}

class Planner {
  public:
    Planner(std::span<const Slave> slaves, std::uint8_t group, const ImageLayout& layout, const Ranges& ranges,
            std::uint32_t reserve, std::span<DatagramPlan> into)
        : slaves_(slaves), group_(group), layout_(layout), ranges_(ranges), room_(kFrameRoom - reserve), into_(into) {}

    // Returns the number of datagrams. It may exceed the size of `into`: datagrams beyond it are not stored.
    std::size_t run() {
        for (std::size_t s = 0; s < ranges_.count; ++s)
            for (std::uint32_t at = ranges_.at[s].begin; at < ranges_.at[s].end;) at = next(s, at);
        return count_;
    }

  private:
    // Places one datagram, or starts a new frame. Returns the start of the next datagram in the range.
    std::uint32_t next(std::size_t s, std::uint32_t at) {
        const Range& range = ranges_.at[s];
        const std::uint32_t fits = room_ > kOverhead ? room_ - kOverhead : 0;
        if (fits == 0) return open_frame(at);
        if (range.end - at <= fits) return put(range, at, range.end);
        const std::uint32_t most = at + fits;
        const std::uint32_t whole = slave_boundary(range, at, most);
        const std::uint32_t needed = frames_needed(s, at, room_);
        if (whole > at && frames_needed(s, whole, kFrameRoom) + 1 <= needed) return put(range, at, whole);
        // The data of no complete slave fits. If a new frame does not increase the number of frames, the rest of this
        // frame stays empty; otherwise the data of the slave is divided.
        if (room_ < kFrameRoom && whole == at && frames_needed(s, at, kFrameRoom) + 1 <= needed) return open_frame(at);
        return put(range, at, most);
    }

    std::uint32_t open_frame(std::uint32_t at) {
        ++frame_;
        room_ = kFrameRoom;
        return at;
    }

    // The lowest number of frames for all data from `at` on, with `room` free octets in the first frame.
    [[nodiscard]] std::uint32_t frames_needed(std::size_t s, std::uint32_t at, std::uint32_t room) const {
        std::uint32_t frames = 1;
        std::uint32_t left = ranges_.at[s].end - at;
        for (;;) {
            while (left > 0) {
                if (room <= kOverhead) {
                    ++frames;
                    room = kFrameRoom;
                }
                const std::uint32_t part = std::min(left, room - kOverhead);
                left -= part;
                room -= part + kOverhead;
            }
            if (++s >= ranges_.count) break;
            left = ranges_.at[s].end - ranges_.at[s].begin;
        }
        return frames;
    }

    // The last offset from `at` to `most` at which the datagram can end without dividing the data of a slave.
    [[nodiscard]] std::uint32_t slave_boundary(const Range& range, std::uint32_t at, std::uint32_t most) const {
        std::uint32_t cut = most;
        for (bool moved = true; moved && cut > at;) {
            moved = false;
            const auto keep_whole = [&](const ImagePart& part, std::uint32_t shift) {
                const Octets o = octets(part, shift);
                if (o.begin >= cut || cut >= o.end) return;
                cut = std::max(o.begin, at);
                moved = cut > at;
            };
            for (const Slave& slave : slaves_) {
                if (slave.image.group != group_) continue;
                if (range.command != Command::LRD) keep_whole(slave.image.outputs, 0);
                if (range.command != Command::LWR) keep_whole(slave.image.inputs, layout_.input_shift_bytes());
            }
        }
        return cut;
    }

    std::uint32_t put(const Range& range, std::uint32_t begin, std::uint32_t end) {
        DatagramPlan plan{.command = range.command,
                          .frame = frame_,
                          .address = {layout_.start.value + begin},
                          .bytes = static_cast<std::uint16_t>(end - begin)};
        if (range.command != Command::LRD && begin < layout_.output_bytes) {
            plan.image_output = begin;
            plan.output_bytes = static_cast<std::uint16_t>(std::min(end, layout_.output_bytes) - begin);
        }
        const std::uint32_t inputs_begin = layout_.overlapped ? 0 : layout_.output_bytes;
        if (range.command != Command::LWR && end > inputs_begin) {
            const std::uint32_t first = std::max(begin, inputs_begin);
            plan.image_input = first + layout_.input_shift_bytes();
            plan.input_bytes = static_cast<std::uint16_t>(end - first);
            plan.input_at = static_cast<std::uint16_t>(first - begin);
        }
        if (count_ < into_.size()) into_[count_] = plan;
        ++count_;
        room_ -= kOverhead + (end - begin);
        return end;
    }

    std::span<const Slave> slaves_;
    std::uint8_t group_;
    const ImageLayout& layout_;
    const Ranges& ranges_;
    std::uint32_t room_;
    std::span<DatagramPlan> into_;
    std::size_t count_ = 0;
    std::uint16_t frame_ = 0;
};

Result<> check_reference(std::span<const Slave> slaves, std::uint16_t reference) {
    Error error{.code = Errc::none, .step = Step::map_process_data, .slave = reference};
    if (reference > slaves.size()) {
        error.code = Errc::unknown_slave;
        error.expected = static_cast<std::uint32_t>(slaves.size());
    } else if (reference != 0 && !slaves[reference - 1U].dl.dc && slaves[reference - 1U].al.state != AlState::none) {
        error.code = Errc::invalid_argument;
        error.detail = static_cast<std::uint32_t>(Argument::dc_reference);
    }
    return error;
}

}  // namespace

TimeSource by_station(const Slave& reference) { return {Command::FRMW, reference.station_address.value}; }

TimeSource time_source_of(std::span<const Slave> slaves, const Slave& reference, bool by_position) {
    const auto lost = [](const Slave& slave) { return slave.al.state == AlState::none; };
    if (!by_position || reference.ring_position == 0 || std::ranges::any_of(slaves, lost)) return by_station(reference);
    return {Command::ARMW, RingPosition{static_cast<std::uint16_t>(reference.ring_position - 1)}.on_wire()};
}

ReadingPlans plan_readings(std::span<const Slave> slaves, const GroupConfiguration& wanted, bool by_position) {
    ReadingPlans plans;
    const auto add = [&plans](const ReadingPlan& plan) { plans.at[plans.count++] = plan; };
    if (wanted.al_status)
        add({Command::BRD,
             {std::uint16_t{0}, wire::reg::kAlStatus.address},
             wire::reg::kAlStatus.length,
             &Group::al_status});
    if (wanted.dc_reference != 0) {
        // While the reference is lost, the cycle carries no time: the other slaves would copy the octets that the
        // master has sent.
        const Slave& reference = slaves[wanted.dc_reference - 1U];
        const TimeSource source = time_source_of(slaves, reference, by_position);
        add({reference.al.state == AlState::none ? Command::NOP : source.command,
             {source.address, wire::reg::kSystemTime.address},
             reference.dl.dc_64bit ? wire::reg::kSystemTime.length : std::uint16_t{4},
             &Group::dc_time});
    }
    return plans;
}

std::uint16_t working_counter_of(const SlaveFmmus& fmmus, const DatagramPlan& datagram) {
    const std::uint64_t begin = datagram.address.value;
    const std::uint64_t end = begin + datagram.bytes;
    bool reads = false;
    bool writes = false;
    for (const wire::Fmmu& fmmu : fmmus.at) {
        const std::uint64_t first = fmmu.logical_start.value;
        if (!fmmu.active || first >= end || first + fmmu.length_bytes <= begin) continue;
        reads |= fmmu.read && datagram.command != Command::LWR;
        writes |= fmmu.write && datagram.command != Command::LRD;
    }
    const unsigned for_write = datagram.command == Command::LRW ? 2 : 1;
    return static_cast<std::uint16_t>((reads ? 1U : 0U) + (writes ? for_write : 0U));
}

Result<std::size_t> plan_datagrams(std::span<const Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted,
                                   const ImageLayout& layout, std::span<DatagramPlan> into) {
    if (const auto checked = check_reference(slaves, wanted.dc_reference); !checked) return checked.error();
    std::uint32_t reserved = wanted.reserve_bytes;
    const ReadingPlans readings = plan_readings(slaves, wanted);
    for (const ReadingPlan& reading : readings.all()) reserved += kOverhead + reading.bytes;
    if (reserved > kFrameRoom - kOverhead - 1)
        return Error{.code = Errc::invalid_argument,
                     .step = Step::map_process_data,
                     .detail = static_cast<std::uint32_t>(Argument::reserve_bytes)};
    const bool block_lrw =
        wanted.block_lrw || std::ranges::any_of(slaves, [group](const Slave& slave) {
            const bool cannot = slave.config.block_lrw || (slave.dl.features & wire::features::kLrwNotSupported) != 0;
            return slave.image.group == group && cannot &&
                   (slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0);
        });
    const Ranges ranges = choose_ranges(layout, block_lrw);
    const std::size_t count = Planner(slaves, group, layout, ranges, reserved, into).run();
    if (count > into.size())
        return Error{.code = Errc::too_many_frames,
                     .step = Step::map_process_data,
                     .expected = static_cast<std::uint32_t>(count),
                     .actual = static_cast<std::uint32_t>(into.size())};
    for (const Slave& slave : slaves) {
        if (slave.image.group != group) continue;
        // A slave that is being started up is compared with the mapping when it joins.
        const bool joins_later = !slave.takes_part && !is_as_mapped(slave);
        const Result<SlaveFmmus> fmmus = joins_later ? exchanged_ranges(slave, layout) : make_fmmus(slave, layout);
        if (!fmmus) return fmmus.error();
        for (DatagramPlan& datagram : into.first(count))
            datagram.expected_wkc =
                static_cast<std::uint16_t>(datagram.expected_wkc + working_counter_of(*fmmus, datagram));
    }
    return count;
}

}  // namespace margay
