#include "link/frame_table.hpp"

namespace margay {

FrameSlot* FrameTable::open(Time now) {
    if (in_flight_ == slots_.size()) return nullptr;
    if (now >= rest_until_) resting_.fill(0);
    // Indices are used in turn: one comes again after 255 others. When so many frames were lost that all rest, the one that has
    // rested longest is next in turn anyway.
    std::uint8_t index = next_index_;
    for (int tries = 0; tries < 256 && (slot_of_[index] != kNoSlot || resting(index)); ++tries) ++index;
    while (slot_of_[index] != kNoSlot) ++index;
    next_index_ = static_cast<std::uint8_t>(index + 1);

    while (slots_[next_slot_].in_flight) next_slot_ = (next_slot_ + 1) % slots_.size();
    FrameSlot& slot = slots_[next_slot_];
    slot_of_[index] = static_cast<std::uint8_t>(next_slot_);
    slot.index = index;
    slot.in_flight = true;
    slot.refused = false;
    slot.length = 0;
    slot.prepared = nullptr;
    slot.deadline = kNever;
    ++in_flight_;
    return &slot;
}

FrameSlot* FrameTable::find(std::uint8_t index) {
    return slot_of_[index] == kNoSlot ? nullptr : &slots_[slot_of_[index]];
}

void FrameTable::close(FrameSlot& slot, bool lost, Time now) {
    slot_of_[slot.index] = kNoSlot;
    slot.in_flight = false;
    --in_flight_;
    if (lost) {
        resting_[slot.index / 32] |= 1U << (slot.index % 32);
        rest_until_ = now + kRest;
    }
}

FrameSlot* FrameTable::expired(Time now) {
    if (in_flight_ == 0) return nullptr;
    for (FrameSlot& slot : slots_)
        if (slot.in_flight && slot.deadline <= now) return &slot;
    return nullptr;
}

Time FrameTable::next_deadline() const {
    Time next = kNever;
    if (in_flight_ == 0) return next;
    for (const FrameSlot& slot : slots_)
        if (slot.in_flight && slot.deadline < next) next = slot.deadline;
    return next;
}

}  // namespace margay
