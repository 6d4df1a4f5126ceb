#include "util/arena.hpp"

#include <new>

namespace margay {
namespace {

constexpr std::uint8_t kFree = 0x80;
constexpr std::uint8_t kInside = 0x40;  // not the first block of a run

}  // namespace

Arena::Arena(std::span<std::byte> memory) {
    const auto address = reinterpret_cast<std::uintptr_t>(memory.data());
    const std::size_t skip = (kBlockBytes - address % kBlockBytes) % kBlockBytes;
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
    unsigned wanted = 0;
    while (wanted < kOrders && (kBlockBytes << wanted) < bytes) ++wanted;
    unsigned order = wanted;
    while (order < kOrders && free_[order].empty()) ++order;
    if (order >= kOrders) return nullptr;
    FreeBlock* found = free_[order].pop_front();
    const auto index = static_cast<std::size_t>(reinterpret_cast<std::byte*>(found) - base_) / kBlockBytes;
    while (order > wanted) {
        --order;
        put_free(index + (std::size_t{1} << order), order);
    }
    state_[index] = static_cast<std::uint8_t>(wanted);
    used_ += std::size_t{1} << wanted;
    if (used_ > peak_) peak_ = used_;
    return found;
}

void Arena::release(void* memory) noexcept {
    if (memory == nullptr) return;
    auto index = static_cast<std::size_t>(static_cast<std::byte*>(memory) - base_) / kBlockBytes;
    unsigned order = state_[index];
    used_ -= std::size_t{1} << order;
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

}  // namespace margay
