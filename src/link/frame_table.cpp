#include "link/frame_table.hpp"

namespace margay {

FrameSlot* FrameTable::open(Time now) {
    if (in_flight_ == slots_.size()) return nullptr;
    while (slots_[next_slot_].in_flight) next_slot_ = next_slot_ + 1 == slots_.size() ? 0 : next_slot_ + 1;
    FrameSlot& slot = slots_[next_slot_];
    if (!claim(slot, now)) return nullptr;
    next_slot_ = next_slot_ + 1 == slots_.size() ? 0 : next_slot_ + 1;
    slot.in_flight = true;
    slot.refused = false;
    slot.length = 0;
    slot.prepared = nullptr;
    slot.deadline = kNever;
    ++in_flight_;
    return &slot;
}

// Indices are used in turn: one comes again after 255 others. When so many frames were lost that all rest, the one that has rested longest is next in turn
// anyway.
bool FrameTable::claim_free(FrameSlot& slot, Time now) {
    std::uint8_t index = next_index_;
    if (any_resting_ && now >= rest_until_) {
        resting_.fill(0);
        any_resting_ = false;
    }
    for (int tries = 0; tries < 256 && (slot_of_[index] != nullptr || resting(index)); ++tries) ++index;
    for (int tries = 0; tries < 256 && slot_of_[index] != nullptr; ++tries) ++index;
    if (slot_of_[index] != nullptr) return false;
    take(slot, index);
    return true;
}

void FrameTable::rest(std::uint8_t index, Time now) {
    resting_[index / 32] |= 1U << (index % 32);
    rest_until_ = now + kRest;
    any_resting_ = true;
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
