#include "source/interface_nic.hpp"

#include "oshw/linux/interface.hpp"
#include "oshw/linux/packet_nic.hpp"
#ifdef MARGAY_WITH_XDP
#include "oshw/xdp/xdp_nic.hpp"
#endif

#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>

#include <algorithm>

namespace margay::hosted {
namespace {

template <class N>
OpenedInterface failed(const N& nic, const Error& error) {
    return {.error = std::string(nic.problem()), .error_number = static_cast<int>(error.actual)};
}

template <class N>
OpenedInterface open_as(std::shared_ptr<N> nic, const std::string& name) {
    if (const auto opened = nic->open(name); !opened) return failed(*nic, opened.error());
    return {.nic = std::move(nic)};
}

OpenedInterface open_packet(const std::string& name, const WantedTimes& times) {
    const auto nic = std::make_shared<PacketNic>();
    auto opened = open_as(nic, name);
    if (!opened.nic) return opened;
    if (times.stamps != WantedTimes::Stamps::off) {
        const bool hardware = times.stamps == WantedTimes::Stamps::hardware;
        const auto done = nic->stamp_frames(hardware ? PacketNic::Stamps::hardware : PacketNic::Stamps::software,
                                            PacketNic::Stamped::both);
        if (!done) return failed(*nic, done.error());
    }
    if (times.send_at)
        if (const auto done = nic->allow_send_at(); !done) return failed(*nic, done.error());
    return opened;
}

OpenedInterface open_xdp(const std::string& name, const WantedTimes& times) {
    if (times.any())
        return {.error = "interface " + name +
                         ": AF_XDP has no times of frames, neither stamps nor sending at a time; AF_PACKET (" + name +
                         " without xdp:) has them"};
#ifdef MARGAY_WITH_XDP
    return open_as(std::make_shared<XdpNic>(), name);
#else
    return {.error = "interface " + name +
                     ": this program was built without AF_XDP (build it where libxdp-dev and libbpf-dev are "
                     "installed, with MARGAY_XDP=ON)"};
#endif
}

// The number of the clock of its hardware (/dev/ptpN); negative: the hardware has no clock.
int clock_of(const std::string& name) {
    Interface interface;
    ethtool_ts_info info{};
    info.cmd = ETHTOOL_GET_TS_INFO;
    ifreq request{};
    request.ifr_data = reinterpret_cast<char*>(&info);
    return interface.open(name) && interface.request(SIOCETHTOOL, request) ? info.phc_index : -1;
}

}  // namespace

bool share_a_clock(const std::string& one, const std::string& other) {
    const int clock = clock_of(one);
    return clock >= 0 && clock == clock_of(other);
}

InterfaceText parse_interface(std::string_view text) {
    constexpr std::string_view kXdp = "xdp:";
    constexpr std::string_view kXdpOrPacket = "try-xdp:";
    using Socket = InterfaceText::Socket;
    if (text.starts_with(kXdp)) return {Socket::xdp, std::string(text.substr(kXdp.size()))};
    if (text.starts_with(kXdpOrPacket)) return {Socket::xdp_or_packet, std::string(text.substr(kXdpOrPacket.size()))};
    return {Socket::packet, std::string(text)};
}

std::vector<std::string> interfaces_of(std::string_view source) {
    std::vector<std::string> names;
    if (source.starts_with("sim:") || source.starts_with("pcap:")) return names;
    for (std::size_t at = 0; at <= source.size();) {
        const auto end = std::min(source.find('+', at), source.size());
        names.push_back(parse_interface(source.substr(at, end - at)).name);
        at = end + 1;
    }
    return names;
}

OpenedInterface open_interface_nic(const InterfaceText& wanted, const WantedTimes& times) {
    using Socket = InterfaceText::Socket;
    if (wanted.socket == Socket::packet) return open_packet(wanted.name, times);
    auto first = open_xdp(wanted.name, times);
    if (first.nic || wanted.socket == Socket::xdp) return first;
    auto second = open_packet(wanted.name, times);
    if (second.nic)
        second.remark = first.error + "; continuing with AF_PACKET";
    else if (second.error != first.error)
        second.error = first.error + "; and with AF_PACKET: " + second.error;
    return second;
}

}  // namespace margay::hosted
