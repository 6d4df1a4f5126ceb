// The times of the last frames of a NIC, found by the first octets of a frame.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay::detail {

// The first octets, by which a frame is recognised: the Ethernet header, the EtherCAT header, and command, index and
// address of the first datagram.
inline constexpr std::size_t kFrameHeadBytes = 22;

// Compares the Ethernet header, and the first datagram up to octet `Compared` of the frame. The length in the EtherCAT
// header is not compared: other datagrams may travel in the frame. For one thread at a time.
template <std::size_t Compared>
class FrameTimes {
  public:
    static constexpr std::size_t kMost = 16;

    // `head`: at least kFrameHeadBytes octets; a shorter frame is not kept. `time_ns`: nothing if the NIC has no time
    // for this frame, or not yet: then another call with the time completes the entry. `count`: how many frames the NIC
    // has sent or refused until now, if it does not note each of them.
    void add(std::span<const std::byte> head, std::optional<std::uint64_t> time_ns, std::uint32_t count = 0) noexcept {
        if (head.size() < kFrameHeadBytes) return;
        Entry* const known = time_ns ? newest(head) : nullptr;
        if (known != nullptr && !known->time_ns) {
            known->time_ns = time_ns;
            known->count = count;
            return;
        }
        Entry& entry = entries_[newest_ = (newest_ + 1) % kMost];
        std::copy_n(head.begin(), entry.head.size(), entry.head.begin());
        entry.time_ns = time_ns;
        entry.count = count;
        entry.used = true;
    }
    // The time of the newest frame with this head. The index of a frame returns after 64 to 256 frames: then the time
    // of an older frame is left out, by `count`.
    [[nodiscard]] std::optional<std::uint64_t> find(std::span<const std::byte> head, std::uint32_t count = 0) noexcept {
        constexpr std::uint32_t kOldest = 60;
        const Entry* const entry = head.size() < kFrameHeadBytes ? nullptr : newest(head);
        return entry == nullptr || count - entry->count > kOldest ? std::nullopt : entry->time_ns;
    }

  private:
    struct Entry {
        std::array<std::byte, kFrameHeadBytes> head{};
        std::optional<std::uint64_t> time_ns;
        std::uint32_t count = 0;
        bool used = false;
    };
    // nullptr: there is none.
    Entry* newest(std::span<const std::byte> head) noexcept {
        for (std::size_t n = 0; n < kMost; ++n) {
            Entry& entry = entries_[(newest_ + kMost - n) % kMost];
            if (entry.used && is_same(entry.head, head)) return &entry;
        }
        return nullptr;
    }
    static bool is_same(std::span<const std::byte> a, std::span<const std::byte> b) noexcept {
        constexpr std::size_t kLength = 14;
        constexpr std::size_t kDatagram = 16;
        return std::equal(a.begin(), a.begin() + kLength, b.begin()) &&
               std::equal(a.begin() + kDatagram, a.begin() + Compared, b.begin() + kDatagram);
    }

    std::array<Entry, kMost> entries_{};
    std::size_t newest_ = 0;
};

}  // namespace margay::detail
