// SOURCE, the argument of all programs with a master, selects the segment.
//
//     eth0            a network interface
//     eth0+eth1       two network interfaces at both ends of a ring
//     xdp:eth0        the interface by AF_XDP (oshw/xdp/xdp_nic.hpp); an error when interface, kernel or permissions
//                     refuse it, or when the program was built without libxdp and libbpf
//     try-xdp:eth0    the same; when AF_XDP is refused, a remark on standard error and AF_PACKET as with eth0
//     xdp:eth0+xdp:eth1   each end of a ring has a prefix of its own; xdp:eth0+eth1 uses AF_XDP for eth0 only
//     sim:demo        a simulated segment: a ready-made one (sim:drives), a segment description (sim:FILE.toml), or
//                     slaves in a line (sim:coupler,drive#16,drive@3s,a.bin): devices of the library and SII images;
//                     drive#16 has the alias 16, drive@3s is switched on 3 s after the program has opened the source
//     pcap:FILE       a recording; two NICs if it is a pcapng file with the frames of two interfaces, which a recording
//                     of two NICs is
//
// A simulated segment whose description has a `ring` has two NICs.
//
// Simulated segments and recordings use virtual time: they run as fast as the machine allows, and the output is the
// same every time. A recording answers only what the recorded master asked. Thus a recording can be replayed when the
// same program made it with the same arguments. A recording of another master cannot be replayed.
#pragma once

#include "osal/linux/linux_osal.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filters/trace_nic.hpp"
#include "oshw/pcap/recorder.hpp"
#include "oshw/pcap/replay.hpp"
#include "oshw/pcap/ring_recorder.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "source/hotplug_nic.hpp"
#include "source/interface_nic.hpp"
#include "source/segment_file.hpp"

#include <margay/margay.hpp>
#include <margay/receive_clock.hpp>
#include <margay/redundancy.hpp>
#include <margay/timed_send.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace margay::hosted {

struct SourceOptions {
    // File for every frame sent and received; empty: none. One NIC: pcap. Two NICs: pcapng with two interfaces.
    std::string record{};
    bool real_time = false;  // a simulated segment runs in the time of the system, for programs with several threads
    bool trace = false;      // prints a line for every datagram to standard error
    // A missing or switched-off interface is no error: see Source::look_for_interfaces().
    bool wait_for_interfaces = false;
    // The times of frames that the NICs must have; without effect with wait_for_interfaces. A simulated segment has
    // exact times, for hardware and software; a recording has none.
    WantedTimes times{};
};

// The receive times of both NICs of a ring, whose clock is the same. The copy of the first NIC comes back at the second
// NIC while the ring is whole, and at its own NIC while the ring is broken.
class ReceivedByEither final : public ReceiveClock {
  public:
    ReceivedByEither(ReceiveClock& first, ReceiveClock& second) noexcept : first_(first), second_(second) {}
    [[nodiscard]] std::optional<std::uint64_t> receive_time_ns(std::span<const std::byte> head) noexcept override {
        // An empty optional is less than any time.
        return std::max(first_.receive_time_ns(head), second_.receive_time_ns(head));
    }

  private:
    ReceiveClock& first_;
    ReceiveClock& second_;
};

// A NIC and its operating system layer, with a recorder and a trace around the NIC if the options ask for them.
class Source {
  public:
    Source();
    ~Source();
    [[nodiscard]] Nic& nic() noexcept { return *outermost_; }
    [[nodiscard]] Osal& osal() noexcept { return *osal_; }
    // The NIC at the other end of the ring; nullptr: there is one NIC.
    [[nodiscard]] Nic* second() noexcept { return second_outermost_; }
    // The argument of Osal::wait().
    [[nodiscard]] WaitHandles wait_handles() const noexcept {
        return {outermost_->wait_handle(), second_outermost_ == nullptr ? -1 : second_outermost_->wait_handle()};
    }
    // When the next frame of a simulated segment arrives.
    [[nodiscard]] Time next_arrival() const noexcept {
        const Time first = outermost_->next_arrival();
        return second_outermost_ == nullptr ? first : std::min(first, second_outermost_->next_arrival());
    }
    // The limits of a context for this source.
    [[nodiscard]] Limits limits(Limits wanted) const noexcept {
        wanted.redundancy = second_outermost_ != nullptr;
        return wanted;
    }
    // init() or init_redundant() with the NICs of this source.
    [[nodiscard]] Result<> begin(Context& ctx) {
        return second_outermost_ == nullptr ? init(ctx, *outermost_, *osal_)
                                            : init_redundant(ctx, *outermost_, *second_outermost_, *osal_);
    }

    // For SourceOptions::wait_for_interfaces: opens interfaces that have appeared, and closes interfaces that were
    // removed. In the thread that owns the context, a few system calls; for example once a second while no frame comes
    // back. Returns why an interface is not open; empty: all are.
    [[nodiscard]] std::string look_for_interfaces();

    // The times of frames that the options ask for: to be given to cycle_stamps() and send_processdata_at(). In a ring
    // the stamps are those of the copy that the first NIC sends, and frames leave by both NICs at the same time.
    [[nodiscard]] FrameTiming timing() noexcept {
        FrameTiming has = outermost_->timing();
        if (timed_pair_) has.send_at = &*timed_pair_;
        if (received_) has.received = &*received_;
        return has;
    }

    // True when time moves only while the program waits.
    [[nodiscard]] bool virtual_time() const noexcept { return !linux_osal_; }

    // Call it at the end, also after an error of the master. Closes the recording and returns a remark about the
    // source itself: the recording is not complete, or the first request that a replay had no answer for. Empty when
    // there is no remark.
    [[nodiscard]] std::string finish();
    // After finish(): true when the recording is not complete.
    [[nodiscard]] bool recording_lost() const noexcept { return recording_lost_; }
    // A remark for a user when a replay has answered more than was recorded. Empty when it has not.
    [[nodiscard]] std::string repeated_answers() const;

  private:
    friend class SourceOpener;

    // Switches on slaves of the segment that are off until a time, before a frame reaches them.
    class SwitchingNic;

    struct StandardError final : TraceSink {
        void line(std::string_view text) noexcept override;
    };

    std::optional<LinuxOsal> linux_osal_;
    std::optional<VirtualOsal> virtual_osal_;
    Osal* osal_ = nullptr;

    std::shared_ptr<Nic> interface_;
    std::vector<std::shared_ptr<HotplugNic>> hotplug_;
    std::optional<PcapReplayNic> replay_, second_replay_;
    std::unique_ptr<SimulatedSegment> simulated_;
    std::optional<SimulatedNic> simulated_nic_;
    std::unique_ptr<SwitchingNic> switching_, second_switching_;
    std::optional<PcapRecorder> recorder_;
    std::optional<PcapRingRecorder> ring_recorder_;
    StandardError standard_error_;
    std::optional<TraceNic> trace_;
    Nic* outermost_ = nullptr;
    std::shared_ptr<Nic> second_interface_;
    std::optional<SimulatedNic> second_simulated_nic_;
    std::optional<TraceNic> second_trace_;
    Nic* second_outermost_ = nullptr;
    std::optional<TimedPair> timed_pair_;
    std::optional<ReceivedByEither> received_;
    bool recording_lost_ = false;
};

// A source, or a sentence that says why the source could not be opened.
class OpenedSource {
  public:
    explicit OpenedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}
    explicit OpenedSource(std::string error) : error_(std::move(error)) {}

    [[nodiscard]] explicit operator bool() const noexcept { return source_ != nullptr; }
    [[nodiscard]] const std::string& error() const noexcept { return error_; }
    [[nodiscard]] Source* operator->() noexcept { return source_.get(); }
    [[nodiscard]] Source& operator*() noexcept { return *source_; }
    [[nodiscard]] std::unique_ptr<Source> take() noexcept { return std::move(source_); }

  private:
    std::unique_ptr<Source> source_;
    std::string error_;
};

[[nodiscard]] OpenedSource open_source(const std::string& text, const SourceOptions& options = {});

}  // namespace margay::hosted
