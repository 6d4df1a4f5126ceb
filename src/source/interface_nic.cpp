#include "source/interface_nic.hpp"

#include "oshw/linux/packet_nic.hpp"
#ifdef MARGAY_WITH_XDP
#include "oshw/xdp/xdp_nic.hpp"
#endif

namespace margay::hosted {
namespace {

template <class N>
OpenedInterface open_as(const std::string& name) {
    auto nic = std::make_shared<N>();
    const auto opened = nic->open(name);
    if (!opened) return {.error = std::string(nic->problem()), .error_number = static_cast<int>(opened.error().actual)};
    return {.nic = std::move(nic)};
}

OpenedInterface open_packet(const std::string& name) { return open_as<PacketNic>(name); }

OpenedInterface open_xdp(const std::string& name) {
#ifdef MARGAY_WITH_XDP
    return open_as<XdpNic>(name);
#else
    return {.error = "interface " + name +
                     ": this program was built without AF_XDP (build it where libxdp-dev and libbpf-dev are "
                     "installed, with MARGAY_XDP=ON)"};
#endif
}

}  // namespace

InterfaceText parse_interface(std::string_view text) {
    constexpr std::string_view kXdp = "xdp:";
    constexpr std::string_view kXdpOrPacket = "try-xdp:";
    using Socket = InterfaceText::Socket;
    if (text.starts_with(kXdp)) return {Socket::xdp, std::string(text.substr(kXdp.size()))};
    if (text.starts_with(kXdpOrPacket)) return {Socket::xdp_or_packet, std::string(text.substr(kXdpOrPacket.size()))};
    return {Socket::packet, std::string(text)};
}

OpenedInterface open_interface_nic(const InterfaceText& wanted) {
    using Socket = InterfaceText::Socket;
    if (wanted.socket == Socket::packet) return open_packet(wanted.name);
    auto first = open_xdp(wanted.name);
    if (first.nic || wanted.socket == Socket::xdp) return first;
    auto second = open_packet(wanted.name);
    if (second.nic)
        second.remark = first.error + "; continuing with AF_PACKET";
    else if (second.error != first.error)
        second.error = first.error + "; and with AF_PACKET: " + second.error;
    return second;
}

}  // namespace margay::hosted
