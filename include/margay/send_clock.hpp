// The clock of a NIC, for NICs that note when a frame has left. A NIC that can do it derives from Nic and from
// SendClock; the program gives the SendClock to LinkLayerClock (link_layer_clock.hpp). Nothing else in the library asks
// for it, so that a NIC without time stamps, and a program without LinkLayerClock, have no cost.
//
// To port: keep the time and the first kHeadBytes octets of the last frames that were sent, at least 16 of them; a
// SendTimes does that.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay {

class SendClock {
  public:
    // These octets of a frame are enough to recognise it: the Ethernet header, the EtherCAT header, and of the first
    // datagram command, index and address.
    static constexpr std::size_t kHeadBytes = 22;

    // When the first octet of the newest frame with these first octets has left, in ns of the NIC's clock, from an
    // origin of the NIC's choice; nothing when that is not known, or not known yet. `head` has kHeadBytes octets. Never
    // waits. For the thread that owns the context.
    [[nodiscard]] virtual std::optional<std::uint64_t> send_time_ns(std::span<const std::byte> head) noexcept = 0;

  protected:
    ~SendClock() = default;
};

// The send times of the last frames, for a NIC that implements SendClock. For one thread at a time.
class SendTimes {
  public:
    static constexpr std::size_t kMost = 16;

    // `head`: at least SendClock::kHeadBytes octets; a shorter frame is not kept.
    void add(std::span<const std::byte> head, std::uint64_t time_ns) noexcept {
        if (head.size() < SendClock::kHeadBytes) return;
        Stamp& stamp = stamps_[newest_ = (newest_ + 1) % kMost];
        std::copy_n(head.begin(), stamp.head.size(), stamp.head.begin());
        stamp.time_ns = time_ns;
        stamp.used = true;
    }
    [[nodiscard]] std::optional<std::uint64_t> find(std::span<const std::byte> head) const noexcept {
        if (head.size() < SendClock::kHeadBytes) return std::nullopt;
        for (std::size_t n = 0; n < kMost; ++n) {
            const Stamp& stamp = stamps_[(newest_ + kMost - n) % kMost];
            if (stamp.used && is_same(stamp.head, head)) return stamp.time_ns;
        }
        return std::nullopt;
    }

  private:
    struct Stamp {
        std::array<std::byte, SendClock::kHeadBytes> head{};
        std::uint64_t time_ns = 0;
        bool used = false;
    };
    // The length in the EtherCAT header is not compared: other datagrams may travel in the frame.
    static bool is_same(std::span<const std::byte> a, std::span<const std::byte> b) noexcept {
        constexpr std::size_t kLength = 14;
        constexpr std::size_t kDatagram = 16;
        return std::equal(a.begin(), a.begin() + kLength, b.begin()) &&
               std::equal(a.begin() + kDatagram, a.begin() + SendClock::kHeadBytes, b.begin() + kDatagram);
    }

    std::array<Stamp, kMost> stamps_{};
    std::size_t newest_ = 0;
};

}  // namespace margay
