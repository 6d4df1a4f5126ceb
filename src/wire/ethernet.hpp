// The Ethernet II header and the EtherCAT frame header that follows it (ETG.1000.4, "Frame structure").
#pragma once

#include "util/bytes.hpp"

#include <cstddef>
#include <cstdint>

namespace margay::wire {

inline constexpr std::uint16_t kEtherTypeEtherCat = 0x88A4;  // big-endian on the wire
inline constexpr std::size_t kEthernetHeaderBytes = 14;
inline constexpr std::size_t kFrameHeaderBytes = 2;
inline constexpr std::size_t kFramePrefixBytes = kEthernetHeaderBytes + kFrameHeaderBytes;
inline constexpr std::size_t kMaxFrameBytes = 1514;  // without FCS, without VLAN tag
// Without FCS; NICs pad shorter frames.
inline constexpr std::size_t kMinFrameBytes = 60;
inline constexpr std::size_t kMaxDatagramsBytes = kMaxFrameBytes - kFramePrefixBytes;  // 1498
inline constexpr std::size_t kBusOverheadBytes = 24;  // preamble 7, SFD 1, FCS 4, inter-frame gap 12
inline constexpr std::size_t kSourceMacOffset = 6;
inline constexpr std::byte kPassedEscBit{0x02};  // set in the first source octet by the first ESC

// EtherCAT frame header: 11 bits length of all datagrams, 1 bit reserved, 4 bits type.
inline constexpr std::uint8_t kFrameTypeDatagrams = 1;

struct FrameHeader {
    std::uint16_t length = 0;  // octets of all datagrams
    std::uint8_t type = kFrameTypeDatagrams;
};

[[nodiscard]] constexpr FrameHeader load_frame_header(Bytes at) {
    const auto word = load_le<std::uint16_t>(at);
    return {static_cast<std::uint16_t>(word & 0x07FF), static_cast<std::uint8_t>(word >> 12)};
}

constexpr void store_frame_header(MutableBytes at, FrameHeader header) {
    store_le<std::uint16_t>(at, 0, static_cast<std::uint16_t>((header.length & 0x07FF) | (header.type << 12)));
}

[[nodiscard]] constexpr std::uint16_t load_ether_type(Bytes frame) {
    return static_cast<std::uint16_t>((std::to_integer<unsigned>(frame[12]) << 8) |
                                      std::to_integer<unsigned>(frame[13]));
}

// Octets that a frame occupies on a 100 Mbit/s wire, including padding, preamble, FCS and inter-frame gap. Multiplied
// by 80 ns, this is the time on the wire.
[[nodiscard]] constexpr std::size_t bytes_on_the_wire(std::size_t frame_bytes) {
    return (frame_bytes < kMinFrameBytes ? kMinFrameBytes : frame_bytes) + kBusOverheadBytes;
}

}  // namespace margay::wire
