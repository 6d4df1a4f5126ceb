// The writer's side of a ring between two threads: see spsc_ring.hpp.
#pragma once

#include <margay/spsc_ring.hpp>

#include <array>
#include <cstdint>
#include <span>

namespace margay {

// The memory belongs to the owner of the ring and must outlive the ring.
template <class T>
class WritableRing : public SpscRing<T> {
  public:
    WritableRing() = default;
    explicit WritableRing(std::span<T> memory) { this->use(memory); }

    using SpscRing<T>::add;
    using SpscRing<T>::clear;
    using SpscRing<T>::use;
};

// A ring with memory of its own.
template <class T, std::uint32_t N>
class WritableRingOf : public WritableRing<T> {
  public:
    static constexpr std::uint32_t kCapacity = N;
    WritableRingOf() { this->use(values_); }

  private:
    std::array<T, N> values_{};
};

}  // namespace margay
