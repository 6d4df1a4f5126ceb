#include "analyse/ethercat_frame.hpp"

#include "wire/datagram.hpp"
#include "wire/ethernet.hpp"

#include <algorithm>

namespace margay::analyse {
namespace {

constexpr std::size_t kAddressBytes = 12;
constexpr std::size_t kTagBytes = 4;
constexpr std::size_t kIpBytes = 20;  // without options
constexpr std::size_t kUdpBytes = 8;
constexpr std::uint16_t kEtherTypeIp = 0x0800;
constexpr std::uint8_t kProtocolUdp = 17;

bool is_tag(std::uint16_t type) { return type == 0x8100 || type == 0x88A8 || type == 0x9100; }

std::uint16_t load_be(Bytes from, std::size_t at) {
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(from[at]) << 8 |
                                      std::to_integer<unsigned>(from[at + 1]));
}

// The payload of a UDP packet to port 0x88A4; empty: it is another packet.
Bytes udp_payload(Bytes ip) {
    if (ip.size() < kIpBytes || std::to_integer<unsigned>(ip[0]) >> 4 != 4) return {};
    const std::size_t header = (std::to_integer<std::size_t>(ip[0]) & 15) * 4;
    const std::size_t length = load_be(ip, 2);
    const bool fragment = (load_be(ip, 6) & 0x3FFF) != 0;
    if (header < kIpBytes || fragment || std::to_integer<std::uint8_t>(ip[9]) != kProtocolUdp) return {};
    if (length < header + kUdpBytes || ip.size() < header + kUdpBytes) return {};
    const auto udp = ip.subspan(header, std::min(length, ip.size()) - header);
    if (load_be(udp, 2) != wire::kEtherTypeEtherCat && load_be(udp, 0) != wire::kEtherTypeEtherCat) return {};
    return udp.subspan(kUdpBytes);
}

}  // namespace

std::optional<EthercatFrame> FrameFinder::find(Bytes packet) {
    if (packet.size() < wire::kFramePrefixBytes) return std::nullopt;
    EthercatFrame frame{.bytes = packet};
    std::size_t at = kAddressBytes;
    while (is_tag(load_be(packet, at))) {
        frame.vlan = true;
        at += kTagBytes;
        if (at + 2 > packet.size()) return std::nullopt;
    }
    Bytes content = packet.subspan(at + 2);
    const auto type = load_be(packet, at);
    if (type == wire::kEtherTypeEtherCat && !frame.vlan) return frame;
    if (type == kEtherTypeIp) {
        content = udp_payload(content);
        frame.udp = true;
    } else if (type != wire::kEtherTypeEtherCat) {
        return std::nullopt;
    }
    if (content.size() < wire::kFrameHeaderBytes) return std::nullopt;
    buffer_.assign(packet.begin(), packet.begin() + kAddressBytes);
    buffer_.push_back(std::byte{wire::kEtherTypeEtherCat >> 8});
    buffer_.push_back(std::byte{wire::kEtherTypeEtherCat & 0xFF});
    buffer_.insert(buffer_.end(), content.begin(), content.end());
    frame.bytes = buffer_;
    return frame;
}

bool is_of_datagrams(Bytes frame) {
    return wire::load_frame_header(frame.subspan(wire::kEthernetHeaderBytes)).type == wire::kFrameTypeDatagrams;
}

bool has_datagrams(Bytes frame) {
    if (!is_of_datagrams(frame)) return false;
    wire::DatagramReader reader(frame);
    std::size_t datagrams = 0;
    while (reader.next()) ++datagrams;
    return datagrams != 0 && (reader.fault() == wire::FrameFault::none || reader.fault() == wire::FrameFault::trailing);
}

bool is_marked(Bytes frame) { return (frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0}; }

bool is_untouched(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (d->wkc != 0) return false;
    return true;
}

}  // namespace margay::analyse
