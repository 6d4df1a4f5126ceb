// A ring of octets between two threads: one thread adds records, one thread removes them, and no thread ever waits.
#pragma once

#include <atomic>
#include <cstddef>
#include <span>

namespace margay {

// The memory is the caller's. A record consists of two parts, which add() adds at the same time. The ring does not know
// how long a record is: the two threads agree on that.
class OctetRing {
  public:
    explicit OctetRing(std::span<std::byte> memory) : memory_(memory) {}
    OctetRing(const OctetRing&) = delete;
    OctetRing& operator=(const OctetRing&) = delete;

    // --- The thread that adds ---

    // The number of free octets now. The other thread can only increase it.
    [[nodiscard]] std::size_t room() const;
    // Adds both parts. False: no room for both, and nothing was added.
    bool add(std::span<const std::byte> head, std::span<const std::byte> data);

    // --- The thread that removes ---

    // Copies octets into `into`. The first one is `skip` octets behind the oldest octet. The ring must contain all of
    // these octets.
    void peek(std::size_t skip, std::span<std::byte> into) const;
    // Removes the oldest octets.
    void drop(std::size_t octets);

    // --- Any thread ---
    [[nodiscard]] bool empty() const;
    [[nodiscard]] std::size_t size() const { return memory_.size(); }

  private:
    void put(std::size_t& at, std::span<const std::byte> octets);
    [[nodiscard]] std::size_t used(std::size_t added, std::size_t removed) const;
    [[nodiscard]] std::size_t advanced(std::size_t at, std::size_t octets) const;
    [[nodiscard]] std::size_t slot(std::size_t at) const { return at < memory_.size() ? at : at - memory_.size(); }

    std::span<std::byte> memory_;
    // Indices from 0 to twice the size of the memory, so that a full ring differs from an empty one.
    std::atomic<std::size_t> added_{0};
    std::atomic<std::size_t> removed_{0};
};

}  // namespace margay
