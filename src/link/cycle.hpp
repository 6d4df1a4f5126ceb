// The link's part in the cycle that every cycle goes through, to be compiled into whoever sends and receives: nothing here is called but the NIC. What
// happens now and then (riders, losses, slaves that do not take part) is in cycle.cpp.
#pragma once

#include "link/link.hpp"

#include <algorithm>
#include <cstring>

namespace margay {

namespace cycle {

// Command, index, address, length and flags of a datagram; the flag that says "has circulated" is the segment's.
inline constexpr std::uint64_t kComparedBits = ~(std::uint64_t{0x4000} << 48);

inline std::uint64_t load(const std::byte* at) { return load_le<std::uint64_t>(Bytes(at, 8)); }

[[nodiscard]] inline bool same_head(const std::byte* a, const std::byte* b) { return ((load(a) ^ load(b)) & kComparedBits) == 0; }

// The reply has the EtherType, the length and the datagrams that were sent. The first comparison has both of these and the first half of the first
// datagram's header, the second all of that.
[[nodiscard]] inline bool same(const PreparedFrame& sent, const std::byte* reply) {
    constexpr std::size_t kTypeOffset = wire::kEthernetHeaderBytes - 2;
    const std::byte* own = sent.bytes.data();
    if (load(reply + kTypeOffset) != load(own + kTypeOffset) || !same_head(reply + wire::kFramePrefixBytes, own + wire::kFramePrefixBytes))
        return false;
    if (sent.datagram_count > 1) [[unlikely]] {
        for (const PreparedDatagram& d : sent.datagrams.subspan(1))
            if (!same_head(reply + d.offset, own + d.offset)) return false;
    }
    return true;
}

// memcpy() wants addresses even where there is nothing to copy.
inline void copy(MutableBytes to, const std::byte* from) {
    if (!to.empty()) [[likely]] std::memcpy(to.data(), from, to.size());
}

}  // namespace cycle

[[gnu::always_inline]] inline void Link::begin_cycle(Time now, std::size_t rider_budget_bytes) {
    constexpr Duration kLongestWait = std::chrono::milliseconds(10);
    rider_budget_ = rider_budget_bytes;
    riders_ = false;
    // As long as the next cycle comes about as soon as this one did, the queue waits for it.
    const bool cycles = last_cycle_ != Time::min() && now - last_cycle_ < kLongestWait;
    cycles_until_ = cycles && rider_budget_bytes > 0 ? now + std::min(2 * (now - last_cycle_), kLongestWait) : Time::min();
    last_cycle_ = now;
}

// The index and the outputs go into the frame.
[[gnu::always_inline]] inline void Link::fill(PreparedFrame& frame, std::uint8_t index) {
    frame.right = false;
    PreparedDatagram* next = frame.datagrams.data();
    for (unsigned left = frame.datagram_count; left != 0; --left, ++next) {
        PreparedDatagram& d = *next;
        std::byte* at = &frame.bytes[d.offset];
        d.status->came = false;
        at[1] = std::byte{index};
        if (frame.degraded) [[unlikely]] cycle::copy(MutableBytes(at + wire::kDatagramHeaderBytes + d.input_at, d.input.size()), d.input.data());
        cycle::copy(MutableBytes(at + wire::kDatagramHeaderBytes, d.output.size()), d.output.data());
    }
}

[[gnu::always_inline]] inline SendStatus Link::send_prepared(PreparedFrame& frame, Time now) {
    if (frame.slot != nullptr || frame.has_riders || !queue_.empty()) [[unlikely]] return send_with_riders(frame, now);
    if (!frames_.claim(frame.own, now)) [[unlikely]] return no_index(frame);
    fill(frame, frame.own.index);
    frame.slot = &frame.own;
    const SendStatus status = nic_.send(Bytes(frame.bytes.data(), frame.size));
    if (status != SendStatus::sent) [[unlikely]] {
        not_sent(frame, now);
        return status;
    }
    ++statistics_.frames_sent;
    statistics_.datagrams_sent += frame.datagram_count;
    statistics_.bytes_on_wire += frame.wire_bytes;
    return status;
}

[[gnu::always_inline]] inline SendStatus Link::send_cycle(std::span<PreparedFrame> frames, Time now, std::size_t rider_budget_bytes) {
    begin_cycle(now, rider_budget_bytes);
    SendStatus all = SendStatus::sent;
    for (PreparedFrame& frame : frames) {
        const SendStatus status = send_prepared(frame, now);
        if (status != SendStatus::sent) all = status;
    }
    if (!queue_.empty()) [[unlikely]] send_riders(now);
    return all;
}

// The reply to a prepared frame is recognised by comparing it with what was sent, which is still there.
[[gnu::always_inline]] inline bool Link::take_prepared(Bytes frame, Time now, List<Waiter>& ready) {
    constexpr std::size_t kIndexOffset = wire::kFramePrefixBytes + 1;
    if (frame.size() < wire::kFramePrefixBytes + wire::kDatagramOverheadBytes) [[unlikely]] return false;
    FrameSlot* slot = frames_.find(std::to_integer<std::uint8_t>(frame[kIndexOffset]));
    if (slot == nullptr || slot->prepared == nullptr) [[unlikely]] return false;
    PreparedFrame& sent = *slot->prepared;
    const bool whole = frame.size() >= wire::kFramePrefixBytes + slot->length;
    const bool passed = (frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    if (!whole || !passed || !cycle::same(sent, frame.data())) [[unlikely]] return false;
    if (sent.has_riders && !matches(*slot, frame)) [[unlikely]] return false;
    bool right = !sent.degraded;
    PreparedDatagram* next = sent.datagrams.data();
    for (unsigned left = sent.datagram_count; left != 0; --left, ++next) {
        PreparedDatagram& d = *next;
        const std::byte* data = &frame[d.offset + wire::kDatagramHeaderBytes];
        DatagramStatus& status = *d.status;
        status.got = load_le<std::uint16_t>(Bytes(data + d.bytes, 2));
        status.came = true;
        if (status.got == status.full) [[likely]] {
            cycle::copy(d.input, data + d.input_at);
        } else {
            right = false;
            if (status.got == status.accepted) take_degraded(sent, d, data + d.input_at);
        }
    }
    sent.right = right;
    sent.slot = nullptr;
    ++statistics_.frames_received;
    if (!slot->datagrams.empty()) [[unlikely]] deliver_riders(*slot, frame, ready);
    frames_.close(*slot, false, now);
    return true;
}

[[gnu::always_inline]] inline bool Link::receive_one(Time now, List<Waiter>& ready) {
    const std::size_t length = nic_.receive(buffer_);
    if (length == 0) return false;
    const Bytes frame(buffer_.data(), length);
    if (!take_prepared(frame, now, ready)) [[unlikely]] take(frame, now, ready);
    return true;
}

[[gnu::always_inline]] inline bool Link::receive_cycle(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready) {
    for (PreparedFrame& frame : frames) {
        while (frame.slot != nullptr)
            if (!receive_one(now, ready)) return false;
    }
    return true;
}

}  // namespace margay
