// Numbers of the pcapng format: draft-ietf-opsawg-pcapng, sections 3 and 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace margay::pcapng {

// Blocks: type, length, body, and the length again.
inline constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;  // the same octets in both byte orders
inline constexpr std::uint32_t kInterface = 1;
inline constexpr std::uint32_t kObsoletePacket = 2;
inline constexpr std::uint32_t kSimplePacket = 3;
inline constexpr std::uint32_t kStatistics = 5;  // of an interface
inline constexpr std::uint32_t kEnhancedPacket = 6;
inline constexpr std::uint32_t kByteOrderMagic = 0x1A2B3C4D;

// Options: code, length, value.
inline constexpr std::uint16_t kOptionEnd = 0;
inline constexpr std::uint16_t kComment = 1;
inline constexpr std::uint16_t kFlags = 2;          // of a packet
inline constexpr std::uint16_t kInterfaceName = 2;  // of an interface
inline constexpr std::uint16_t kTimeResolution = 9;
inline constexpr std::uint16_t kTimeOffset = 14;
inline constexpr std::uint16_t kDroppedByInterface = 5;  // of statistics: packets since the recording began
inline constexpr std::uint16_t kDroppedBySystem = 7;

inline constexpr std::uint32_t kReceived = 1;  // of the flags
inline constexpr std::uint32_t kSent = 2;
inline constexpr std::uint32_t kDirectionBits = 3;
inline constexpr std::uint16_t kEthernet = 1;  // link type

// The comment at a frame that the NIC has not accepted.
inline constexpr std::string_view kRefusedText = "not accepted by the NIC";

constexpr std::size_t padded(std::size_t octets) { return (octets + 3) / 4 * 4; }

}  // namespace margay::pcapng
