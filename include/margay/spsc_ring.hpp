// A ring between two threads: one thread writes, one thread reads, and no thread ever waits. The library keeps errors,
// warnings, events and emergencies in such rings, and alone writes them.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

namespace margay {

// The reader's side of a ring. A full ring keeps the oldest values, and drops and counts new values. A ring without
// memory is always empty.
template <class T>
class SpscRing {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    SpscRing() = default;
    SpscRing(const SpscRing&) = delete;
    SpscRing& operator=(const SpscRing&) = delete;

    // --- The reading thread ---

    // Removes the oldest value from the ring and returns it.
    std::optional<T> take() {
        std::uint32_t state = taken_.load(std::memory_order_relaxed);
        // clear() may move the reading index until the slot is reserved.
        do {
            if ((state & kPlace) == added_.load(std::memory_order_acquire)) return std::nullopt;
        } while (!taken_.compare_exchange_weak(state, state | kReading, std::memory_order_acquire,
                                               std::memory_order_relaxed));
        const T value = memory_[slot(state & kPlace)];
        end_reading(state);
        return value;
    }

    // --- Any thread ---

    // How many values were dropped because the ring was full.
    [[nodiscard]] std::uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }
    // How many values were added, the dropped ones included. Counts modulo 2^32.
    [[nodiscard]] std::uint32_t count() const { return came_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::uint32_t capacity() const { return size_; }

    // The ring uses this many values of its memory at most.
    static constexpr std::uint32_t kMost = 0x1FFFF;

  protected:
    // --- The writing thread: see WritableRing (detail/writable_ring.hpp) ---

    // Adds a value. False: the ring is full; the value was dropped and counted.
    bool add(const T& value) {
        came_.store(count() + 1, std::memory_order_relaxed);
        const std::uint32_t at = added_.load(std::memory_order_relaxed);
        if (distance(taken_.load(std::memory_order_acquire) & kPlace, at) >= size_) {
            dropped_.store(dropped() + 1, std::memory_order_relaxed);
            return false;
        }
        memory_[slot(at)] = value;
        added_.store(next(at), std::memory_order_release);
        return true;
    }

    // Removes all values and resets the counters. A value that the reading thread is copying at this moment is still
    // delivered.
    void clear() {
        const std::uint32_t end = added_.load(std::memory_order_relaxed);
        cleared_to_.store(end, std::memory_order_relaxed);
        std::uint32_t state = taken_.load(std::memory_order_relaxed);
        std::uint32_t cleared = 0;
        do {
            // While the reading thread copies a value, its slot is not free: end_reading() continues at cleared_to_.
            const std::uint32_t kept = (state & kReading) != 0 ? state & (kReading | kPlace) : end;
            cleared = kept | ((state + kOneClear) & kClears);
        } while (!taken_.compare_exchange_weak(state, cleared, std::memory_order_acq_rel, std::memory_order_relaxed));
        came_.store(0, std::memory_order_relaxed);
        dropped_.store(0, std::memory_order_relaxed);
    }

    // Sets the memory of the ring, which must outlive the ring, before the first value is added.
    void use(std::span<T> memory) {
        memory_ = memory;
        size_ = static_cast<std::uint32_t>(memory.size() < kMost ? memory.size() : kMost);
    }

  private:
    // The state of the reader in one word: its index, how often the ring was cleared, and whether the reading thread
    // copies a value. The index counts from 0 to twice the size, so that a full ring differs from an empty one for
    // every size.
    static constexpr std::uint32_t kPlace = 0x0003FFFF;
    static constexpr std::uint32_t kOneClear = 0x00040000;
    static constexpr std::uint32_t kClears = 0x7FFC0000;
    static constexpr std::uint32_t kReading = 0x80000000;

    [[nodiscard]] std::uint32_t next(std::uint32_t place) const { return place + 1 == 2 * size_ ? 0 : place + 1; }
    [[nodiscard]] std::uint32_t slot(std::uint32_t place) const { return place < size_ ? place : place - size_; }
    [[nodiscard]] std::uint32_t distance(std::uint32_t from, std::uint32_t to) const {
        return to >= from ? to - from : to + 2 * size_ - from;
    }

    void end_reading(std::uint32_t began) {
        std::uint32_t state = began | kReading;
        std::uint32_t to = next(began & kPlace);
        while (!taken_.compare_exchange_weak(state, (state & kClears) | to, std::memory_order_acq_rel,
                                             std::memory_order_acquire))
            if (((state ^ began) & kClears) != 0) to = cleared_to_.load(std::memory_order_relaxed);
    }

    std::span<T> memory_;
    std::uint32_t size_ = 0;
    std::atomic<std::uint32_t> added_{0};
    std::atomic<std::uint32_t> taken_{0};
    std::atomic<std::uint32_t> cleared_to_{0};
    std::atomic<std::uint32_t> came_{0};
    std::atomic<std::uint32_t> dropped_{0};
};

}  // namespace margay
