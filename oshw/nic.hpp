// A NIC as Margay needs it: whole Ethernet frames out, whole Ethernet frames in, neither ever waiting.
//
// To port: derive from Nic. Frames are complete Ethernet II frames from the destination address to the last
// octet before the FCS, of 14 to 1518 octets; the driver adds padding to 60 octets where its hardware does
// not, and the FCS. The core hands in frames with source_mac() as their source address.
//
// One thread at a time uses a NIC, but for one case: where cycles overlap and one thread sends them while another one
// receives (GroupConfiguration::cycles_in_flight), each of the two may be in send() and last_error(), and the receiving
// one in receive(), at once. A NIC that allows this says so; PacketNic does. It does not look at a frame any more once
// the reply to it can be received.
#pragma once

#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

using MacAddress = std::array<std::uint8_t, 6>;

enum class LinkState : std::uint8_t { unknown, down, up };

enum class SendStatus : std::uint8_t {
    sent,   // taken whole
    busy,   // not taken now (queue full); the same frame may be offered again later
    failed  // not taken, and trying again will not help before link_state() changes; see last_error()
};

class Nic {
  public:
    // Sends one frame, all of it or nothing; never waits. The frame's memory is the caller's again on return.
    [[nodiscard]] virtual SendStatus send(std::span<const std::byte> frame) noexcept = 0;

    // Moves the oldest frame received into `into` and returns its length, 0 when there is none; never waits.
    // A frame longer than `into` is delivered cut to it. Frames that are surely the echo of own ones may be
    // left out: see hides_own_frames().
    [[nodiscard]] virtual std::size_t receive(std::span<std::byte> into) noexcept = 0;

    // Carrier. `unknown` is taken for up.
    [[nodiscard]] virtual LinkState link_state() noexcept { return LinkState::unknown; }

    // True: receive() never returns a frame that this NIC has sent itself, because the system marks such frames and the
    // NIC leaves them out. Replies are then also taken from slaves that do not mark them in the source address. False:
    // only the mark tells a reply from an echo, and replies without it are dropped.
    [[nodiscard]] virtual bool hides_own_frames() const noexcept { return false; }

    // The source address for frames. Bit 1 of the first octet must be 0: the first ESC sets it, and by this mark a
    // reply is told from the echo of a request.
    [[nodiscard]] virtual MacAddress source_mac() const noexcept { return {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59}; }

    // What Osal::wait() of the same system needs to wait for a frame (a file descriptor on Linux), or -1.
    [[nodiscard]] virtual int wait_handle() const noexcept { return -1; }

    // For a NIC that lives in virtual time: when the next frame will be there. Hardware says kNever.
    [[nodiscard]] virtual Time next_arrival() const noexcept { return kNever; }

    // The system's number of the last failure (errno on Linux), 0 when there was none.
    [[nodiscard]] virtual int last_error() const noexcept { return 0; }

  protected:
    ~Nic() = default;
};

}  // namespace margay
