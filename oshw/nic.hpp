// The interface to a NIC: it sends and receives whole Ethernet frames and never waits.
//
// To port: derive from Nic. A frame is a complete Ethernet II frame from the destination address to the last octet
// before the FCS, 14 to 1518 octets long. The driver adds the FCS, and the padding to 60 octets if the hardware does
// not. The core uses source_mac() as source address of its frames.
//
// Only one thread at a time uses a NIC, with one exception: with overlapping cycles
// (GroupConfiguration::cycles_in_flight) one thread may send the cycles while another thread receives. Then both
// threads may be in send() and last_error() at the same time, and the receiving thread in receive(). A NIC that
// supports this says so in its documentation, as PacketNic does. It must not access the memory of a sent frame after
// the reply to this frame can be received.
#pragma once

#include <margay/frame_timing.hpp>
#include <margay/mac_address.hpp>
#include <margay/time.hpp>
#include <margay/wait_handles.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

enum class LinkState : std::uint8_t { unknown, down, up };

enum class SendStatus : std::uint8_t {
    sent,   // the whole frame was accepted
    busy,   // not accepted now because the queue is full; send the same frame again later
    failed  // not accepted, and a retry fails until link_state() changes; see last_error()
};

class Nic {
  public:
    // Sends one whole frame or nothing; never waits. After return, the caller may reuse the memory of the frame.
    [[nodiscard]] virtual SendStatus send(std::span<const std::byte> frame) noexcept = 0;

    // Moves the oldest received frame into `into` and returns its length; 0 when there is none. Never waits. A frame
    // longer than `into` is cut. Frames that are certainly an echo of own frames may be skipped: see
    // hides_own_frames().
    [[nodiscard]] virtual std::size_t receive(std::span<std::byte> into) noexcept = 0;

    // Carrier state. `unknown` is treated as up.
    [[nodiscard]] virtual LinkState link_state() noexcept { return LinkState::unknown; }

    // True: receive() never returns a frame that this NIC has sent, because the system marks such frames and the NIC
    // skips them. Then replies are also accepted from slaves that do not set the mark in the source address. False:
    // only this mark distinguishes a reply from an echo, and replies without the mark are dropped.
    [[nodiscard]] virtual bool hides_own_frames() const noexcept { return false; }

    // The source address for frames. Bit 1 of the first octet must be 0: the first ESC sets this bit, and the bit
    // distinguishes a reply from an echo of the request.
    [[nodiscard]] virtual MacAddress source_mac() const noexcept { return {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59}; }

    // The handle that Osal::wait() of the same system needs to wait for a frame (a file descriptor on Linux), or -1.
    [[nodiscard]] virtual int wait_handle() const noexcept { return -1; }
    // The argument of Osal::wait(). Only a NIC that consists of two NICs has two handles.
    [[nodiscard]] virtual WaitHandles wait_handles() const noexcept { return wait_handle(); }

    // For a NIC in virtual time: the arrival time of the next frame. Hardware returns kNever.
    [[nodiscard]] virtual Time next_arrival() const noexcept { return kNever; }

    // The error number of the system for the last failure (errno on Linux); 0 when there was none.
    [[nodiscard]] virtual int last_error() const noexcept { return 0; }

    // The abilities of this NIC for the times of frames, by its present settings: "sent at", "received at", "send at".
    // None of them is required.
    [[nodiscard]] virtual FrameTiming timing() noexcept { return {}; }

  protected:
    ~Nic() = default;
};

}  // namespace margay
