// Writes every frame sent and received into a file that Wireshark and PcapReplayNic read: pcap with
// nanoseconds.
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
    // Both must outlive the recorder.
    PcapRecorder(Nic& inner, Osal& clock) noexcept : FilterNic(inner), clock_(clock) {}
    ~PcapRecorder();

    // Creates the file, over one that is there. `epoch` is the wall-clock time at Time{}, as time since 1970:
    // the stamps in the file are the clock's time on top of it. With 0, two runs in virtual time give the
    // same file octet by octet.
    [[nodiscard]] Result<> open(const std::string& path, Duration epoch = {});

    // Writes out what is buffered and closes the file. An error means that the file is not complete (disk
    // full, …). Closing twice, or without open(), is no error. The destructor closes, but has nobody to tell.
    [[nodiscard]] Result<> close();

    // One sentence about what went wrong last, empty when nothing did.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    // A frame is recorded when the inner NIC has taken it. File I/O, buffered: not for a cycle that has to be
    // met.
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
