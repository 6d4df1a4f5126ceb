#include "util/arena.hpp"

#include <new>

namespace margay {
namespace {

constexpr std::uint8_t kFree = 0x80;
constexpr std::uint8_t kInside = 0x40;  // not the first block of a run
constexpr std::uint8_t kMore = 0x20;    // the run belongs to the same allocation as the run before it
constexpr std::uint8_t kOrder = 0x0F;
// An arena of at most kFewBlocks blocks is searched from its beginning, and an allocation uses only the blocks that it
// needs, because memory is scarcer than time. In a larger arena, an allocation uses a power of two, from a list.
constexpr std::size_t kFewBlocks = 256;

// The lowest index with `blocks` free blocks, in one run or in several adjacent runs; `all`: there is none.
std::size_t lowest_fit(const std::uint8_t* state, std::size_t all, std::size_t blocks) {
    std::size_t first = 0;
    for (std::size_t at = 0; at < all;) {
        const bool free = (state[at] & kFree) != 0;
        at += std::size_t{1} << (state[at] & kOrder);
        if (!free)
            first = at;
        else if (at - first >= blocks)
            return first;
    }
    return all;
}

}  // namespace

Arena::Arena(std::span<std::byte> memory) {
    const auto address = reinterpret_cast<std::uintptr_t>(memory.data());
    const std::size_t skip = (0 - address) % alignof(std::max_align_t);
    if (memory.size() < skip + kBlockBytes + 1) return;
    blocks_ = (memory.size() - skip) / (kBlockBytes + 1);
    base_ = memory.data() + skip;
    state_ = reinterpret_cast<std::uint8_t*>(base_ + blocks_ * kBlockBytes);
    for (std::size_t i = 0; i < blocks_; ++i) state_[i] = kInside;
    for (std::size_t at = 0; at < blocks_;) {
        unsigned order = kOrders - 1;
        while ((at & ((std::size_t{1} << order) - 1)) != 0 || at + (std::size_t{1} << order) > blocks_) --order;
        put_free(at, order);
        at += std::size_t{1} << order;
    }
}

void Arena::put_free(std::size_t index, unsigned order) {
    state_[index] = static_cast<std::uint8_t>(kFree | order);
    free_[order].push_front(*::new (static_cast<void*>(block(index))) FreeBlock);
}

void* Arena::allocate(std::size_t bytes) noexcept {
    std::size_t blocks = bytes <= kBlockBytes ? 1 : (bytes - 1) / kBlockBytes + 1;
    std::size_t index = blocks_;
    if (blocks_ <= kFewBlocks) {
        index = lowest_fit(state_, blocks_, blocks);
    } else {
        unsigned order = 0;
        while (order < kOrders && (std::size_t{1} << order) < blocks) ++order;
        blocks = std::size_t{1} << order;
        while (order < kOrders && free_[order].empty()) ++order;
        if (order < kOrders)
            index = static_cast<std::size_t>(reinterpret_cast<std::byte*>(free_[order].front()) - base_) / kBlockBytes;
    }
    if (index == blocks_) return nullptr;
    void* const memory = block(index);
    std::uint8_t more = 0;
    for (std::size_t left = blocks; left != 0;) {
        // A free run begins at `index`: the allocation uses all of it, or its second half stays free.
        unsigned order = state_[index] & kOrder;
        reinterpret_cast<FreeBlock*>(block(index))->unlink();
        while (std::size_t{1} << order > left) {
            --order;
            put_free(index + (std::size_t{1} << order), order);
        }
        state_[index] = static_cast<std::uint8_t>(order | more);
        more = kMore;
        index += std::size_t{1} << order;
        left -= std::size_t{1} << order;
    }
    used_ += blocks;
    if (used_ > peak_) peak_ = used_;
    return memory;
}

void Arena::release(void* memory) noexcept {
    if (memory == nullptr) return;
    auto next = static_cast<std::size_t>(static_cast<std::byte*>(memory) - base_) / kBlockBytes;
    for (bool more = true; more;) {
        std::size_t index = next;
        unsigned order = state_[index] & kOrder;
        next += std::size_t{1} << order;
        more = next < blocks_ && (state_[next] & kMore) != 0;
        used_ -= next - index;
        while (order + 1 < kOrders) {
            const std::size_t buddy = index ^ (std::size_t{1} << order);
            if (buddy >= blocks_ || state_[buddy] != (kFree | order)) break;
            reinterpret_cast<FreeBlock*>(block(buddy))->unlink();
            state_[index] = state_[buddy] = kInside;
            if (buddy < index) index = buddy;
            ++order;
        }
        put_free(index, order);
    }
}

}  // namespace margay
