// A fixed piece of memory for coroutine frames: a buddy allocator with blocks of 64 octets times a power of two. In an
// arena of at most 16 KiB an allocation takes only the blocks that it needs, as low as possible; in a larger one it
// takes a power of two. Allocation and release take a bounded number of steps. A released block is merged with its free
// neighbour, so fragmentation does not grow over time.
#pragma once

#include <margay/detail/list.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

namespace detail {
struct PromiseBase;
}

class Arena {
  public:
    static constexpr std::size_t kBlockBytes = 64;
    static constexpr unsigned kOrders = 12;  // largest block: 128 KiB

    // The caller owns `memory`, which must outlive the arena. Of each 65 octets, one is used for administration. Octets
    // before the first one with the maximum alignment are not used.
    explicit Arena(std::span<std::byte> memory);
    Arena(const Arena&) = delete;
    Arena& operator=(const Arena&) = delete;

    // Returns memory with the maximum alignment, or nullptr when no block is large enough.
    [[nodiscard]] void* allocate(std::size_t bytes) noexcept;
    void release(void* memory) noexcept;

    [[nodiscard]] std::size_t capacity_bytes() const { return blocks_ * kBlockBytes; }
    [[nodiscard]] std::size_t used_bytes() const { return used_ * kBlockBytes; }
    [[nodiscard]] std::size_t peak_bytes() const { return peak_ * kBlockBytes; }

    // Size of the memory, with the maximum alignment, that the constructor needs for `bytes` octets of blocks.
    [[nodiscard]] static constexpr std::size_t memory_for(std::size_t bytes) {
        const std::size_t blocks = (bytes + kBlockBytes - 1) / kBlockBytes;
        return blocks * (kBlockBytes + 1);
    }

    // The sequences that have found no memory, until the next poll().
    List<detail::PromiseBase> starving;

  private:
    struct FreeBlock : ListNode {};

    [[nodiscard]] std::byte* block(std::size_t index) const { return base_ + index * kBlockBytes; }
    void put_free(std::size_t index, unsigned order);

    std::byte* base_ = nullptr;
    std::uint8_t* state_ = nullptr;  // the order and the marks of each run, in the element of its first block
    std::size_t blocks_ = 0;
    std::size_t used_ = 0;
    std::size_t peak_ = 0;
    List<FreeBlock> free_[kOrders];
};

}  // namespace margay
