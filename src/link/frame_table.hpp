// The table of frames in flight: maps the index of a frame to its datagrams until the reply arrives or the frame times
// out.
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
    // The prepared frame (of the cycle) that is sent with this index. `datagrams` are then sent after the datagrams of
    // this frame.
    PreparedFrame* prepared = nullptr;
    Time deadline = kNever;
    std::uint16_t length = 0;  // octets of all datagrams with their headers
    std::uint8_t index = 0;
    bool in_flight = false;  // only for slots of the table
    bool unmarked = false;   // a reply without the mark of the first ESC came back, and was dropped
    bool refused = false;    // the NIC failed to send the frame; the slot still waits for its deadline
};

class FrameTable {
  public:
    static constexpr std::size_t kMostSlots = 128;

    // `slots`: one for each frame that may be in flight at the same time, at most kMostSlots. The memory outlives the
    // table.
    explicit FrameTable(std::span<FrameSlot> slots) : slots_(slots) {}

    // Returns a free slot with an index that no frame in flight uses and that no recently lost frame used. Returns
    // nullptr when there is none.
    [[nodiscard]] FrameSlot* open(Time now);
    // The same for a slot outside the table, which has no deadline here and which only its owner closes. False: all
    // indices are in use.
    [[nodiscard]] bool claim(FrameSlot& slot, Time now) {
        // The fast path: the next index is nearly always free.
        const std::uint8_t index = next_index_;
        if (any_resting_.load(std::memory_order_relaxed) || at(index) != nullptr) [[unlikely]]
            return claim_free(slot, now);
        take(slot, index);
        return true;
    }
    // The slot in flight under `index`, or nullptr.
    [[nodiscard]] FrameSlot* find(std::uint8_t index) { return slot_of_[index].load(std::memory_order_acquire); }

    // For overlapped cycles: reserves the indices from kSplit on for the thread that sends overlapped cycles. That
    // thread calls only free_index(), publish(), and release() for a frame that it could not send. The owner's thread
    // calls all other functions.
    void split() {
        mask_ = kSplit - 1;
        next_index_ &= mask_;
    }
    // Returns an index by the rules of open(), or nothing.
    [[nodiscard]] std::optional<std::uint8_t> free_index();
    // Makes the slot visible to the owner's thread. Call it after everything that the owner reads is written.
    void publish(FrameSlot& slot, std::uint8_t index) {
        slot.index = index;
        slot_of_[index].store(&slot, std::memory_order_release);
    }
    // Makes resting indices free again when their rest is over.
    void refresh(Time now) {
        if (any_resting_.load(std::memory_order_relaxed) && now >= rest_until_) end_rest();
    }
    // Frees the index of a slot outside the table whose reply has arrived.
    void release(const FrameSlot& slot) { slot_of_[slot.index].store(nullptr, std::memory_order_release); }
    // Closes a slot. The index of a lost frame rests (kRest), so that a late reply is not matched with another frame.
    void close(FrameSlot& slot, bool lost, Time now) {
        release(slot);
        if (slot.in_flight) --in_flight_;
        slot.in_flight = false;
        if (lost) rest(slot.index, now);
    }
    // Returns a slot of the table whose deadline has passed at `now`, or nullptr.
    [[nodiscard]] FrameSlot* expired(Time now);
    [[nodiscard]] Time next_deadline() const;

  private:
    static constexpr Duration kRest = std::chrono::milliseconds(200);

    static constexpr std::uint8_t kSplit = 128;

    [[nodiscard]] FrameSlot* at(std::uint8_t index) const { return slot_of_[index].load(std::memory_order_relaxed); }
    [[nodiscard]] bool resting(std::uint8_t index) const {
        return ((resting_[index / 32].load(std::memory_order_relaxed) >> (index % 32)) & 1U) != 0;
    }
    // Whether too many of the indices `first` to `first + count - 1` rest, so that the other indices would be used
    // again too soon.
    [[nodiscard]] bool too_many_rest(unsigned first, unsigned count) const;
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
    std::size_t in_flight_ = 0;  // number of slots_ in flight
    std::size_t next_slot_ = 0;
    std::uint8_t next_index_ = 0;
    std::uint8_t mask_ = 0xFF;
    std::uint8_t next_overlapped_ = kSplit;
    std::atomic<bool> any_resting_{false};
};

}  // namespace margay
