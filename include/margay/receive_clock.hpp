// The receive times of frames, for NICs that note when a frame has arrived: the counterpart of SendClock. A NIC that
// can do it derives from Nic and from ReceiveClock, and says so by Nic::timing(). The application asks by
// cycle_stamps() (cycle_stamps.hpp).
//
// To port: keep the time and the first kHeadBytes octets of the last frames that receive() has returned, at least 16 of
// them; a ReceiveStamps does that. Note a frame without a time too: otherwise the time of an older frame is returned
// for it.
#pragma once

#include <margay/send_clock.hpp>

namespace margay {

class ReceiveClock {
  public:
    static constexpr std::size_t kHeadBytes = SendClock::kHeadBytes;

    // When the first octet of the newest received frame with these first octets has arrived, in ns of the NIC's clock;
    // the same clock as that of SendClock, if the NIC has both. Nothing when no such frame was received, or when the
    // NIC has no time for it. `head` has kHeadBytes octets, as they were received; the length in the EtherCAT header
    // and the address of the datagram are not compared, because datagrams may be added and slaves count the position.
    // Never waits. For the thread that owns the context.
    [[nodiscard]] virtual std::optional<std::uint64_t> receive_time_ns(std::span<const std::byte> head) noexcept = 0;

  protected:
    ~ReceiveClock() = default;
};

// The receive times of the last frames, for a NIC that implements ReceiveClock. For one thread at a time.
class ReceiveStamps {
  public:
    static constexpr std::size_t kMost = 16;

    // `head`: at least ReceiveClock::kHeadBytes octets; a shorter frame is not kept. `time_ns`: nothing if the NIC has
    // no time for this frame.
    void add(std::span<const std::byte> head, std::optional<std::uint64_t> time_ns) noexcept {
        if (head.size() < ReceiveClock::kHeadBytes) return;
        Stamp& stamp = stamps_[newest_ = (newest_ + 1) % kMost];
        std::copy_n(head.begin(), stamp.head.size(), stamp.head.begin());
        stamp.time_ns = time_ns;
        stamp.used = true;
    }
    [[nodiscard]] std::optional<std::uint64_t> find(std::span<const std::byte> head) const noexcept {
        if (head.size() < ReceiveClock::kHeadBytes) return std::nullopt;
        for (std::size_t n = 0; n < kMost; ++n) {
            const Stamp& stamp = stamps_[(newest_ + kMost - n) % kMost];
            if (stamp.used && is_same(stamp.head, head)) return stamp.time_ns;
        }
        return std::nullopt;
    }

  private:
    struct Stamp {
        std::array<std::byte, ReceiveClock::kHeadBytes> head{};
        std::optional<std::uint64_t> time_ns;
        bool used = false;
    };
    // Compares the Ethernet header, and command and index of the first datagram.
    static bool is_same(std::span<const std::byte> a, std::span<const std::byte> b) noexcept {
        constexpr std::size_t kLength = 14;
        constexpr std::size_t kDatagram = 16;
        return std::equal(a.begin(), a.begin() + kLength, b.begin()) && a[kDatagram] == b[kDatagram] &&
               a[kDatagram + 1] == b[kDatagram + 1];
    }

    std::array<Stamp, kMost> stamps_{};
    std::size_t newest_ = 0;
};

}  // namespace margay
