// A filter that writes each sent and received frame into a file for Wireshark and PcapReplayNic: pcap with nanosecond
// time stamps.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"

#include <margay/result.hpp>

#include <string>

struct pcap;  // pcap_t
struct pcap_dumper;

namespace margay {

class PcapRecorder final : public FilterNic {
  public:
    // Both arguments must outlive the recorder.
    PcapRecorder(Nic& inner, Osal& clock) noexcept : FilterNic(inner), clock_(clock) {}
    ~PcapRecorder();

    // Creates the file and overwrites an existing file. `epoch` is the wall-clock time at Time{}, as duration since
    // 1970; the time stamps in the file are `epoch` plus the time of the clock. With 0, two runs in virtual time create
    // identical files.
    [[nodiscard]] Result<> open(const std::string& path, Duration epoch = {});

    // Writes the buffered data and closes the file. An error means that the file is not complete (for example, disk
    // full). It is not an error to close twice or without open(). The destructor also closes the file, but cannot
    // report an error.
    [[nodiscard]] Result<> close();

    // One sentence about the last error; empty if there was none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    // A frame is recorded after the inner NIC has accepted it. Buffered file I/O: do not use it in a cycle with
    // deadlines.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;

  private:
    [[nodiscard]] Result<> fail(const std::string& what);
    void write(std::span<const std::byte> frame) noexcept;

    Osal& clock_;
    Duration epoch_{};
    pcap* pcap_ = nullptr;
    pcap_dumper* file_ = nullptr;
    std::string path_;
    std::string problem_;
};

}  // namespace margay
