// Shared by several fuzz harnesses: the input, which is read piece by piece, and the check of the guard after a memory.
#pragma once

#include "util/bytes.hpp"

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace margay::fuzzing {

inline constexpr std::size_t kGuard = 16;
inline constexpr std::byte kMark{0xA5};

inline void require(bool holds) {
    if (!holds) std::abort();
}

inline bool untouched(const std::vector<std::byte>& memory, std::size_t from) {
    return std::all_of(memory.begin() + static_cast<std::ptrdiff_t>(from), memory.end(),
                       [](std::byte b) { return b == kMark; });
}

class Input {
  public:
    explicit Input(Bytes data) : left_(data) {}
    [[nodiscard]] bool empty() const { return left_.empty(); }
    std::size_t octet() {
        const Bytes one = take(1);
        return one.empty() ? 0 : std::to_integer<std::size_t>(one.front());
    }
    Bytes take(std::size_t bytes) {
        const Bytes taken = left_.first(std::min(bytes, left_.size()));
        left_ = left_.subspan(taken.size());
        return taken;
    }

  private:
    Bytes left_;
};

}  // namespace margay::fuzzing
