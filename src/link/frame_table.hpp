// Frames in flight: which index belongs to which datagrams, until the reply comes or the time is up.
#pragma once

#include "link/datagram.hpp"

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <span>

namespace margay {

struct PreparedFrame;

struct FrameSlot {
    List<Datagram> datagrams;
    // The frame of the cycle that travels under this index, `datagrams` riding in it.
    PreparedFrame* prepared = nullptr;
    Time deadline = kNever;
    std::uint16_t length = 0;  // of all datagrams with their headers
    std::uint8_t index = 0;
    bool in_flight = false;  // of a table's slot
    bool unmarked = false;   // its frame has come back without the mark of the first ESC, and was dropped
    bool refused = false;    // the NIC failed to send it: it waits for its deadline all the same
};

class FrameTable {
  public:
    static constexpr std::size_t kMostSlots = 128;

    // `slots`: one for each frame that may be in flight at once, kMostSlots at most; their memory outlives the table.
    explicit FrameTable(std::span<FrameSlot> slots) : slots_(slots) {}

    // A free slot with an index that no frame in flight has and that no frame lost lately had, or nullptr.
    [[nodiscard]] FrameSlot* open(Time now);
    // The same for a slot that is not of the table, and that nobody but its owner gives up. False: all indices are
    // taken.
    [[nodiscard]] bool claim(FrameSlot& slot, Time now) {
        // Nearly always the next index is free.
        const std::uint8_t index = next_index_;
        if (any_resting_.load(std::memory_order_relaxed) || at(index) != nullptr) [[unlikely]]
            return claim_free(slot, now);
        take(slot, index);
        return true;
    }
    // The slot in flight under `index`, or nullptr.
    [[nodiscard]] FrameSlot* find(std::uint8_t index) { return slot_of_[index].load(std::memory_order_acquire); }

    // For overlapped cycles: indices from kSplit on are kept for the thread that sends those. It calls free_index() and
    // publish(), and release() for what it could not send; all else is the owner's.
    void split() {
        mask_ = kSplit - 1;
        next_index_ &= mask_;
    }
    // An index as open() would choose it, or nothing.
    [[nodiscard]] std::optional<std::uint8_t> free_index();
    // From now on the owner finds the slot; all that it looks at is written.
    void publish(FrameSlot& slot, std::uint8_t index) {
        slot.index = index;
        slot_of_[index].store(&slot, std::memory_order_release);
    }
    // Indices that have rested long enough are free again.
    void refresh(Time now) {
        if (any_resting_.load(std::memory_order_relaxed) && now >= rest_until_) end_rest();
    }
    // Ends a slot that is not of the table and whose frame has come.
    void release(const FrameSlot& slot) { slot_of_[slot.index].store(nullptr, std::memory_order_release); }
    // Ends a slot. A lost frame's index rests, so that a reply that comes late finds nobody.
    void close(FrameSlot& slot, bool lost, Time now) {
        release(slot);
        if (slot.in_flight) --in_flight_;
        slot.in_flight = false;
        if (lost) rest(slot.index, now);
    }
    // A slot of the table that must be given up at `now`, or nullptr.
    [[nodiscard]] FrameSlot* expired(Time now);
    [[nodiscard]] Time next_deadline() const;

  private:
    static constexpr Duration kRest = std::chrono::milliseconds(200);

    static constexpr std::uint8_t kSplit = 128;

    [[nodiscard]] FrameSlot* at(std::uint8_t index) const { return slot_of_[index].load(std::memory_order_relaxed); }
    [[nodiscard]] bool resting(std::uint8_t index) const {
        return ((resting_[index / 32].load(std::memory_order_relaxed) >> (index % 32)) & 1U) != 0;
    }
    void end_rest();
    [[nodiscard]] bool claim_free(FrameSlot& slot, Time now);
    void take(FrameSlot& slot, std::uint8_t index) {
        slot_of_[index].store(&slot, std::memory_order_relaxed);
        next_index_ = static_cast<std::uint8_t>((index + 1) & mask_);
        slot.index = index;
    }
    void rest(std::uint8_t index, Time now);

    std::span<FrameSlot> slots_;
    std::array<std::atomic<FrameSlot*>, 256> slot_of_{};
    std::array<std::atomic<std::uint32_t>, 8> resting_{};
    Time rest_until_ = Time::min();
    std::size_t in_flight_ = 0;  // of slots_
    std::size_t next_slot_ = 0;
    std::uint8_t next_index_ = 0;
    std::uint8_t mask_ = 0xFF;
    std::uint8_t next_overlapped_ = kSplit;
    std::atomic<bool> any_resting_{false};
};

}  // namespace margay
