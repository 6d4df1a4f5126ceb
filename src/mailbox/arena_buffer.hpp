// Octets borrowed from the arena for as long as a sequence runs.
#pragma once

#include "util/arena.hpp"
#include "util/bytes.hpp"

namespace margay {

class ArenaBuffer {
  public:
    explicit ArenaBuffer(Arena& arena) : arena_(arena) {}
    // Takes over what another buffer of the arena has released.
    ArenaBuffer(Arena& arena, MutableBytes released)
        : arena_(arena), memory_(released.data()), bytes_(released.size()) {}
    ArenaBuffer(const ArenaBuffer&) = delete;
    ArenaBuffer& operator=(const ArenaBuffer&) = delete;
    ~ArenaBuffer() { arena_.release(memory_); }

    // Makes sure that there are `bytes`; false when the arena has no room for them now.
    [[nodiscard]] bool reserve(std::size_t bytes) {
        if (memory_ != nullptr) return bytes_ >= bytes;
        memory_ = arena_.allocate(bytes);
        bytes_ = memory_ == nullptr ? 0 : bytes;
        return memory_ != nullptr;
    }
    // Leaves the memory to somebody else.
    void release() {
        memory_ = nullptr;
        bytes_ = 0;
    }
    [[nodiscard]] MutableBytes bytes() const { return {static_cast<std::byte*>(memory_), bytes_}; }

  private:
    Arena& arena_;
    void* memory_ = nullptr;
    std::size_t bytes_ = 0;
};

}  // namespace margay
