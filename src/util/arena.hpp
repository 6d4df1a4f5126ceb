// A fixed piece of memory in which coroutine frames come and go: a buddy allocator over blocks of 64 octets
// and their doublings. Taking and giving back cost a bounded number of steps (one a doubling), and what was
// given back joins its neighbour again, so no pattern of use wears the arena out.
#pragma once

#include <margay/detail/list.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class Arena {
  public:
    static constexpr std::size_t kBlockBytes = 64;
    static constexpr unsigned kOrders = 12;  // largest block: 128 KiB

    // `memory` stays the caller's and outlives the arena. One octet of each 65 is bookkeeping.
    explicit Arena(std::span<std::byte> memory);
    Arena(const Arena&) = delete;
    Arena& operator=(const Arena&) = delete;

    // Returns memory aligned for anything, or nullptr when there is no block left that is large enough.
    [[nodiscard]] void* allocate(std::size_t bytes) noexcept;
    void release(void* memory) noexcept;

    [[nodiscard]] std::size_t capacity_bytes() const { return blocks_ * kBlockBytes; }
    [[nodiscard]] std::size_t used_bytes() const { return used_ * kBlockBytes; }
    [[nodiscard]] std::size_t peak_bytes() const { return peak_ * kBlockBytes; }

    // How much memory to hand in for `bytes` of blocks.
    [[nodiscard]] static constexpr std::size_t memory_for(std::size_t bytes) {
        const std::size_t blocks = (bytes + kBlockBytes - 1) / kBlockBytes;
        return blocks * (kBlockBytes + 1) + 2 * kBlockBytes;
    }

  private:
    struct FreeBlock : ListNode {};

    [[nodiscard]] std::byte* block(std::size_t index) const { return base_ + index * kBlockBytes; }
    void put_free(std::size_t index, unsigned order);

    std::byte* base_ = nullptr;
    std::uint8_t* state_ = nullptr;  // of each block that starts a run: its order, and kFree
    std::size_t blocks_ = 0;
    std::size_t used_ = 0;
    std::size_t peak_ = 0;
    List<FreeBlock> free_[kOrders];
};

}  // namespace margay
