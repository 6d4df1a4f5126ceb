// A NIC connected to a simulated segment, in the time of an Osal.
#pragma once

#include "osal/osal.hpp"
#include "oshw/frame_queue.hpp"
#include "oshw/nic.hpp"
#include "sim/segment.hpp"

#include <margay/receive_clock.hpp>
#include <margay/timed_send.hpp>

#include <vector>

namespace margay {

class SimulatedNic final : public Nic, public SendClock, public ReceiveClock, public TimedSend {
  public:
    struct Options {
        // Delay of the host: both drivers and the system between them.
        Duration round_trip = std::chrono::microseconds(100);
        // Frames need 80 ns per octet and are sent one after the other.
        bool wire_time = false;
        unsigned master_port = 0;  // port of the segment that this NIC is connected to
        // Maximum number of frames in transit; further frames are "busy".
        std::size_t queue_frames = 256;
        MacAddress mac{0x00, 0x4d, 0x41, 0x52, 0x47, 0x59};
        // The clock of the NIC, and whether the NIC notes when a frame has left (SendClock) and arrived (ReceiveClock):
        // exactly when its first octet leaves and reaches the NIC, without the delay of the host.
        bool time_stamps = false;
        std::int32_t clock_drift_ppb = 0;
        std::uint64_t clock_start_ns = 0;  // the time of the clock at time 0 of the osal
        // The NIC holds frames until their time (TimedSend), at most this many; 0: it cannot. next_arrival() is never
        // later than the time of such a frame, so that a program that waits until then sends it exactly in time.
        std::size_t timed_frames = 0;
    };

    // Both arguments must outlive the NIC. The constructor allocates the queue; nothing is allocated later.
    SimulatedNic(sim::Segment& segment, Osal& osal, const Options& options);
    SimulatedNic(sim::Segment& segment, Osal& osal) : SimulatedNic(segment, osal, Options{}) {}

    // For a segment with both ends connected to the master: frames that leave at the port of the other NIC are
    // delivered there.
    void set_other_end(SimulatedNic* other) noexcept { other_ = other; }

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] LinkState link_state() noexcept override;
    [[nodiscard]] MacAddress source_mac() const noexcept override { return options_.mac; }
    [[nodiscard]] Time next_arrival() const noexcept override;
    [[nodiscard]] std::optional<std::uint64_t> send_time_ns(std::span<const std::byte> head) noexcept override {
        return send_times_.find(head);
    }
    [[nodiscard]] std::optional<std::uint64_t> receive_time_ns(std::span<const std::byte> head) noexcept override {
        return receive_times_.find(head);
    }
    void set_send_time(Time at) noexcept override { send_time_ = at; }
    [[nodiscard]] std::uint64_t missed() noexcept override { return missed_; }
    [[nodiscard]] FrameTiming timing() noexcept override;
    // The time of the clock of the NIC.
    [[nodiscard]] std::uint64_t clock_ns(Time at) const noexcept;

    [[nodiscard]] std::uint64_t frames_sent() const noexcept { return sent_; }
    [[nodiscard]] std::uint64_t frames_lost() const noexcept { return lost_; }

  private:
    static constexpr std::size_t kMaxBytes = 1518;
    struct Slot {
        Time due{};
        std::uint64_t arrived_ns = 0;  // by the clock of the NIC
        std::size_t length = 0;
        std::array<std::byte, kMaxBytes> bytes;
    };
    [[nodiscard]] bool full() const noexcept { return count_ == slots_.size(); }
    void put(Time arrived, Duration later, std::span<const std::byte> frame) noexcept;
    void transmit(std::size_t length, Time at) noexcept;
    void transmit_due(Time now) noexcept;

    sim::Segment& segment_;
    Osal& osal_;
    Options options_;
    SimulatedNic* other_ = nullptr;
    std::vector<Slot> slots_;
    std::size_t first_ = 0;
    std::size_t count_ = 0;
    Time wire_free_{};
    Time last_due_{};
    std::array<std::byte, kMaxBytes> frame_{};
    std::uint64_t sent_ = 0;
    std::uint64_t lost_ = 0;
    SendTimes send_times_;
    ArrivalTimes receive_times_;
    Time send_time_ = kAtOnce;
    std::vector<HeldFrame> held_;
    FrameQueue timed_;
    std::uint64_t missed_ = 0;
};

}  // namespace margay
