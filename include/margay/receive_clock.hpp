// The receive times of frames, for NICs that note when a frame has arrived: the counterpart of SendClock. A NIC that
// can do it derives from Nic and from ReceiveClock, and returns its ReceiveClock by Nic::timing(). The application gets
// the times by cycle_stamps() (cycle_stamps.hpp).
//
// To port: keep the time and the first kHeadBytes octets of the last frames that receive() has returned, at least 16 of
// them; an ArrivalTimes does that. Also note a frame without a time: otherwise the time of an older frame is returned
// for this frame.
#pragma once

#include <margay/send_clock.hpp>

namespace margay {

class ReceiveClock {
  public:
    static constexpr std::size_t kHeadBytes = SendClock::kHeadBytes;

    // When the first octet of the newest received frame with these first octets has arrived, in ns of the NIC's clock;
    // the same clock as that of SendClock, if the NIC has both. Nothing when no such frame was received, or when the
    // NIC has no time for it. `head` has kHeadBytes octets, as they were received; the length in the EtherCAT header
    // and the address of the datagram are not compared, because datagrams may be added, and each slave increments an
    // address by position. Never waits. For the thread that owns the context.
    [[nodiscard]] virtual std::optional<std::uint64_t> receive_time_ns(std::span<const std::byte> head) noexcept = 0;

  protected:
    ~ReceiveClock() = default;
};

// The receive times of the last frames, for a NIC that implements ReceiveClock. The address of the datagram is not
// compared. For one thread at a time.
using ArrivalTimes = detail::FrameTimes<18>;

}  // namespace margay
