// Reads pcapng files with interfaces of any link types, in sections of any byte order.
#pragma once

#include "oshw/pcap/pcapng.hpp"
#include "oshw/pcap/pcapng_format.hpp"
#include "util/bytes.hpp"

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace margay {

// An interface of a file that is no Ethernet interface.
struct LeftOutInterface {
    std::uint32_t number = 0;  // in its section of the file, from 0, as in Wireshark
    std::string name{};        // empty: the file does not contain it
    std::uint16_t link_type = 0;
    std::uint64_t packets = 0;
};

struct PcapngPacket {
    PacketOrigin origin{};
    bool ethernet = false;  // otherwise the interface is left out
    bool timed = false;     // the file says the time
    std::uint64_t seconds = 0;
    std::int64_t nanoseconds = 0;
    Bytes bytes{};  // valid until the next call of next()
    std::size_t length_on_wire = 0;
};

class PcapngReader {
  public:
    using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;
    explicit PcapngReader(File file) : file_(std::move(file)) {}

    // The next packet of any interface; nullopt at the end, or if problem() or cut_off() has a reason why there are no
    // more packets. Allocates memory.
    [[nodiscard]] std::optional<PcapngPacket> next();
    // problem(): the violation of the format. cut_off(): the place at which the file ends in the middle of a block.
    // Empty: none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
    [[nodiscard]] const std::string& cut_off() const noexcept { return cut_off_; }

    // Packets that the recorder has dropped, by the numbers in the file.
    [[nodiscard]] std::uint64_t dropped() const;
    // An interface that occurs in several sections is listed once.
    [[nodiscard]] const std::vector<LeftOutInterface>& left_out() const noexcept { return left_out_; }
    // The numbers in the file of the Ethernet interfaces, by PacketOrigin::interface.
    [[nodiscard]] const std::vector<std::uint32_t>& numbers() const noexcept { return numbers_; }

    static constexpr std::size_t kMostInterfaces = 65'536;  // of a section
    static constexpr std::size_t kMostLeftOut = 64;         // more interfaces are counted with the last one

  private:
    struct Interface {
        bool ethernet = false;
        std::uint32_t place = 0;  // PacketOrigin::interface, or a place in left_out_
        std::uint32_t most_octets = 0;
        bool timed = false;
        bool binary = false;  // a unit of time is 2^-exponent s, otherwise 10^-exponent s
        std::uint8_t exponent = 6;
        std::uint64_t offset = 0;  // seconds; modulo 2^64
    };

    [[nodiscard]] std::uint32_t word(std::size_t at) const;
    [[nodiscard]] std::uint16_t half(std::size_t at) const;
    [[nodiscard]] std::uint64_t double_word(std::size_t at) const;
    [[nodiscard]] bool fill(std::size_t octets);
    [[nodiscard]] bool next_block();
    [[nodiscard]] bool begin_section();
    [[nodiscard]] bool end_with(std::string problem);
    template <class Take>
    void options(std::size_t at, Take take) const;
    [[nodiscard]] bool take_interface();
    [[nodiscard]] std::uint32_t leave_out(std::uint32_t number, std::uint16_t link_type, std::string name);
    [[nodiscard]] std::optional<PcapngPacket> packet();
    [[nodiscard]] std::optional<PcapngPacket> simple_packet();
    [[nodiscard]] bool find_interface(std::uint32_t number, PcapngPacket& packet);
    void take_time(const Interface& interface, std::uint64_t units, PcapngPacket& packet) const;
    void take_flags(std::size_t at, PacketOrigin& origin) const;
    void note_dropped();

    File file_;
    std::string problem_;
    std::string cut_off_;
    bool big_endian_ = false;
    std::uint64_t section_ = 0;
    std::uint32_t ethernet_interfaces_ = 0;  // of the section
    std::vector<Interface> interfaces_;
    std::vector<std::uint32_t> numbers_;  // in the file, by PacketOrigin::interface
    std::vector<LeftOutInterface> left_out_;
    std::map<std::pair<std::uint64_t, std::uint32_t>, std::uint64_t> dropped_;
    std::vector<std::byte> block_;
};

}  // namespace margay
