// The clock of a NIC, for NICs that note when a frame has left. A NIC that can do it derives from Nic and from
// SendClock; the program gives the SendClock to LinkLayerClock (link_layer_clock.hpp). No other part of the library
// uses it, so a NIC without time stamps, and a program without LinkLayerClock, have no cost.
//
// To port: keep the time and the first kHeadBytes octets of the last frames that were sent, at least 16 of them; a
// SendTimes does that. The head is the same again after 256 frames, or after 64 where cycles overlap and frames are
// lost. So if a time comes later or may be lost, note each frame without a time when it is sent, and also a frame that
// could not be sent; or give SendTimes the number of frames. Otherwise the time of an older frame is returned.
#pragma once

#include <margay/detail/frame_times.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay {

class SendClock {
  public:
    static constexpr std::size_t kHeadBytes = detail::kFrameHeadBytes;

    // The time at which the first octet of the newest frame with these first octets has left, in ns of the clock of the
    // NIC, which may have any origin. Nothing if the time is not known, or not known yet. `head` has kHeadBytes octets.
    // Never waits. For the thread that owns the context.
    [[nodiscard]] virtual std::optional<std::uint64_t> send_time_ns(std::span<const std::byte> head) noexcept = 0;

  protected:
    ~SendClock() = default;
};

// The send times of the last frames, for a NIC that implements SendClock. For one thread at a time.
using SendTimes = detail::FrameTimes<SendClock::kHeadBytes>;

}  // namespace margay
