#include "oshw/pcap/pcapng_reader.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <string_view>

namespace margay {
namespace {

using namespace pcapng;

constexpr std::size_t kSmallestBlock = 12;
constexpr std::size_t kLargestBlock = std::size_t{16} << 20;
constexpr std::size_t kTrailer = 4;  // the length at the end of a block
constexpr std::size_t kSectionHead = 24;
constexpr std::size_t kInterfaceHead = 16;
constexpr std::size_t kPacketHead = 28;
constexpr std::size_t kSimplePacketHead = 12;
constexpr std::size_t kStatisticsHead = 20;
constexpr std::uint8_t kHighestDecimal = 19;  // 10^19 and 2^63 fit into 64 bits
constexpr std::uint8_t kHighestBinary = 63;

constexpr auto kPowers = [] {
    std::array<std::uint64_t, kHighestDecimal + 1> powers{1};
    for (std::size_t n = 1; n < powers.size(); ++n) powers[n] = powers[n - 1] * 10;
    return powers;
}();

}  // namespace

std::uint16_t PcapngReader::half(std::size_t at) const {
    const auto value = load_le<std::uint16_t>(block_, at);
    return big_endian_ ? static_cast<std::uint16_t>(value << 8 | value >> 8) : value;
}

std::uint32_t PcapngReader::word(std::size_t at) const {
    const std::uint32_t first = half(at);
    const std::uint32_t second = half(at + 2);
    return big_endian_ ? first << 16 | second : second << 16 | first;
}

std::uint64_t PcapngReader::double_word(std::size_t at) const {
    const std::uint64_t first = word(at);
    const std::uint64_t second = word(at + 4);
    return big_endian_ ? first << 32 | second : second << 32 | first;
}

bool PcapngReader::end_with(std::string problem) {
    problem_ = std::move(problem);
    return false;
}

// Reads more octets into the block. False: the file ends before they are complete.
bool PcapngReader::fill(std::size_t octets) {
    const std::size_t before = block_.size();
    block_.resize(before + octets);
    const std::size_t got = std::fread(block_.data() + before, 1, octets, file_.get());
    if (got == octets) return true;
    if (std::ferror(file_.get()) != 0) return end_with("it cannot be read any more");
    if (before + got != 0) cut_off_ = "the file ends in the middle of a block";
    return false;
}

// Reads the next block. False at the end, or if the file is damaged.
bool PcapngReader::next_block() {
    block_.clear();
    if (!fill(kSmallestBlock)) return false;
    if (load_le<std::uint32_t>(block_) == kSectionHeader && !begin_section()) return false;
    const std::size_t length = word(4);
    if (length < kSmallestBlock || length > kLargestBlock || length % 4 != 0)
        return end_with("a block of " + std::to_string(length) + " octets");
    if (!fill(length - kSmallestBlock)) return false;
    if (word(length - kTrailer) != length) return end_with("the two lengths of a block differ");
    return true;
}

// Begins a section. The first octets of its header were read.
bool PcapngReader::begin_section() {
    constexpr std::uint32_t kSwapped = 0x4D3C2B1A;
    const auto magic = load_le<std::uint32_t>(block_, 8);
    if (magic != kByteOrderMagic && magic != kSwapped) return end_with("a section without byte order");
    big_endian_ = magic == kSwapped;
    ++section_;
    interfaces_.clear();
    ethernet_interfaces_ = 0;
    return true;
}

// Calls take(code, place, length) for each option of the block.
template <class Take>
void PcapngReader::options(std::size_t at, Take take) const {
    const std::size_t end = block_.size() - kTrailer;
    while (at + 4 <= end && half(at) != kOptionEnd) {
        const std::size_t length = half(at + 2);
        if (at + 4 + padded(length) > end) break;
        take(half(at), at + 4, length);
        at += 4 + padded(length);
    }
}

bool PcapngReader::take_interface() {
    const auto number = static_cast<std::uint32_t>(interfaces_.size());
    if (block_.size() < kInterfaceHead + kTrailer) return end_with("an interface without its link type");
    if (number == kMostInterfaces) return end_with("more than " + std::to_string(kMostInterfaces) + " interfaces");
    const std::uint16_t link_type = half(8);
    Interface interface { .ethernet = link_type == kEthernet, .most_octets = word(12) };
    std::string name;
    options(kInterfaceHead, [&](std::uint16_t code, std::size_t at, std::size_t length) {
        if (code == kInterfaceName) name.assign(reinterpret_cast<const char*>(block_.data()) + at, length);
        if (code == kTimeOffset && length == 8) interface.offset = double_word(at);
        if (code != kTimeResolution || length != 1) return;
        const auto resolution = std::to_integer<std::uint8_t>(block_[at]);
        interface.binary = (resolution & 0x80) != 0;
        interface.exponent = resolution & 0x7F;
    });
    interface.timed = interface.exponent <= (interface.binary ? kHighestBinary : kHighestDecimal);
    if (interface.ethernet) {
        if (!interface.timed)
            return end_with("interface " + std::to_string(number) + " counts time in units of " +
                            (interface.binary ? "2^-" : "10^-") + std::to_string(interface.exponent) + " s");
        interface.place = ethernet_interfaces_++;
        if (interface.place == numbers_.size()) numbers_.push_back(number);
    } else {
        interface.place = leave_out(number, link_type, std::move(name));
    }
    interfaces_.push_back(interface);
    return true;
}

std::uint32_t PcapngReader::leave_out(std::uint32_t number, std::uint16_t link_type, std::string name) {
    const auto at = std::ranges::find_if(left_out_, [&](const LeftOutInterface& known) {
        return known.number == number && known.link_type == link_type && known.name == name;
    });
    const auto place = static_cast<std::size_t>(at - left_out_.begin());
    if (place < left_out_.size() || place == kMostLeftOut)
        return static_cast<std::uint32_t>(std::min(place, kMostLeftOut - 1));
    left_out_.push_back({.number = number, .name = std::move(name), .link_type = link_type});
    return static_cast<std::uint32_t>(place);
}

// Finds the interface of the packet.
bool PcapngReader::find_interface(std::uint32_t number, PcapngPacket& packet) {
    if (number >= interfaces_.size())
        return end_with("a packet of interface " + std::to_string(number) + ", which the file does not describe");
    const auto& interface = interfaces_[number];
    packet.ethernet = interface.ethernet;
    if (packet.ethernet)
        packet.origin.interface = interface.place;
    else
        ++left_out_[interface.place].packets;
    return true;
}

void PcapngReader::take_time(const Interface& interface, std::uint64_t units, PcapngPacket& packet) const {
    constexpr unsigned kNano = 9;
    const unsigned exponent = interface.exponent;
    packet.timed = interface.timed;
    if (!packet.timed) return;
    if (interface.binary) {
        constexpr unsigned kBits = 34;  // times 10^9 fit into 64 bits
        const std::uint64_t rest = units & ((std::uint64_t{1} << exponent) - 1);
        const unsigned bits = std::min(exponent, kBits);
        packet.seconds = units >> exponent;
        packet.nanoseconds = static_cast<std::int64_t>((rest >> (exponent - bits)) * kPowers[kNano] >> bits);
    } else {
        const std::uint64_t rest = units % kPowers[exponent];
        packet.seconds = units / kPowers[exponent];
        packet.nanoseconds = static_cast<std::int64_t>(exponent <= kNano ? rest * kPowers[kNano - exponent]
                                                                         : rest / kPowers[exponent - kNano]);
    }
    packet.seconds += interface.offset;
}

// Reads the direction from the options that begin at `at`.
void PcapngReader::take_flags(std::size_t at, PacketOrigin& origin) const {
    using Direction = PacketOrigin::Direction;
    options(at, [&](std::uint16_t code, std::size_t value, std::size_t length) {
        if (code == kFlags && length == 4 && origin.direction != Direction::refused) {
            const std::uint32_t direction = word(value) & kDirectionBits;
            if (direction == kReceived) origin.direction = Direction::received;
            if (direction == kSent) origin.direction = Direction::sent;
        }
        if (code == kComment && length == kRefusedText.size() &&
            std::memcmp(block_.data() + value, kRefusedText.data(), length) == 0)
            origin.direction = Direction::refused;
    });
}

// Reads an enhanced packet or an obsolete packet. They differ in the number of the interface.
std::optional<PcapngPacket> PcapngReader::packet() {
    PcapngPacket packet;
    if (block_.size() < kPacketHead + kTrailer) {
        problem_ = "a packet without its length";
        return std::nullopt;
    }
    const std::uint32_t number = word(0) == kObsoletePacket ? half(8) : word(8);
    const std::size_t size = word(20);
    if (size > block_.size() - kPacketHead - kTrailer) {
        problem_ = "a packet of " + std::to_string(size) + " octets, which is longer than its block";
        return std::nullopt;
    }
    if (!find_interface(number, packet)) return std::nullopt;
    packet.bytes = Bytes(block_).subspan(kPacketHead, size);
    packet.length_on_wire = word(24);
    take_time(interfaces_[number], std::uint64_t{word(12)} << 32 | word(16), packet);
    take_flags(kPacketHead + padded(size), packet.origin);
    return packet;
}

// Reads a simple packet. It belongs to the first interface, which contains the limit of recorded octets.
std::optional<PcapngPacket> PcapngReader::simple_packet() {
    PcapngPacket packet;
    if (block_.size() < kSimplePacketHead + kTrailer) {
        problem_ = "a packet without its length";
        return std::nullopt;
    }
    if (!find_interface(0, packet)) return std::nullopt;
    packet.length_on_wire = word(8);
    std::size_t size = packet.length_on_wire;
    if (const std::size_t most = interfaces_[0].most_octets; most != 0) size = std::min(size, most);
    if (size > block_.size() - kSimplePacketHead - kTrailer) {
        problem_ = "a packet of " + std::to_string(size) + " octets, which is longer than its block";
        return std::nullopt;
    }
    packet.bytes = Bytes(block_).subspan(kSimplePacketHead, size);
    return packet;
}

// Only the last block of an interface is used, because each block counts from the beginning of the recording.
void PcapngReader::note_dropped() {
    std::uint64_t all = 0;
    const std::uint32_t number = word(8);
    if (number >= interfaces_.size() || !interfaces_[number].ethernet) return;
    options(kStatisticsHead, [&](std::uint16_t code, std::size_t at, std::size_t length) {
        if (length == 8 && (code == kDroppedByInterface || code == kDroppedBySystem)) all += double_word(at);
    });
    constexpr std::size_t kMostCounters = 4096;
    const std::pair interface(section_, number);
    if (dropped_.size() < kMostCounters || dropped_.contains(interface)) dropped_[interface] = all;
}

std::optional<PcapngPacket> PcapngReader::next() {
    while (problem_.empty() && cut_off_.empty() && next_block()) {
        const std::uint32_t type = word(0);
        if (type == kEnhancedPacket || type == kObsoletePacket) return packet();
        if (type == kSimplePacket) return simple_packet();
        if (type == kStatistics && block_.size() >= kStatisticsHead + kTrailer) note_dropped();
        if (type == kInterface && !take_interface()) break;
        if (type == kSectionHeader && (block_.size() < kSectionHead + kTrailer || half(12) != 1)) {
            problem_ = "a section of an unknown version";
            break;
        }
    }
    return std::nullopt;
}

std::uint64_t PcapngReader::dropped() const {
    std::uint64_t sum = 0;
    for (const auto& [interface, count] : dropped_) sum += count;
    return sum;
}

}  // namespace margay
