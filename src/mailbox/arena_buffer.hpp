// A buffer from the arena. Its destructor returns the memory.
#pragma once

#include "util/arena.hpp"
#include "util/bytes.hpp"

namespace margay {

class ArenaBuffer {
  public:
    explicit ArenaBuffer(Arena& arena) : arena_(arena) {}
    // Owns memory that another buffer of the same arena has released.
    ArenaBuffer(Arena& arena, MutableBytes released)
        : arena_(arena), memory_(released.data()), bytes_(released.size()) {}
    ArenaBuffer(const ArenaBuffer&) = delete;
    ArenaBuffer& operator=(const ArenaBuffer&) = delete;
    ~ArenaBuffer() { arena_.release(memory_); }

    // Allocates `bytes` octets on the first call. False when the arena has no room for them now, or the buffer already
    // has fewer octets.
    [[nodiscard]] bool reserve(std::size_t bytes) {
        if (memory_ != nullptr) return bytes_ >= bytes;
        memory_ = arena_.allocate(bytes);
        bytes_ = memory_ == nullptr ? 0 : bytes;
        return memory_ != nullptr;
    }
    // Gives up the ownership of the memory without returning it to the arena.
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
