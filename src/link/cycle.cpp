// The link's part in the cycle: what rides in its frames, and what does not come back.
#include "link/cycle.hpp"

#include <algorithm>

namespace margay {
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
    if (slot != &frame.own) slot->prepared = nullptr;
    if (!slot->datagrams.empty()) return;  // riders wait on, to their own deadline
    ++statistics_.lost;
    frames_.close(*slot, true, now);
}

// Inputs of a datagram in which some slave does not take part.
void Link::take_degraded(const PreparedFrame& frame, const PreparedDatagram& datagram, const std::byte* inputs) {
    const auto n = static_cast<std::size_t>(&datagram - frame.datagrams.data());
    if (frame.take_inputs != nullptr)
        frame.take_inputs(frame.group, frame, n, Bytes(inputs, datagram.input.size()));
    else
        cycle::copy(datagram.input, inputs);
}

// Too many frames are in flight already.
SendStatus Link::no_index(PreparedFrame& frame) {
    frame.right = false;
    for (PreparedDatagram& d : frame.datagrams) d.status->came = false;
    return SendStatus::busy;
}

SendStatus Link::send_with_riders(PreparedFrame& frame, Time now) {
    if (frame.slot != nullptr) give_up_prepared(frame, now);
    FrameSlot* slot = frames_.open(now);
    if (slot == nullptr) return no_index(frame);
    fill(frame, slot->index);
    const Bytes whole = add_riders(frame, *slot);
    slot->length = static_cast<std::uint16_t>(whole.size() - wire::kFramePrefixBytes);
    slot->deadline = now + settings.frame_timeout;
    slot->prepared = &frame;
    frame.slot = slot;
    const SendStatus status = nic_.send(whole);
    if (status != SendStatus::sent) {
        not_sent(frame, now);
        return status;
    }
    ++statistics_.frames_sent;
    statistics_.datagrams_sent += frame.datagram_count;
    statistics_.bytes_on_wire += wire::bytes_on_the_wire(whole.size());
    note_sent(*slot);
    if (frame.has_riders) note_riders(whole.size() - frame.size);
    return status;
}

// The frame is not in flight, and what would have ridden in it waits for another one.
void Link::not_sent(PreparedFrame& frame, Time now) {
    ++statistics_.send_refused;
    unpack(*frame.slot);
    frames_.close(*frame.slot, false, now);
    frame.slot = nullptr;
}

}  // namespace margay
