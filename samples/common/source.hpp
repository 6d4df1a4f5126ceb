// SOURCE, the argument of all programs with a master: where the segment is.
//
//     eth0            a network interface
//     sim:demo        a simulated segment: a ready-made one (sim:drives), a segment description (sim:FILE.toml), or SII
//                     images in a line (sim:a.bin,b.bin)
//     pcap:FILE       a recording
//
// Simulated segments and recordings live in virtual time: they run as fast as the machine allows and give the
// same output every time. A recording answers only what the recorded master asked: one that the same program made with
// the same arguments can be replayed, one of another master cannot.
#pragma once

#include "common/segment_file.hpp"
#include "osal/linux/linux_osal.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filters/trace_nic.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "oshw/pcap/recorder.hpp"
#include "oshw/pcap/replay.hpp"
#include "oshw/simulated/simulated_nic.hpp"

#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace margay::samples {

struct SourceOptions {
    std::string record{};  // file for every frame sent and received; empty: none
    bool trace = false;    // a line for every datagram to standard error
};

// A NIC and the system that goes with it, with recorder and trace around the NIC where asked for.
class Source {
  public:
    [[nodiscard]] Nic& nic() noexcept { return *outermost_; }
    [[nodiscard]] Osal& osal() noexcept { return *osal_; }

    // Whether time moves only when somebody waits.
    [[nodiscard]] bool virtual_time() const noexcept { return !linux_osal_; }

    // To be called at the end, after an error of the master as well: closes the recording and returns what
    // there is to say about the source itself, for people: the recording is not complete; the first request
    // that a replay had no answer for. Empty when all is well.
    [[nodiscard]] std::string finish();
    // After finish(): whether the recording is not complete.
    [[nodiscard]] bool recording_lost() const noexcept { return recording_lost_; }

  private:
    friend class SourceOpener;

    struct StandardError final : TraceSink {
        void line(std::string_view text) noexcept override;
    };

    std::optional<LinuxOsal> linux_osal_;
    std::optional<VirtualOsal> virtual_osal_;
    Osal* osal_ = nullptr;

    std::optional<PacketNic> packet_;
    std::optional<PcapReplayNic> replay_;
    std::unique_ptr<SimulatedSegment> simulated_;
    std::optional<SimulatedNic> simulated_nic_;
    std::optional<PcapRecorder> recorder_;
    StandardError standard_error_;
    std::optional<TraceNic> trace_;
    Nic* outermost_ = nullptr;
    bool recording_lost_ = false;
};

// A source, or a sentence that says why there is none.
class OpenedSource {
  public:
    explicit OpenedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}
    explicit OpenedSource(std::string error) : error_(std::move(error)) {}

    [[nodiscard]] explicit operator bool() const noexcept { return source_ != nullptr; }
    [[nodiscard]] const std::string& error() const noexcept { return error_; }
    [[nodiscard]] Source* operator->() noexcept { return source_.get(); }
    [[nodiscard]] Source& operator*() noexcept { return *source_; }

  private:
    std::unique_ptr<Source> source_;
    std::string error_;
};

[[nodiscard]] OpenedSource open_source(const std::string& text, const SourceOptions& options = {});

}  // namespace margay::samples
