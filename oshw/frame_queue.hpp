// A queue of frames with their delivery times, for NICs in virtual time and delaying filters. The caller owns the
// memory; the queue does not allocate.
#pragma once

#include <margay/time.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

struct HeldFrame {
    static constexpr std::size_t kMaxBytes = 1518;  // maximum of the NIC interface
    Time due = kNever;                              // kNever: the slot is free
    std::uint64_t order = 0;
    std::size_t length = 0;
    std::array<std::byte, kMaxBytes> bytes;
};

// Delivers frames in the order of their times; frames with equal times in the order of put(). put() and take() search
// all slots, so the queue is suitable for a few dozen slots.
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

    // Copies the frame, at most HeldFrame::kMaxBytes octets. Returns false and copies nothing when the queue is full or
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

    // Time of the next delivery; kNever when the queue is empty.
    [[nodiscard]] Time next_due() const noexcept {
        const auto* slot = first();
        return slot == nullptr ? kNever : slot->due;
    }

    // Moves the next frame that is due at `now` into `into`, cut to its size, and returns the length; 0 when no frame
    // is due.
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
