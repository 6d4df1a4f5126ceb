// What slaves report on their own: CoE emergencies (ETG.1000.6 "Emergency"), kept in a ring for each slave.
#pragma once

#include <margay/time.hpp>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay {

struct Emergency {
    std::uint16_t code = 0;           // error code; 0x00xx: error reset
    std::uint8_t error_register = 0;  // as object 0x1001
    std::array<std::byte, 5> data{};  // the manufacturer's
    Time at{};                        // when the master fetched it
};

// One thread writes (the one that polls), one reads, neither waits. When nobody takes them the oldest stay, and what
// comes is counted.
class EmergencyRing {
  public:
    EmergencyRing() = default;
    explicit EmergencyRing(std::span<Emergency> memory) : ring_(memory) {}

    // The oldest one not taken yet.
    std::optional<Emergency> take() {
        const auto at = taken_.load(std::memory_order_relaxed);
        if (at == added_.load(std::memory_order_acquire)) return std::nullopt;
        const Emergency emergency = ring_[at % ring_.size()];
        taken_.store(at + 1, std::memory_order_release);
        return emergency;
    }
    // How many were dropped because there was no room.
    [[nodiscard]] std::uint32_t overruns() const { return overruns_.load(std::memory_order_relaxed); }
    // How many came, those dropped included.
    [[nodiscard]] std::uint32_t count() const { return added_.load(std::memory_order_relaxed) + overruns(); }

    // For the library.
    void add(const Emergency& emergency) {
        const auto at = added_.load(std::memory_order_relaxed);
        if (at - taken_.load(std::memory_order_acquire) == ring_.size()) {
            overruns_.store(overruns() + 1, std::memory_order_relaxed);
            return;
        }
        ring_[at % ring_.size()] = emergency;
        added_.store(at + 1, std::memory_order_release);
    }
    void use(std::span<Emergency> memory) { ring_ = memory; }
    // Forgets all: the slave was found anew.
    void clear() {
        added_.store(0);
        taken_.store(0);
        overruns_.store(0);
    }

  private:
    std::span<Emergency> ring_;
    std::atomic<std::uint32_t> added_{0};
    std::atomic<std::uint32_t> taken_{0};
    std::atomic<std::uint32_t> overruns_{0};
};

}  // namespace margay
