// A network interface of Linux, accessed by an AF_XDP socket: one system call per sent frame, none to receive. A filter
// program in the driver takes the EtherCAT frames of one receive queue; all other frames continue to the system. This
// NIC has none of the abilities for the times of frames (Nic::timing()); PacketNic has them.
//
// One thread at a time calls receive(). Several threads may call send(), link_state() and last_error() at the same
// time.
#pragma once

#include "oshw/linux/interface.hpp"
#include "oshw/nic.hpp"

#include <margay/result.hpp>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string_view>

namespace margay {

class XdpNic final : public Nic {
  public:
    // The way of the frames from the driver to the program.
    enum class Mode : std::uint8_t {
        automatic,  // the first of the following that driver and kernel accept
        zero_copy,  // the hardware writes into the memory of the program
        copy,       // the driver executes the filter program, the kernel copies
        generic,    // the kernel executes the filter program after the driver; for drivers without XDP
    };
    struct Settings {
        Mode mode = Mode::automatic;
        std::uint32_t queue = 0;  // receive queue; most drivers deliver EtherCAT frames to queue 0
    };

    XdpNic() noexcept;
    ~XdpNic();
    XdpNic(const XdpNic&) = delete;
    XdpNic& operator=(const XdpNic&) = delete;

    // Opens the interface. On failure, problem() describes the refusal of the driver or the kernel, and the remedy;
    // `actual` of the error is errno. An unplugged cable is not an error, see link_state(). Needs CAP_NET_RAW,
    // CAP_NET_ADMIN and CAP_BPF. The kernel removes the filter program when the NIC is closed, and also when the
    // program ends in another way. The kernel frees an interface some milliseconds after its program has ended: open()
    // waits up to one second for an interface that is in use. While the NIC is open, packet sniffers do not see the
    // frames that it receives. Allocates memory. Not callable from the cycle.
    [[nodiscard]] Result<> open(std::string_view interface, const Settings& settings) noexcept;
    [[nodiscard]] Result<> open(std::string_view interface) noexcept { return open(interface, Settings{}); }
    void close() noexcept;

    // One sentence about the last failed open(); empty after success. Valid until the next open().
    [[nodiscard]] std::string_view problem() const noexcept { return interface_.problem(); }

    // After open(): the mode that was accepted.
    [[nodiscard]] Mode mode() const noexcept;
    // Number of received frames since open() that the kernel dropped because the program did not read them in time. One
    // system call.
    [[nodiscard]] std::uint64_t overruns() const noexcept;

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    // The tag of a frame in a VLAN is removed.
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    // One system call; do not call it in every cycle.
    [[nodiscard]] LinkState link_state() noexcept override { return interface_.link_state(); }
    // The filter program processes only received frames.
    [[nodiscard]] bool hides_own_frames() const noexcept override { return true; }
    // The address of the interface with bits 0 (group) and 1 (mark of the first ESC) of the first octet cleared.
    [[nodiscard]] MacAddress source_mac() const noexcept override { return source_mac_; }
    [[nodiscard]] int wait_handle() const noexcept override;
    [[nodiscard]] int last_error() const noexcept override { return last_error_.load(std::memory_order_relaxed); }

  private:
    struct Rings;
    [[nodiscard]] Result<> set_up(const Settings& settings) noexcept;
    Result<> fail(int error, std::string_view what, std::string_view advice = {}) noexcept;
    [[nodiscard]] SendStatus kick(std::uint64_t chunk) noexcept;

    Interface interface_;
    std::unique_ptr<Rings> rings_;
    MacAddress source_mac_{};
    std::atomic<int> last_error_{0};
};

[[nodiscard]] std::string_view to_text(XdpNic::Mode mode);

}  // namespace margay
