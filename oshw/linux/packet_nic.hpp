// A network interface of Linux, accessed by an AF_PACKET socket: one system call per sent frame and one per received
// frame. After open(), several threads may call send(), receive(), link_state() and last_error() at the same time.
//
// ThreadSanitizer may report a race between send() in one thread and the thread that uses the reply: the octets go
// through the kernel, which orders both, and ThreadSanitizer does not see that.
#pragma once

#include "oshw/linux/interface.hpp"
#include "oshw/linux/timed_socket.hpp"
#include "oshw/nic.hpp"

#include <margay/receive_clock.hpp>
#include <margay/result.hpp>
#include <margay/timed_send.hpp>

#include <atomic>
#include <string_view>

namespace margay {

class PacketNic final : public Nic, public SendClock, public ReceiveClock, public TimedSend {
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

    // Where the time of a frame is taken.
    enum class Stamps : std::uint8_t {
        off,
        // By the driver just before a frame goes to the hardware, and by the kernel when it gets a frame from the
        // driver; in the time of CLOCK_REALTIME.
        software,
        // By the hardware, in the time of its own clock (/dev/ptpN). The first program switches the hardware on, for
        // which it needs CAP_NET_ADMIN.
        hardware,
    };
    enum class Stamped : std::uint8_t { sent, received, both };  // the frames that get a time
    // Notes when frames are sent and received (SO_TIMESTAMPING), for LinkLayerClock and cycle_stamps(). Each sent frame
    // then costs one more system call. Call it after open(); open() switches it off, and a failure leaves it off. On
    // failure, problem() has the cause: most often the driver of the interface has no time stamps of this kind
    // (`ethtool -T` and `nic_check` list them). The kernel switches the software times of received frames on a few ms
    // later; earlier frames have no time. While time stamps are on, one thread calls receive(), send_time_ns() and
    // receive_time_ns(). Not callable from the cycle.
    [[nodiscard]] Result<> stamp_frames(Stamps stamps, Stamped which = Stamped::sent) noexcept;
    // Send times of the last frames; see SendClock. Reads the times that the kernel has ready.
    [[nodiscard]] std::optional<std::uint64_t> send_time_ns(std::span<const std::byte> head) noexcept override;
    [[nodiscard]] std::optional<std::uint64_t> receive_time_ns(std::span<const std::byte> head) noexcept override;

    // Lets frames leave at a time (SO_TXTIME, see TimedSend). The queueing discipline of the interface must hold them:
    // etf, which hands them to a NIC that knows the time (offload) or sends them by a timer of the kernel; fq, by a
    // timer; or mqprio or taprio with etf for the queue of the frames. Frames without a time bypass it as before. The
    // clock of a NIC with offload must follow CLOCK_TAI (phc2sys). `priority`: the priority (SO_PRIORITY) of the frames
    // with a time, by which mqprio and taprio select the queue; 1 to 6, more needs CAP_NET_ADMIN. Call it after open(),
    // in its network namespace; open() and close() end it. etf needs CAP_NET_ADMIN. On failure, problem() contains the
    // refusal of the queueing discipline or of the kernel, and the command that helps. Frames with a time cost two
    // system calls. Then one thread calls send(), receive() and missed(), because each of them reads reports of the
    // kernel. Not callable from the cycle.
    [[nodiscard]] Result<> allow_send_at(unsigned priority = 3) noexcept;
    void set_send_time(Time at) noexcept override { send_time_ = at; }
    // One system call while send times are allowed.
    [[nodiscard]] std::uint64_t missed() noexcept override;

    [[nodiscard]] FrameTiming timing() noexcept override;

    // Whether frames bypass the queueing discipline on the way to the driver; some kernels refuse this. Packet sniffers
    // on the same interface then see only received frames: use a PcapRecorder for recordings.
    [[nodiscard]] bool qdisc_bypassed() const noexcept { return qdisc_bypassed_; }

    // Number of received frames since open() that the kernel dropped because the program did not read them in time. One
    // system call.
    [[nodiscard]] std::uint64_t overruns() noexcept;

    // The first frame after the cable was unplugged costs a second system call, which waits while another program
    // changes an interface.
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
    [[nodiscard]] bool has_stamps(unsigned wanted) noexcept;
    [[nodiscard]] Result<> switch_hardware_on(bool sent, bool received) noexcept;
    void forget_stamps() noexcept;
    void read_stamps() noexcept;
    void read_reports(int socket) noexcept;
    [[nodiscard]] bool read_report(int socket) noexcept;
    [[nodiscard]] std::ptrdiff_t receive_stamped(std::span<std::byte> into) noexcept;
    [[nodiscard]] SendStatus send_timed(std::span<const std::byte> frame) noexcept;
    [[nodiscard]] SendStatus not_sent(int error) noexcept;
    Result<> fail(int error, std::string_view what, std::string_view advice = {}) noexcept;

    Interface interface_;
    int socket_ = -1;
    std::atomic<int> last_error_{0};
    bool qdisc_bypassed_ = false;
    MacAddress source_mac_{};
    std::uint64_t overruns_ = 0;
    Stamps stamps_ = Stamps::off;
    bool stamps_sent_ = false;
    std::atomic<std::uint32_t> frames_{0};  // given to send() while stamps_sent_ is true
    bool stamps_received_ = false;
    SendTimes send_times_;
    ArrivalTimes receive_times_;
    Time send_time_ = kAtOnce;
    TimedSocket timed_;
    std::uint64_t timed_frames_ = 0;
    std::uint64_t too_late_ = 0;
};

}  // namespace margay
