#include "wire/eoe.hpp"

#include <algorithm>
#include <iterator>

namespace margay::wire::eoe {
namespace {

constexpr unsigned kLast = 1U << 8;
constexpr unsigned kTimeAppended = 1U << 9;
constexpr unsigned kTimeRequested = 1U << 10;

// Bits of the flags of IP parameters.
constexpr std::uint32_t kMac = 0x01;
constexpr std::uint32_t kAddress = 0x02;
constexpr std::uint32_t kHostName = 0x20;
constexpr std::uint32_t kAppendTimeStamp = 0x1'0000;
constexpr std::size_t kIpFlagBytes = 4;

// The parameters that are IPv4 addresses, in the order of the message and of their flags from kAddress on.
constexpr std::optional<Ipv4Address> EoeIp::*kIpv4[] = {&EoeIp::address, &EoeIp::subnet_mask, &EoeIp::default_gateway,
                                                        &EoeIp::dns_server};

using Mac = MacAddress;

void store_mac(MutableBytes at, const Mac& mac) {
    std::ranges::transform(mac, at.begin(), [](std::uint8_t octet) { return std::byte{octet}; });
}

Mac load_mac(Bytes at) {
    Mac mac;
    for (std::size_t n = 0; n < mac.size(); ++n) mac[n] = std::to_integer<std::uint8_t>(at[n]);
    return mac;
}

std::uint32_t flags_of(const EoeIp& ip) {
    std::uint32_t flags = (ip.mac ? kMac : 0) | (ip.has_host_name ? kHostName : 0);
    for (std::size_t n = 0; n < std::size(kIpv4); ++n) flags |= (ip.*kIpv4[n]) ? kAddress << n : 0;
    return flags | (ip.append_time_stamp ? kAppendTimeStamp : 0);
}

constexpr std::size_t size_of_parameter(unsigned n) {
    return n == 0 ? std::tuple_size_v<Mac> : n < 5 ? std::tuple_size_v<Ipv4Address> : EoeIp::kHostNameBytes;
}

// The places of the parameters. Unless `compact`, parameters that `flags` lacks occupy octets too.
class IpPlaces {
  public:
    IpPlaces(std::uint32_t flags, bool compact) : flags_(flags), compact_(compact) {}
    [[nodiscard]] bool has(unsigned n) const { return (flags_ >> n & 1U) != 0; }
    // The place of the next parameter.
    std::size_t next(unsigned n) {
        const std::size_t at = end_;
        end_ += has(n) || !compact_ ? size_of_parameter(n) : 0;
        return at;
    }
    [[nodiscard]] std::size_t end() const { return end_; }

  private:
    std::uint32_t flags_;
    bool compact_;
    std::size_t end_ = kIpFlagBytes;
};

std::size_t compact_bytes(std::uint32_t flags) {
    IpPlaces places(flags, true);
    for (unsigned n = 0; n < 6; ++n) (void)places.next(n);
    return places.end();
}

// An address is a number on the wire, least significant octet first.
void store_ipv4(MutableBytes at, const Ipv4Address& address) {
    std::ranges::transform(address, std::make_reverse_iterator(at.begin() + 4),
                           [](std::uint8_t octet) { return std::byte{octet}; });
}

Ipv4Address load_ipv4(Bytes at) {
    const auto number = load_le<std::uint32_t>(at);
    return {static_cast<std::uint8_t>(number >> 24), static_cast<std::uint8_t>(number >> 16),
            static_cast<std::uint8_t>(number >> 8), static_cast<std::uint8_t>(number)};
}

constexpr std::size_t kFilterPlaces = 16;
constexpr std::size_t kMacBytes = std::tuple_size_v<Mac>;
constexpr std::size_t kMaskPlace = 2 + kFilterPlaces * kMacBytes;

}  // namespace

Header load_header(Bytes at) {
    const unsigned flags = Layout::flags::load(at);
    const unsigned number = Layout::number::load(at);
    return {.type = static_cast<Type>(flags & 0xF),
            .port = static_cast<std::uint8_t>(flags >> 4 & 0xF),
            .last = (flags & kLast) != 0,
            .time_appended = (flags & kTimeAppended) != 0,
            .time_requested = (flags & kTimeRequested) != 0,
            .fragment = static_cast<std::uint8_t>(number & 0x3F),
            .blocks = static_cast<std::uint8_t>(number >> 6 & 0x3F),
            .frame_number = static_cast<std::uint8_t>(number >> 12)};
}

void store_header(MutableBytes at, const Header& h) {
    const unsigned flags = (static_cast<unsigned>(h.type) & 0xF) | (h.port & 0xFU) << 4 | (h.last ? kLast : 0) |
                           (h.time_appended ? kTimeAppended : 0) | (h.time_requested ? kTimeRequested : 0);
    const unsigned number = (h.fragment & 0x3FU) | (h.blocks & 0x3FU) << 6 | (h.frame_number & 0xFU) << 12;
    Layout::flags::store(at, static_cast<std::uint16_t>(flags));
    Layout::number::store(at, static_cast<std::uint16_t>(number));
}

void store_header(MutableBytes at, Type type, EoeResult result) {
    store_header(at, {.type = type});
    Layout::result::store(at, result);
}

std::size_t fragment_bytes(std::size_t left, std::size_t room, std::size_t appended) {
    const std::size_t most = room - kHeaderBytes;
    if (left + appended <= most) return left;
    return std::min(most, left - 1) / kBlockBytes * kBlockBytes;
}

std::size_t store_ip(MutableBytes at, const EoeIp& ip, bool compact) {
    const std::uint32_t flags = flags_of(ip);
    std::ranges::fill(at.first(kIpBytes), std::byte{0});
    store_le(at, 0, flags);
    IpPlaces places(flags, compact);
    if (const std::size_t place = places.next(0); ip.mac) store_mac(at.subspan(place), *ip.mac);
    for (unsigned n = 0; n < std::size(kIpv4); ++n)
        if (const std::size_t place = places.next(n + 1); ip.*kIpv4[n]) store_ipv4(at.subspan(place), *(ip.*kIpv4[n]));
    const auto name = std::as_bytes(std::span(ip.host_name()));
    std::ranges::copy(name, at.begin() + static_cast<std::ptrdiff_t>(places.next(5)));
    return places.end();
}

std::optional<EoeIp> load_ip(Bytes at) {
    if (at.size() < kIpFlagBytes) return std::nullopt;
    const auto flags = load_le<std::uint32_t>(at);
    const bool compact = at.size() < kIpBytes;
    if (compact && at.size() < compact_bytes(flags)) return std::nullopt;
    EoeIp ip;
    IpPlaces places(flags, compact);
    if (const std::size_t place = places.next(0); places.has(0)) ip.mac = load_mac(at.subspan(place));
    for (unsigned n = 0; n < std::size(kIpv4); ++n)
        if (const std::size_t place = places.next(n + 1); places.has(n + 1))
            ip.*kIpv4[n] = load_ipv4(at.subspan(place));
    if (const std::size_t place = places.next(5); places.has(5)) {
        std::array<char, EoeIp::kHostNameBytes> text{};
        for (std::size_t n = 0; n < text.size(); ++n)
            text[n] = static_cast<char>(std::to_integer<unsigned char>(at[place + n]));
        const auto end = std::ranges::find(text, '\0');
        (void)ip.set_host_name({text.data(), static_cast<std::size_t>(end - text.begin())});
    }
    ip.append_time_stamp = (flags & kAppendTimeStamp) != 0;
    return ip;
}

void store_filter(MutableBytes at, const EoeFilter& filter) {
    std::ranges::fill(at.first(kFilterBytes), std::byte{0});
    store_le(at, 0,
             static_cast<std::uint16_t>((filter.address_count & 0xFU) | (filter.mask_count & 3U) << 4 |
                                        (filter.no_broadcasts ? 0x80U : 0U)));
    for (std::size_t n = 0; n < filter.address_count; ++n)
        store_mac(at.subspan(2 + n * kMacBytes), filter.addresses[n]);
    for (std::size_t n = 0; n < filter.mask_count; ++n)
        store_mac(at.subspan(kMaskPlace + n * kMacBytes), filter.masks[n]);
}

std::optional<EoeFilter> load_filter(Bytes at) {
    if (at.size() < kFilterBytes) return std::nullopt;
    const unsigned options = load_le<std::uint16_t>(at);
    EoeFilter filter{.address_count = static_cast<std::uint8_t>(options & 0xF),
                     .mask_count = static_cast<std::uint8_t>(options >> 4 & 3),
                     .no_broadcasts = (options & 0x80) != 0};
    for (std::size_t n = 0; n < filter.address_count; ++n)
        filter.addresses[n] = load_mac(at.subspan(2 + n * kMacBytes));
    for (std::size_t n = 0; n < filter.mask_count; ++n)
        filter.masks[n] = load_mac(at.subspan(kMaskPlace + n * kMacBytes));
    return filter;
}

std::string_view to_text(EoeResult result) {
    switch (result) {
        case EoeResult::success: return "success";
        case EoeResult::unspecified: return "unspecified error";
        case EoeResult::unsupported_type: return "the slave does not know the request";
        case EoeResult::no_ip_support: return "the slave has no IP parameters to set";
        case EoeResult::no_dhcp_support: return "the slave has no DHCP";
        case EoeResult::no_filter_support: return "the slave has no address filter";
    }
    return "unknown code";
}

}  // namespace margay::wire::eoe

namespace margay {

bool EoeFilter::passes(const MacAddress& destination) const {
    const auto is_set = [](std::uint8_t octet) { return octet == 0xFF; };
    if (std::ranges::all_of(destination, is_set)) return !no_broadcasts;
    if (address_count == 0) return true;
    const auto equal = [&](const MacAddress& address, const MacAddress& mask) {
        for (std::size_t n = 0; n < mask.size(); ++n)
            if (((address[n] ^ destination[n]) & mask[n]) != 0) return false;
        return true;
    };
    constexpr MacAddress kWhole{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    for (std::size_t n = 0; n < address_count; ++n) {
        if (equal(addresses[n], kWhole)) return true;
        for (std::size_t mask = 0; mask < mask_count; ++mask)
            if (equal(addresses[n], masks[mask])) return true;
    }
    return false;
}

}  // namespace margay
