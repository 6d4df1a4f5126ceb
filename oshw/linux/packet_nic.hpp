// A network interface of Linux, accessed by an AF_PACKET socket: one system call per sent frame and one per received
// frame. After open(), several threads may call send(), receive(), link_state() and last_error() at the same time.
#pragma once

#include "oshw/linux/interface.hpp"
#include "oshw/nic.hpp"

#include <margay/result.hpp>
#include <margay/send_clock.hpp>

#include <atomic>
#include <string_view>

namespace margay {

class PacketNic final : public Nic, public SendClock {
  public:
    // The end of the cable that this NIC represents.
    enum class Side : std::uint8_t {
        // A master. Replies have the broadcast address as destination, so promiscuous mode is not needed. source_mac()
        // has the mark bits cleared.
        master,
        // A simulated segment. Masters use any destination and source address and the segment must receive all frames,
        // so promiscuous mode is on. The replies keep the source address of the request.
        segment
    };

    PacketNic() noexcept = default;
    ~PacketNic();
    PacketNic(const PacketNic&) = delete;
    PacketNic& operator=(const PacketNic&) = delete;

    // Opens the interface. On failure, problem() describes the cause and the remedy; `actual` of the error is errno. An
    // unplugged cable is not an error, see link_state(). Needs CAP_NET_RAW. Not callable from the cycle.
    [[nodiscard]] Result<> open(std::string_view interface, Side side = Side::master) noexcept;
    void close() noexcept;

    // One sentence about the last failed open(); empty after success. Valid until the next open().
    [[nodiscard]] std::string_view problem() const noexcept { return interface_.problem(); }

    // Where the time of a sent frame is taken.
    enum class Stamps : std::uint8_t {
        off,
        software,  // by the driver, just before the frame goes to the hardware, in the time of CLOCK_REALTIME
        // By the hardware, in the time of its own clock (/dev/ptpN). The first program switches the hardware on, for
        // which it needs CAP_NET_ADMIN.
        hardware,
    };
    // Notes when each frame is sent (SO_TIMESTAMPING), for LinkLayerClock. Each sent frame then costs one more system
    // call. Call it after open(); open() switches it off. On failure, problem() has the cause: most often the driver
    // of the interface has no time stamps of this kind (`ethtool -T` lists them). While time stamps are on, one thread
    // calls receive() and send_time_ns(). Not callable from the cycle.
    [[nodiscard]] Result<> stamp_frames(Stamps stamps) noexcept;
    // Send times of the last frames; see SendClock. Reads those that the kernel has ready.
    [[nodiscard]] std::optional<std::uint64_t> send_time_ns(std::span<const std::byte> head) noexcept override;

    // Whether frames bypass the queueing discipline on the way to the driver; some kernels refuse this. Packet sniffers
    // on the same interface then see only received frames: use a PcapRecorder for recordings.
    [[nodiscard]] bool qdisc_bypassed() const noexcept { return qdisc_bypassed_; }

    // Number of received frames since open() that the kernel dropped because the program did not read them in time. One
    // system call.
    [[nodiscard]] std::uint64_t overruns() noexcept;

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    // One system call; do not call it in every cycle.
    [[nodiscard]] LinkState link_state() noexcept override { return interface_.link_state(); }
    // The kernel marks the frames that this interface has sent (PACKET_OUTGOING), and the receive filter drops them.
    [[nodiscard]] bool hides_own_frames() const noexcept override { return true; }
    // The address of the interface with bits 0 (group) and 1 (mark of the first ESC) of the first octet cleared.
    [[nodiscard]] MacAddress source_mac() const noexcept override { return source_mac_; }
    [[nodiscard]] int wait_handle() const noexcept override { return socket_; }
    [[nodiscard]] int last_error() const noexcept override { return last_error_.load(std::memory_order_relaxed); }

  private:
    [[nodiscard]] Result<> set_up(Side side) noexcept;
    [[nodiscard]] bool has_stamps(Stamps stamps) noexcept;
    void read_stamps() noexcept;
    Result<> fail(int error, std::string_view what, std::string_view advice = {}) noexcept;

    Interface interface_;
    int socket_ = -1;
    std::atomic<int> last_error_{0};
    bool qdisc_bypassed_ = false;
    MacAddress source_mac_{};
    std::uint64_t overruns_ = 0;
    Stamps stamps_ = Stamps::off;
    SendTimes send_times_;
};

}  // namespace margay
