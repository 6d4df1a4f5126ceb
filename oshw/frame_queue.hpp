// Frames on their way, each with the time it will be there: what NICs in virtual time and delaying filters
// hold. The memory is the caller's; nothing is allocated.
#pragma once

#include <margay/time.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

struct HeldFrame {
    static constexpr std::size_t kMaxBytes = 1518;  // what the NIC contract allows
    Time due = kNever;                              // kNever: the slot is free
    std::uint64_t order = 0;
    std::size_t length = 0;
    std::array<std::byte, kMaxBytes> bytes;
};

// Delivers by time, and frames of one time in the order they were put in. Putting and taking look at every
// slot: meant for some dozens of them.
class FrameQueue {
  public:
    // `memory` must outlive the queue.
    explicit FrameQueue(std::span<HeldFrame> memory) noexcept : slots_(memory) { clear(); }

    [[nodiscard]] bool full() const noexcept { return count_ == slots_.size(); }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

    void clear() noexcept {
        for (auto& slot : slots_) slot.due = kNever;
        count_ = 0;
    }

    // Takes a copy of the frame, cut to HeldFrame::kMaxBytes. False, and nothing taken, when full or when
    // `due` is kNever.
    [[nodiscard]] bool put(Time due, std::span<const std::byte> frame) noexcept {
        if (due == kNever) return false;
        for (auto& slot : slots_) {
            if (slot.due != kNever) continue;
            slot.due = due;
            slot.order = next_order_++;
            slot.length = std::min(frame.size(), slot.bytes.size());
            std::copy_n(frame.begin(), slot.length, slot.bytes.begin());
            ++count_;
            return true;
        }
        return false;
    }

    // When the next frame will be there, kNever when none is held.
    [[nodiscard]] Time next_due() const noexcept {
        const auto* slot = first();
        return slot == nullptr ? kNever : slot->due;
    }

    // Moves the next frame that is due by `now` into `into`, cut to it, and returns its length; 0 when there
    // is none.
    [[nodiscard]] std::size_t take(Time now, std::span<std::byte> into) noexcept {
        const auto* found = first();
        if (found == nullptr || found->due > now) return 0;
        auto& slot = slots_[static_cast<std::size_t>(found - slots_.data())];
        const auto length = std::min(slot.length, into.size());
        std::copy_n(slot.bytes.begin(), length, into.begin());
        slot.due = kNever;
        --count_;
        return length;
    }

  private:
    [[nodiscard]] const HeldFrame* first() const noexcept {
        const HeldFrame* best = nullptr;
        if (count_ == 0) return best;
        for (const auto& slot : slots_) {
            if (slot.due == kNever) continue;
            if (best == nullptr || slot.due < best->due || (slot.due == best->due && slot.order < best->order))
                best = &slot;
        }
        return best;
    }

    std::span<HeldFrame> slots_;
    std::size_t count_ = 0;
    std::uint64_t next_order_ = 0;
};

}  // namespace margay
