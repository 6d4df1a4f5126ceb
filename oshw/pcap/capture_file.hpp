// The EtherCAT frames of a recording: pcap or pcapng, micro- or nanoseconds, read as a whole.
#pragma once

#include "util/bytes.hpp"

#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace margay {

struct CapturedFrame {
    Duration at{};             // since the first packet of the file
    bool reply = false;        // bit 1 of the first octet of the source address: it has passed a slave
    std::uint64_t number = 0;  // of the packet in the file, from 1, as Wireshark counts
    std::size_t offset = 0;
    std::size_t length = 0;
};

class CaptureFile {
  public:
    // What is done with a file that ends in the middle of a packet, as after a full disk or a killed recorder.
    enum class CutOff : std::uint8_t { refuse, accept };

    // Reads the file. Refused, with problem() saying why and where: what is no recording or ends in the
    // middle of a packet, link types other than Ethernet, EtherCAT in VLAN tags, packets that were recorded
    // cut, and files without any EtherCAT frame. Packets that are not EtherCAT are passed over. Allocates.
    // With CutOff::accept, the whole packets of a file that ends in the middle of one are taken, and remark() says so.
    [[nodiscard]] Result<> load(const std::string& path, CutOff cut_off = CutOff::refuse);

    // One sentence about the last load() that failed, empty when it went well.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    // One sentence about the end that was cut off in the last load(), empty where the file is whole.
    [[nodiscard]] const std::string& remark() const noexcept { return remark_; }

    [[nodiscard]] const std::vector<CapturedFrame>& frames() const noexcept { return frames_; }
    // Valid until the next load().
    [[nodiscard]] Bytes bytes(const CapturedFrame& frame) const noexcept {
        return Bytes(bytes_).subspan(frame.offset, frame.length);
    }
    // Packets passed over.
    [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

  private:
    [[nodiscard]] Result<> fail(const std::string& path, const std::string& what);
    // Empty when the packet was taken or passed over, else what is wrong with it.
    [[nodiscard]] std::string add(Duration at, std::uint64_t number, Bytes packet, std::size_t length_on_wire);

    std::string problem_;
    std::string remark_;
    std::vector<CapturedFrame> frames_;
    std::vector<std::byte> bytes_;
    std::uint64_t skipped_ = 0;
};

}  // namespace margay
