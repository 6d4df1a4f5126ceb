// The link's part in the cycle: prepared frames, and what rides in them.
#include "link/link.hpp"

#include <algorithm>

namespace margay {
namespace {

// Command, index, address, length and flags of a datagram; the flag that says "has circulated" is the segment's.
constexpr std::size_t kComparedBytes = 8;
constexpr std::uint64_t kComparedBits = ~(std::uint64_t{0x4000} << 48);

std::uint64_t head_of(Bytes frame, std::size_t offset) {
    return load_le<std::uint64_t>(frame.subspan(offset, kComparedBytes)) & kComparedBits;
}

}  // namespace

void Link::begin_cycle(Time now, std::size_t rider_budget_bytes) {
    constexpr Duration kLongestWait = std::chrono::milliseconds(10);
    rider_budget_ = rider_budget_bytes;
    riders_ = false;
    // As long as the next cycle comes about as soon as this one did, the queue waits for it.
    const bool cycles = last_cycle_ != Time::min() && now - last_cycle_ < kLongestWait;
    cycles_until_ = cycles && rider_budget_bytes > 0 ? now + std::min(2 * (now - last_cycle_), kLongestWait) : Time::min();
    last_cycle_ = now;
}

SendStatus Link::send_prepared(PreparedFrame& frame, Time now) {
    if (frame.slot != nullptr) give_up_prepared(frame, now);
    for (PreparedDatagram& d : frame.datagrams) d.status->came = false;
    FrameSlot* slot = frames_.open(now);
    if (slot == nullptr) return SendStatus::busy;
    for (PreparedDatagram& d : frame.datagrams) {
        frame.bytes[d.offset + 1U] = std::byte{slot->index};
        if (frame.degraded) std::copy(d.input.begin(), d.input.end(), frame.bytes.begin() + d.offset + wire::kDatagramHeaderBytes + d.input_at);
        std::copy(d.output.begin(), d.output.end(), frame.bytes.begin() + d.offset + wire::kDatagramHeaderBytes);
    }
    const Bytes whole = frame.has_riders || !queue_.empty() ? add_riders(frame, *slot) : Bytes(frame.bytes).first(frame.size);
    slot->length = static_cast<std::uint16_t>(whole.size() - wire::kFramePrefixBytes);
    slot->deadline = now + settings.frame_timeout;
    const SendStatus status = nic_.send(whole);
    if (status != SendStatus::sent) {
        ++statistics_.send_refused;
        unpack(*slot);
        frames_.close(*slot, false, now);
        return status;
    }
    slot->prepared = &frame;
    frame.slot = slot;
    if (frame.has_riders) {
        note_sent(*slot);
        note_riders(whole.size() - frame.size);
    }
    ++statistics_.frames_sent;
    statistics_.datagrams_sent += frame.datagrams.size();
    statistics_.bytes_on_wire += wire::bytes_on_the_wire(whole.size());
    return status;
}

// Octets that may still ride: what the budget has left, but one datagram in any case.
std::size_t Link::rider_room() {
    const std::size_t first = queue_.empty() ? 0 : queue_.front()->sent_data_.size() + wire::kDatagramOverheadBytes;
    return riders_ || rider_budget_ == 0 ? rider_budget_ : std::max(rider_budget_, first);
}

Bytes Link::add_riders(PreparedFrame& frame, FrameSlot& slot) {
    const std::size_t last = frame.datagrams.back().offset;
    frame.bytes[last + 7] &= std::byte{0x7F};  // "more", from riders of the last time
    const std::size_t end = std::min(frame.bytes.size(), frame.size + rider_room());
    wire::FrameBuilder builder(MutableBytes(frame.bytes).first(end), frame.size, last);
    pack(slot, builder);
    frame.has_riders = !slot.datagrams.empty();
    return builder.finish();
}

void Link::note_riders(std::size_t bytes) {
    riders_ = true;
    rider_budget_ -= std::min(rider_budget_, bytes);
}

void Link::send_riders(Time now) {
    while (!queue_.empty() && rider_room() > 0) {
        const std::size_t room = std::min(wire::kMaxFrameBytes, wire::kFramePrefixBytes + rider_room());
        if (wire::kFramePrefixBytes + wire::kDatagramOverheadBytes + queue_.front()->sent_data_.size() > room) return;
        FrameSlot* slot = frames_.open(now);
        if (slot == nullptr) return;
        if (!send_one(*slot, now, room)) {
            frames_.close(*slot, false, now);
            return;
        }
        note_riders(slot->length);
    }
}

void Link::give_up_prepared(PreparedFrame& frame, Time now) {
    FrameSlot* slot = frame.slot;
    if (slot == nullptr) return;
    frame.slot = nullptr;
    slot->prepared = nullptr;
    if (!slot->datagrams.empty()) return;  // riders wait on, to their own deadline
    ++statistics_.lost;
    frames_.close(*slot, true, now);
}

// The reply to a prepared frame is recognised by comparing it with what was sent, which is still there.
bool Link::take_prepared(Bytes frame, Time now, List<Waiter>& ready) {
    constexpr std::size_t kIndexOffset = wire::kFramePrefixBytes + 1;
    if (frame.size() < wire::kFramePrefixBytes + wire::kDatagramOverheadBytes) return false;
    FrameSlot* slot = frames_.find(std::to_integer<std::uint8_t>(frame[kIndexOffset]));
    if (slot == nullptr || slot->prepared == nullptr) return false;
    PreparedFrame& sent = *slot->prepared;
    constexpr std::size_t kTypeOffset = wire::kEthernetHeaderBytes - 2;  // EtherType and frame header
    const bool whole = frame.size() >= wire::kFramePrefixBytes + slot->length;
    const bool passed = (frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    if (!whole || !passed || load_le<std::uint32_t>(frame, kTypeOffset) != load_le<std::uint32_t>(sent.bytes, kTypeOffset)) return false;
    for (const PreparedDatagram& d : sent.datagrams)
        if (head_of(frame, d.offset) != head_of(sent.bytes, d.offset)) return false;
    if (sent.has_riders && !matches(*slot, frame)) return false;
    for (PreparedDatagram& d : sent.datagrams) {
        const std::size_t data_at = d.offset + wire::kDatagramHeaderBytes;
        d.status->got = load_le<std::uint16_t>(frame, data_at + d.bytes);
        d.status->came = true;
        if (!d.status->usable()) continue;
        const auto input = frame.subspan(data_at + d.input_at, d.input.size());
        if (sent.degraded && sent.take_inputs != nullptr && d.status->got != d.status->full)
            sent.take_inputs(sent.group, sent, static_cast<std::size_t>(&d - sent.datagrams.data()), input);
        else
            std::copy(input.begin(), input.end(), d.input.begin());
    }
    sent.slot = nullptr;
    deliver(*slot, frame, now, ready);
    return true;
}

}  // namespace margay
