// Reads the Ethernet packets of a recording one after the other: pcap or pcapng, with microseconds or nanoseconds. The
// memory does not depend on the size of the file.
#pragma once

#include "oshw/pcap/pcapng_reader.hpp"
#include "util/bytes.hpp"

#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

struct pcap;

namespace margay {

struct CapturedPacket {
    Duration at{};             // time since the first packet of the file
    std::uint64_t number = 0;  // in the file, from 1, as in Wireshark
    Bytes bytes{};             // valid until the next call of next()
    std::size_t length_on_wire = 0;
    PacketOrigin origin{};  // of pcapng files
};

class PacketReader {
  public:
    PacketReader() noexcept;
    ~PacketReader();
    PacketReader(const PacketReader&) = delete;
    PacketReader& operator=(const PacketReader&) = delete;

    // Refuses files that are not recordings; problem() has the reason. `path` "-" is the standard input. Allocates
    // memory.
    [[nodiscard]] Result<> open(const std::string& path);
    // The next packet; nullopt at the end, or if problem() or cut_off() has a reason why there are no more packets.
    // Packets of interfaces that are not Ethernet are left out, and a file without an Ethernet interface has a problem.
    [[nodiscard]] std::optional<CapturedPacket> next();

    // The fault of the file, without its name; empty: there is none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
    // The reason if the file ends in the middle of a packet, for example after a full disk; empty: it does not.
    [[nodiscard]] const std::string& cut_off() const noexcept { return cut_off_; }
    // Number of packets so far, including the packets that are left out.
    [[nodiscard]] std::uint64_t packets() const noexcept { return number_; }
    // The number of these packets without a time in the file. They have the time of the previous packet.
    [[nodiscard]] std::uint64_t untimed() const noexcept { return untimed_; }

    // For a pcapng file, as far as it was read: a part of a sentence about the interfaces that are left out, because
    // they are not Ethernet; empty: none.
    [[nodiscard]] std::string left_out() const;
    // Packets that the recorder has dropped.
    [[nodiscard]] std::uint64_t dropped() const { return blocks_ ? blocks_->dropped() : 0; }
    // The numbers in the file of its interfaces, by PacketOrigin::interface.
    [[nodiscard]] std::vector<std::uint32_t> interfaces() const {
        return blocks_ ? blocks_->numbers() : std::vector<std::uint32_t>();
    }

  private:
    struct Closer {
        void operator()(pcap* file) const;
    };
    [[nodiscard]] Result<> fail(std::string what);
    [[nodiscard]] Result<> open_pcap(PcapngReader::File from);
    [[nodiscard]] std::optional<CapturedPacket> next_of_pcap();
    [[nodiscard]] std::optional<CapturedPacket> next_of_pcapng();
    // The time since the first packet; nullopt: it is years away, which problem() reports.
    [[nodiscard]] std::optional<Duration> time_of(std::uint64_t seconds, std::int64_t nanoseconds, bool is_ethernet);
    void end(const std::string& why, bool is_cut_off);

    std::unique_ptr<pcap, Closer> file_;    // of a pcap file
    std::optional<PcapngReader> blocks_{};  // of a pcapng file
    bool at_end_ = true;
    std::string problem_;
    std::string cut_off_;
    std::uint64_t number_ = 0;
    std::uint64_t untimed_ = 0;
    struct Time {
        std::uint64_t seconds = 0;
        std::int64_t nanoseconds = 0;
    };
    std::optional<Time> first_{};
    bool first_is_left_out_ = false;  // no Ethernet packet was timed so far
    Duration last_{};
};

}  // namespace margay
