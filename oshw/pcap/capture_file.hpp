// Reads all EtherCAT frames of a recording: pcap or pcapng, with microseconds or nanoseconds.
#pragma once

#include "oshw/pcap/packet_reader.hpp"
#include "oshw/pcap/pcapng.hpp"
#include "util/bytes.hpp"

#include <margay/mac_address.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace margay {

struct CapturedFrame {
    Duration at{};             // time since the first packet of the file
    bool reply = false;        // bit 1 of the first octet of the source address is set: the frame has passed a slave
    std::uint64_t number = 0;  // number of the packet in the file, from 1, as in Wireshark
    std::size_t offset = 0;
    std::size_t length = 0;
    PacketOrigin origin{};  // only in pcapng files
};

class CaptureFile {
  public:
    // How load() treats a file that ends in the middle of a packet, for example after a full disk or a killed recorder.
    enum class CutOff : std::uint8_t { refuse, accept };

    // Reads the file. problem() describes the reason and the place of an error. These files are refused: files that are
    // not recordings or end in the middle of a packet, files without an Ethernet interface, EtherCAT frames in VLAN
    // tags, packets that were cut by the recorder, and files without any EtherCAT frame. Packets that are not EtherCAT
    // are skipped; remark() names interfaces that are left out because they are not Ethernet. Allocates memory. With
    // CutOff::accept, the complete packets of a file that ends in the middle of a packet are read, and remark() reports
    // this.
    [[nodiscard]] Result<> load(const std::string& path, CutOff cut_off = CutOff::refuse);

    // One sentence about the last load() if it failed, otherwise empty.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    // One sentence about the incomplete end and the left out interfaces found by the last load(); empty: neither.
    [[nodiscard]] const std::string& remark() const noexcept { return remark_; }

    [[nodiscard]] const std::vector<CapturedFrame>& frames() const noexcept { return frames_; }
    // Valid until the next load().
    [[nodiscard]] Bytes bytes(const CapturedFrame& frame) const noexcept {
        return Bytes(bytes_).subspan(frame.offset, frame.length);
    }
    // Whether the file has the frames of both NICs of a ring, for example from PcapRingRecorder: EtherCAT frames of
    // exactly two interfaces, which send with different source addresses. `macs`: these addresses, of interface 0
    // first, without the mark of the first slave.
    [[nodiscard]] bool is_of_ring(std::array<MacAddress, 2>& macs) const noexcept;
    // Number of skipped packets.
    [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

  private:
    [[nodiscard]] Result<> fail(const std::string& path, const std::string& what);
    // Returns an empty string when the packet was read or skipped, otherwise the error.
    [[nodiscard]] std::string add(const CapturedPacket& captured);

    std::string problem_;
    std::string remark_;
    std::vector<CapturedFrame> frames_;
    std::vector<std::byte> bytes_;
    std::uint64_t skipped_ = 0;
};

}  // namespace margay
