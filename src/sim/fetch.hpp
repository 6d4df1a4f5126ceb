// Prefetches memory into the cache of the processor. A thousand slaves do not fit into the cache, so a segment
// prefetches the memory of the next slaves while it processes one slave.
#pragma once

#include <cstddef>

namespace margay::sim {

inline void fetch(const void* begin, std::size_t bytes) {
    constexpr std::size_t kLine = 64;
    const auto* const at = static_cast<const std::byte*>(begin);
    for (std::size_t offset = 0; offset < bytes; offset += kLine) __builtin_prefetch(at + offset);
}

}  // namespace margay::sim
