#include "link/frame_table.hpp"

#include <bit>

namespace margay {

FrameSlot* FrameTable::open(Time now) {
    if (in_flight_ == slots_.size()) return nullptr;
    while (slots_[next_slot_].in_flight) next_slot_ = next_slot_ + 1 == slots_.size() ? 0 : next_slot_ + 1;
    FrameSlot& slot = slots_[next_slot_];
    if (!claim(slot, now)) return nullptr;
    next_slot_ = next_slot_ + 1 == slots_.size() ? 0 : next_slot_ + 1;
    slot.in_flight = true;
    slot.refused = false;
    slot.unmarked = false;
    slot.length = 0;
    slot.prepared = nullptr;
    slot.deadline = kNever;
    ++in_flight_;
    return &slot;
}

bool FrameTable::too_many_rest(unsigned first, unsigned count) const {
    int rest = 0;
    for (unsigned word = first / 32; word < (first + count) / 32; ++word)
        rest += std::popcount(resting_[word].load(std::memory_order_relaxed));
    return static_cast<unsigned>(rest) > count / 2;
}

// Indices are used in turn, and resting indices are skipped. If most indices rest, resting indices are used too. So at
// least half of the indices are used before an index is used again.
bool FrameTable::claim_free(FrameSlot& slot, Time now) {
    refresh(now);
    for (const bool any : {too_many_rest(0, mask_ + 1U), true}) {
        std::uint8_t index = next_index_;
        for (int tries = 0; tries <= mask_; ++tries) {
            if (at(index) == nullptr && (any || !resting(index))) {
                take(slot, index);
                return true;
            }
            index = static_cast<std::uint8_t>((index + 1) & mask_);
        }
    }
    return false;
}

std::optional<std::uint8_t> FrameTable::free_index() {
    for (const bool any : {too_many_rest(kSplit, 256 - kSplit), true})
        for (int tries = 0; tries < 256 - kSplit; ++tries) {
            const std::uint8_t index = next_overlapped_;
            next_overlapped_ = static_cast<std::uint8_t>((index + 1) | kSplit);
            // A null pointer: the owner has closed the slot, and does not read its frame any more.
            if (slot_of_[index].load(std::memory_order_acquire) == nullptr && (any || !resting(index))) return index;
        }
    return std::nullopt;
}

void FrameTable::rest(std::uint8_t index, Time now) {
    resting_[index / 32].fetch_or(1U << (index % 32), std::memory_order_relaxed);
    rest_until_ = now + kRest;
    any_resting_.store(true, std::memory_order_relaxed);
}

void FrameTable::end_rest() {
    for (auto& some : resting_) some.store(0, std::memory_order_relaxed);
    any_resting_.store(false, std::memory_order_relaxed);
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
