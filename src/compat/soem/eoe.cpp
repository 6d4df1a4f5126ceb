// Ethernet frames to and from a slave, and the parameters of its IP stack (EoE).
#include "compat/soem/mail.hpp"

#include <cstring>

namespace margay::soem {
namespace {

constexpr std::size_t kEoeHeader = 4;
constexpr std::size_t kBlock = 32;  // fragments are counted in blocks
constexpr int kMostOctets = 63 * static_cast<int>(kBlock);

MacAddress mac_of(const eoe_ethaddr_t& address) {
    MacAddress mac{};
    std::copy_n(address.addr, mac.size(), mac.begin());
    return mac;
}

Ipv4Address ip_of(const eoe_ip4_addr_t& address) {
    Ipv4Address ip{};
    std::memcpy(ip.data(), &address.addr, ip.size());
    return ip;
}

void put_ip(const std::optional<Ipv4Address>& from, eoe_ip4_addr_t& to) {
    if (from) std::memcpy(&to.addr, from->data(), from->size());
}

int result(ecx_contextt& context, std::uint16_t slave, const Error& error) {
    if (error.code == Errc::eoe_error) return -static_cast<int>(error.detail);
    if (error.code == Errc::protocol) return -EC_ERR_TYPE_PACKET_ERROR;
    return mail_result(context, slave, error, 0, 0);
}

// One fragment of a frame.
struct Fragment {
    unsigned number = 0;
    unsigned place = 0;  // of the first one: the size of the frame; of the others: the offset; in blocks
    unsigned frame = 0;
    std::uint8_t port = 0;
    bool last = false;
    std::span<const std::byte> data;
};

int send_fragment(Session& session, std::uint16_t slave, const Fragment& fragment, Duration timeout) {
    ec_mbxbuft mail{};
    auto* const octets = reinterpret_cast<std::byte*>(mail);
    put_word(octets, static_cast<unsigned>(kEoeHeader + fragment.data.size()));
    octets[5] = std::byte{ECT_MBXT_EOE};
    put_word(octets + kMailHeader, EOE_HDR_FRAME_TYPE_SET(EOE_FRAG_DATA) |
                                       static_cast<unsigned>(EOE_HDR_FRAME_PORT_SET(fragment.port)) |
                                       static_cast<unsigned>(EOE_HDR_LAST_FRAGMENT_SET(fragment.last ? 1 : 0)));
    put_word(octets + kMailHeader + 2, EOE_HDR_FRAG_NO_SET(fragment.number) | EOE_HDR_FRAME_OFFSET_SET(fragment.place) |
                                           EOE_HDR_FRAME_NO_SET(fragment.frame));
    std::memcpy(octets + kMailHeader + kEoeHeader, fragment.data.data(), fragment.data.size());
    return send_mail(session, slave, mail, timeout);
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_EOEdefinehook(ecx_contextt* context, void* hook) {
    hook_at(context->EOEhook) = reinterpret_cast<decltype(context->EOEhook)>(hook);
    return 1;
}

int ecx_EOEsetIp(ecx_contextt* context, uint16 slave, uint8 port, eoe_param_t* ipparam, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    if (port != 0) say_once("ecx_EOEsetIp(): the port is not sent");
    margay::EoeSetIp request;
    request.slave = slave;
    if (ipparam->mac_set != 0) request.ip.mac = mac_of(ipparam->mac);
    if (ipparam->ip_set != 0) request.ip.address = ip_of(ipparam->ip);
    if (ipparam->subnet_set != 0) request.ip.subnet_mask = ip_of(ipparam->subnet);
    if (ipparam->default_gateway_set != 0) request.ip.default_gateway = ip_of(ipparam->default_gateway);
    if (ipparam->dns_ip_set != 0) request.ip.dns_server = ip_of(ipparam->dns_ip);
    if (ipparam->dns_name_set != 0)
        static_cast<void>(
            request.ip.set_host_name({ipparam->dns_name, strnlen(ipparam->dns_name, sizeof(ipparam->dns_name))}));
    request.timeout = mail_time(timeout);
    const auto done = session->run(request);
    return result(*context, slave, done.error());
}

int ecx_EOEgetIp(ecx_contextt* context, uint16 slave, uint8, eoe_param_t* ipparam, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    margay::EoeGetIp request;
    request.slave = slave;
    request.timeout = mail_time(timeout);
    const auto done = session->run(request);
    if (done) {
        std::memset(ipparam, 0, sizeof(*ipparam));
        ipparam->mac_set = request.ip.mac ? 1 : 0;
        ipparam->ip_set = request.ip.address ? 1 : 0;
        ipparam->subnet_set = request.ip.subnet_mask ? 1 : 0;
        ipparam->default_gateway_set = request.ip.default_gateway ? 1 : 0;
        ipparam->dns_ip_set = request.ip.dns_server ? 1 : 0;
        ipparam->dns_name_set = request.ip.has_host_name ? 1 : 0;
        if (request.ip.mac) std::copy_n(request.ip.mac->begin(), EOE_ETHADDR_LENGTH, ipparam->mac.addr);
        put_ip(request.ip.address, ipparam->ip);
        put_ip(request.ip.subnet_mask, ipparam->subnet);
        put_ip(request.ip.default_gateway, ipparam->default_gateway);
        put_ip(request.ip.dns_server, ipparam->dns_ip);
        std::copy_n(request.ip.host_name_octets.begin(), EOE_DNS_NAME_LENGTH, ipparam->dns_name);
    }
    return result(*context, slave, done.error());
}

int ecx_EOEsend(ecx_contextt* context, uint16 slave, uint8 port, int psize, void* p, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) || psize <= 0 || psize > kMostOctets) return 0;
    const std::size_t mailbox = value_of(*context, *session, slave, &ec_slavet::mbx_l);
    if (mailbox < kMailHeader + kEoeHeader + kBlock) return 0;
    const std::size_t most = (mailbox - kMailHeader - kEoeHeader) / kBlock * kBlock;
    static std::atomic<unsigned> frames{0};
    const unsigned frame = frames++ & 0xFU;
    const void* const content = p;
    const auto data = octets_at(content, static_cast<std::size_t>(psize));
    unsigned number = 0;
    for (std::size_t at = 0; at < data.size(); ++number) {
        const std::size_t size = std::min(data.size() - at, most);
        const auto blocks = static_cast<unsigned>((number == 0 ? data.size() + kBlock - 1 : at) / kBlock);
        const Fragment fragment{.number = number,
                                .place = blocks,
                                .frame = frame,
                                .port = port,
                                .last = at + size == data.size(),
                                .data = data.subspan(at, size)};
        const int sent = send_fragment(*session, slave, fragment, us(timeout));
        if (sent <= 0) return sent;
        at += size;
    }
    return 1;
}

int ecx_EOErecv(ecx_contextt* context, uint16 slave, uint8, int* psize, void* p, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    uint8 fragment = 0;
    uint16 frame_size = 0;
    uint16 offset = 0;
    uint16 frame = 0;
    const margay::Time until = margay::later(session->now(), us(timeout));
    const int room = *psize;
    do {
        const auto letter = await_letter(*context, *session, slave, margay::MailboxType::eoe, until - session->now());
        if (!letter) return 0;
        ec_mbxbuft mail{};
        put_letter(*letter, value_of(*context, *session, slave, &ec_slavet::configadr), 0, mail);
        int size = room;
        const int done = ecx_EOEreadfragment(&mail, &fragment, &frame_size, &offset, &frame, &size, p);
        if (done != 0) {
            *psize = done > 0 ? size : 0;
            return done;
        }
    } while (session->now() < until);
    return 0;
}

int ecx_EOEreadfragment(ec_mbxbuft* MbxIn, uint8* rxfragmentno, uint16* rxframesize, uint16* rxframeoffset,
                        uint16* rxframeno, int* psize, void* p) {
    const auto* const octets = reinterpret_cast<const std::byte*>(*MbxIn);
    const unsigned length = word_at(octets);
    if ((std::to_integer<unsigned>(octets[5]) & 0xFU) != ECT_MBXT_EOE) return -EC_ERR_TYPE_PACKET_ERROR;
    if (length < kEoeHeader || length + kMailHeader > sizeof(ec_mbxbuft)) return -EC_ERR_TYPE_EOE_INVALID_RX_DATA;
    const unsigned info1 = word_at(octets + kMailHeader);
    const unsigned info2 = word_at(octets + kMailHeader + 2);
    if (EOE_HDR_FRAME_TYPE_GET(info1) != EOE_FRAG_DATA) return -EC_ERR_TYPE_EOE_INVALID_RX_DATA;
    const unsigned number = EOE_HDR_FRAG_NO_GET(info2);
    const unsigned blocks = EOE_HDR_FRAME_OFFSET_GET(info2);
    unsigned data = length - static_cast<unsigned>(kEoeHeader);
    const bool last = EOE_HDR_LAST_FRAGMENT_GET(info1) != 0;
    const bool stamped = last && EOE_HDR_TIME_APPEND_GET(info1) != 0;
    if (stamped && data >= 4) data -= 4;
    if (number == 0) {
        *rxframesize = static_cast<uint16>(blocks * kBlock);
        *rxframeoffset = 0;
        *rxframeno = static_cast<uint16>(EOE_HDR_FRAME_NO_GET(info2));
    } else if (number != *rxfragmentno || blocks * kBlock != *rxframeoffset ||
               EOE_HDR_FRAME_NO_GET(info2) != *rxframeno) {
        *rxfragmentno = 0;
        *rxframesize = 0;
        *rxframeoffset = 0;
        return -EC_ERR_TYPE_EOE_INVALID_RX_DATA;
    }
    if (static_cast<int>(*rxframeoffset + data) > *psize || *rxframeoffset + data > *rxframesize) {
        *rxfragmentno = 0;
        return -EC_ERR_TYPE_EOE_INVALID_RX_DATA;
    }
    std::memcpy(static_cast<std::byte*>(p) + *rxframeoffset, octets + kMailHeader + kEoeHeader, data);
    *rxframeoffset = static_cast<uint16>(*rxframeoffset + data);
    *rxfragmentno = static_cast<uint8>(number + 1);
    if (!last) return 0;
    *psize = *rxframeoffset;
    *rxfragmentno = 0;
    return 1;
}

}  // extern "C"
