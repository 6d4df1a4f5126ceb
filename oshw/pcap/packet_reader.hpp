// Reads the packets of a recording one after the other: pcap or pcapng, with microseconds or nanoseconds. The memory
// does not depend on the size of the file.
#pragma once

#include "util/bytes.hpp"

#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

struct pcap;

namespace margay {

struct CapturedPacket {
    Duration at{};             // time since the first packet of the file
    std::uint64_t number = 0;  // in the file, from 1, as in Wireshark
    Bytes bytes{};             // valid until the next call of next()
    std::size_t length_on_wire = 0;
};

class PacketReader {
  public:
    PacketReader() noexcept;
    ~PacketReader();
    PacketReader(const PacketReader&) = delete;
    PacketReader& operator=(const PacketReader&) = delete;

    // Refuses files that are not recordings of Ethernet; problem() says why. Allocates memory.
    [[nodiscard]] Result<> open(const std::string& path);
    // The next packet; nullopt at the end, and where problem() or cut_off() say why there are no more packets.
    [[nodiscard]] std::optional<CapturedPacket> next();

    // What is wrong with the file, without its name; empty: nothing.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
    // Why the file ends in the middle of a packet, for example after a full disk; empty: it does not.
    [[nodiscard]] const std::string& cut_off() const noexcept { return cut_off_; }
    // Number of packets so far.
    [[nodiscard]] std::uint64_t packets() const noexcept { return number_; }

  private:
    struct Closer {
        void operator()(pcap* file) const;
    };
    [[nodiscard]] Result<> fail(std::string what);

    std::unique_ptr<pcap, Closer> file_;
    std::string problem_;
    std::string cut_off_;
    std::uint64_t number_ = 0;
    std::int64_t first_seconds_ = 0;
    std::int64_t first_nanoseconds_ = 0;
};

}  // namespace margay
