// Overlapped cycles: a cycle is sent before the previous one is received. One thread may send the cycles while another
// thread, the owner, receives and does everything else.
//
// The threads share frames by this rule: a frame belongs to the sending thread until the group's count of sent cycles
// says that its cycle is in flight, and again after the count of received cycles says that its cycle has ended. Between
// these two points the owner may find the frame by its index (from the moment it is published in the frame table) and
// copies the reply into it. Everything else in the link belongs to the owner, also the statistics. Both threads use the
// NIC.
#include "link/cycle.hpp"

#include <algorithm>
#include <array>

namespace margay {
namespace {

std::byte as_byte(wire::Command command) { return static_cast<std::byte>(command); }

// Writes the time that the reference clock will probably have: the time of the last reply, which is still in the frame,
// plus `since_last`. The slaves before the reference take this time, and so do all slaves when the reference is lost. A
// frame that only reads carries no time, see take_overlapped_time() in link/cycle.cpp.
void continue_time(MutableBytes head, std::uint16_t bytes, Duration since_last) {
    // Added to the expected time, so that the reference shows the sent time only by chance, see Link::keep().
    constexpr std::uint64_t kBeside_ns = 64;
    const MutableBytes data = head.subspan(wire::kDatagramHeaderBytes, bytes);
    std::array<std::byte, 8> value{};
    std::ranges::copy(data, value.begin());
    std::uint64_t time = head[0] < as_byte(wire::Command::ARMW) ? 0 : load_le<std::uint64_t>(value);
    if (time != 0) time += static_cast<std::uint64_t>(since_last.count()) + kBeside_ns;
    store_le<std::uint64_t>(value, 0, time);
    std::ranges::copy(Bytes(value).first(bytes), data.begin());
}

// Like fill(), for a frame that may contain an old reply. The owner has written the reply and the command of the time
// before it counted the cycle as received. Since then the frame belongs to the sending thread.
void fill_overlapped(PreparedFrame& frame, std::uint8_t index, Duration since_last) {
    const auto clear = [&frame](std::size_t at, std::size_t bytes) {
        std::ranges::fill(MutableBytes(frame.bytes).subspan(at, bytes), std::byte{0});
    };
    for (const PreparedDatagram& d : frame.datagrams) {
        const std::size_t data = d.offset + wire::kDatagramHeaderBytes;
        frame.bytes[d.offset + 1U] = std::byte{index};
        cycle::copy(&frame.bytes[data], d.output);
        clear(data + d.bytes, wire::kWorkingCounterBytes);
    }
    for (const PreparedReading& r : frame.readings) {
        frame.bytes[r.offset + 1U] = std::byte{index};
        const std::size_t data = r.offset + wire::kDatagramHeaderBytes;
        if (frame.bytes[r.offset] == as_byte(wire::Command::BRD))
            clear(data, r.bytes);
        else
            continue_time(MutableBytes(frame.bytes).subspan(r.offset), r.bytes, since_last);
        clear(data + r.bytes, wire::kWorkingCounterBytes);
    }
    frame.no_time = false;
}

}  // namespace

SendStatus Link::send_overlapped(std::span<PreparedFrame> frames, Duration since_last) {
    SendStatus all = SendStatus::sent;
    for (PreparedFrame& frame : frames) {
        const auto index = frames_.free_index();
        SendStatus status = SendStatus::busy;
        if (index) {
            fill_overlapped(frame, *index, since_last);
            frames_.publish(frame.own, *index);
            status = nic_.send(Bytes(frame.bytes).first(frame.size));
            if (status != SendStatus::sent) frames_.release(frame.own);
        }
        frame.refused = status != SendStatus::sent;
        if (frame.refused) all = status;
    }
    return all;
}

// Parks the reply to a frame of an overlapped cycle, or to a held frame: copies the reply into the frame, and the end
// of the cycle commits it. The headers stay as they were sent.
void Link::keep(PreparedFrame& sent, Bytes reply) {
    const auto copy = [&](std::size_t offset, std::size_t bytes) {
        const std::size_t data = offset + wire::kDatagramHeaderBytes;
        std::ranges::copy(reply.subspan(data, bytes + wire::kWorkingCounterBytes), &sent.bytes[data]);
    };
    for (const PreparedDatagram& d : sent.datagrams) copy(d.offset, d.bytes);
    for (const PreparedReading& r : sent.readings) {
        const std::size_t data = r.offset + wire::kDatagramHeaderBytes;
        const bool is_time = sent.bytes[r.offset] != as_byte(wire::Command::BRD);
        sent.no_time |=
            is_time && std::ranges::equal(Bytes(sent.bytes).subspan(data, r.bytes), reply.subspan(data, r.bytes));
        copy(r.offset, r.bytes);
    }
    sent.parked = true;
    sent.settle_form();
}

bool Link::receive_overlapped(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready) {
    frames_.refresh(now);
    for (const PreparedFrame& frame : frames)
        while (!frame.parked && !frame.refused)
            if (!receive_one(now, ready)) return false;
    return true;
}

void Link::end_overlapped(std::span<PreparedFrame> frames, Time sent_at, Time now) {
    note_cycle(last_cycle_, sent_at);
    last_cycle_ = sent_at;
    for (PreparedFrame& frame : frames) {
        if (cables_ != nullptr && !frame.parked && !frame.refused) keep_half(frame, now);
        if (frame.refused)
            ++statistics_.send_refused;
        else
            note_prepared(frame);
        if (frame.parked && !frame.refused) {
            commit_frame(frame, frame.bytes);
        } else {
            if (!frame.refused) ++statistics_.lost;
            note_silence();
            forget_overlapped(frame, now);
            mark_not_received(frame);
        }
        frame.parked = false;
    }
}

// The same as take_half(), for a frame of an overlapped cycle.
void Link::keep_half(PreparedFrame& frame, Time now) {
    const std::size_t length = cables_->half(frame, frame.own.index, buffer_);
    if (length == 0) return;
    keep(frame, Bytes(buffer_).first(length));
    ++statistics_.frames_received;
    forget_overlapped(frame, now);
}

void Link::forget_overlapped(PreparedFrame& frame, Time now) {
    if (frames_.find(frame.own.index) == &frame.own) close_lost(frame.own, now);
}

}  // namespace margay
