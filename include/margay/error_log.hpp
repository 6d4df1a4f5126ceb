// The last errors of a context, oldest first: one thread writes (the one that polls), one reads, neither ever waits.
#pragma once

#include <margay/error.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

namespace margay {

class ErrorLog {
  public:
    static constexpr std::uint32_t kCapacity = 64;

    // The oldest error not taken yet.
    std::optional<Error> take() {
        const auto at = taken_.load(std::memory_order_relaxed);
        if (at == added_.load(std::memory_order_acquire)) return std::nullopt;
        const Error error = ring_[at % kCapacity];
        taken_.store(at + 1, std::memory_order_release);
        return error;
    }

    // How many were dropped because nobody had taken the older ones.
    [[nodiscard]] std::uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

    // For the library: adds one; when the ring is full it is counted and dropped.
    void add(const Error& error) {
        const auto at = added_.load(std::memory_order_relaxed);
        if (at - taken_.load(std::memory_order_acquire) == kCapacity) {
            dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
            return;
        }
        ring_[at % kCapacity] = error;
        added_.store(at + 1, std::memory_order_release);
    }

  private:
    std::array<Error, kCapacity> ring_{};
    std::atomic<std::uint32_t> added_{0};
    std::atomic<std::uint32_t> taken_{0};
    std::atomic<std::uint32_t> dropped_{0};
};

}  // namespace margay
