// The fast path of a cycle: frames of one datagram in which every slave takes part, without queued datagrams behind it,
// whose reply has the form that was sent. The functions are inline in the code that sends and receives cycles, and call
// only the NIC. cycle.cpp handles all other cases.
#pragma once

#include "link/link.hpp"

#include <cstring>

namespace margay {

namespace cycle {

// Mask over the first 8 octets of a datagram header: command, index, address, length and flags. The flag "has
// circulated" is left out of the comparison, because the segment sets it.
inline constexpr std::uint64_t kComparedBits = ~(std::uint64_t{0x4000} << 48);

inline std::uint64_t load(const std::byte* at) { return load_le<std::uint64_t>(Bytes(at, 8)); }

[[nodiscard]] inline bool same_head(const std::byte* a, const std::byte* b) {
    return ((load(a) ^ load(b)) & kComparedBits) == 0;
}

// Whether a datagram of the reply is the one that was sent. The position is not compared where slaves increment it.
[[nodiscard]] inline bool same_datagram(const std::byte* sent, const std::byte* reply) {
    constexpr std::uint64_t kPositionBits = std::uint64_t{0xFFFF} << 16;
    const std::uint64_t differs = (load(sent) ^ load(reply)) & kComparedBits;
    return (wire::counts_position(static_cast<wire::Command>(sent[0])) ? differs & ~kPositionBits : differs) == 0;
}

// Whether `reply` is the reply to the plain frame `sent`: an ESC has marked the source address (is_reply() handles
// replies without the mark), the reply is not shorter than the frame sent, and EtherType, frame length and datagram
// header are the same. The first comparison covers EtherType, frame length and the first half of the datagram header,
// the second one the whole header.
[[nodiscard, gnu::always_inline]] inline bool same(const PreparedFrame& sent, Bytes reply) {
    constexpr std::size_t kTypeOffset = wire::kEthernetHeaderBytes - 2;
    const std::byte* own = sent.bytes.data();
    const std::byte* at = reply.data();
    return reply.size() >= sent.size && (at[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0} &&
           load(at + kTypeOffset) == load(own + kTypeOffset) &&
           same_head(at + wire::kFramePrefixBytes, own + wire::kFramePrefixBytes);
}

// memcpy() requires valid pointers even for a length of zero.
inline void copy(std::byte* to, Bytes from) {
    if (!from.empty()) [[likely]]
        std::memcpy(to, from.data(), from.size());
}

}  // namespace cycle

// Writes the index and the outputs into a plain frame.
[[gnu::always_inline]] inline void Link::fill_plain(PreparedFrame& frame, std::uint8_t index) {
    const PreparedDatagram& d = frame.datagrams[0];
    std::byte* at = frame.bytes.data() + wire::kFramePrefixBytes;
    at[1] = std::byte{index};
    cycle::copy(at + wire::kDatagramHeaderBytes, d.output);
}

[[gnu::always_inline]] inline void Link::note_prepared(const PreparedFrame& frame) {
    ++statistics_.frames_sent;
    statistics_.datagrams_sent += frame.datagram_count;
    statistics_.bytes_on_wire += frame.wire_bytes;
}

[[gnu::always_inline]] inline SendStatus Link::send_prepared(PreparedFrame& frame, Time now) {
    if (frame.slot != nullptr) [[unlikely]]
        give_up_prepared(frame, now);
    frame.end = CycleEnd::missing;
    if (!frames_.claim(frame.own, now)) [[unlikely]]
        return SendStatus::busy;
    if (frame.plain) [[likely]]
        fill_plain(frame, frame.own.index);
    else
        fill(frame, frame.own.index);
    frame.slot = &frame.own;
    const SendStatus status = nic_.send(Bytes(frame.bytes.data(), frame.size));
    if (status != SendStatus::sent) [[unlikely]] {
        not_sent(frame, now);
        return status;
    }
    note_prepared(frame);
    return status;
}

[[gnu::always_inline]] inline SendStatus Link::send_cycle(std::span<PreparedFrame> frames, CyclePace& pace, Time now,
                                                          std::size_t rider_budget_bytes) {
    note_cycle(last_cycle_, now);
    last_cycle_ = now;
    pace.before = pace.last;
    pace.last = now;
    pace.budget_bytes = rider_budget_bytes;
    if (!queue_.empty()) [[unlikely]]
        return send_with_queue(frames, now, rider_budget_bytes);
    for (PreparedFrame& frame : frames) {
        const SendStatus status = send_prepared(frame, now);
        if (status != SendStatus::sent) [[unlikely]]
            return send_rest({&frame + 1, frames.data() + frames.size()}, status, now);
    }
    return SendStatus::sent;
}

// Commits the reply to one datagram, whose data is at `data`: the working counter, and the inputs when every slave took
// part. For a reply of the cycle, and for a reply of an overlapped cycle at its end. False: some slave did not take
// part, so commit_short() decides whether the inputs reach the image.
[[gnu::always_inline]] inline bool Link::commit(const PreparedDatagram& d, const std::byte* data) {
    DatagramStatus& status = *d.status;
    status.got = load_le<std::uint16_t>(Bytes(data + d.bytes, 2));
    status.came = true;
    status.fresh = status.got == status.full;
    if (!status.fresh) [[unlikely]]
        return false;
    cycle::copy(d.input.data(), Bytes(data + d.input_at, d.input.size()));
    return true;
}

// Commits the reply to a plain frame in `buffer_`. The caller has checked it with cycle::same().
[[gnu::always_inline]] inline void Link::commit_plain(PreparedFrame& frame) {
    frame.slot = nullptr;
    frames_.release(frame.own);
    ++statistics_.frames_received;
    frame.end = CycleEnd::right;
    if (!commit(frame.datagrams[0], &buffer_[wire::kFramePrefixBytes + wire::kDatagramHeaderBytes])) [[unlikely]]
        frame.end = CycleEnd::unjudged;
}

[[gnu::always_inline]] inline CycleEnd Link::receive_cycle(std::span<PreparedFrame> frames, Time now,
                                                           List<Waiter>& ready) {
    for (PreparedFrame& frame : frames) {
        while (frame.slot != nullptr) {
            const std::size_t length = nic_.receive(buffer_);
            if (length == 0) [[unlikely]]
                return CycleEnd::missing;
            const Bytes reply(buffer_.data(), length);
            if (frame.slot == &frame.own && frame.plain && cycle::same(frame, reply)) [[likely]]
                commit_plain(frame);
            else
                accept_in_cycle(frame, length, now, ready);
        }
        if (frame.end != CycleEnd::right) [[unlikely]]
            return receive_rest({&frame, frames.data() + frames.size()}, now, ready);
    }
    return CycleEnd::right;
}

}  // namespace margay
