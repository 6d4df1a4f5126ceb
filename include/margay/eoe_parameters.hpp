// Parameters that the master sets in a slave with EoE (Ethernet over EtherCAT, ETG.1000.6): parameters of the slave's
// IP stack, and the filter for the frames that the slave passes on. Both ends use these types.
#pragma once

#include <margay/mac_address.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace margay {

// An IPv4 address or mask as it is written: 192.168.0.1 is {192, 168, 0, 1}.
using Ipv4Address = std::array<std::uint8_t, 4>;

// The parameters of an IP stack. A parameter without a value is not set, or was not reported.
struct EoeIp {
    static constexpr std::size_t kHostNameBytes = 32;

    std::optional<MacAddress> mac{};  // of the virtual interface of the slave, not of its EtherCAT ports
    std::optional<Ipv4Address> address{};
    std::optional<Ipv4Address> subnet_mask{};
    std::optional<Ipv4Address> default_gateway{};
    std::optional<Ipv4Address> dns_server{};
    bool append_time_stamp = false;  // the slave appends a time stamp to each frame that it sends
    // Use set_host_name() and host_name().
    bool has_host_name = false;
    std::array<char, kHostNameBytes> host_name_octets{};

    // Empty if there is none.
    [[nodiscard]] std::string_view host_name() const {
        const auto end = std::find(host_name_octets.begin(), host_name_octets.end(), '\0');
        return {host_name_octets.data(), has_host_name ? static_cast<std::size_t>(end - host_name_octets.begin()) : 0};
    }
    // False: the name is longer than kHostNameBytes, and is not set.
    [[nodiscard]] constexpr bool set_host_name(std::string_view name) {
        if (name.size() > kHostNameBytes) return false;
        host_name_octets = {};
        std::copy(name.begin(), name.end(), host_name_octets.begin());
        has_host_name = true;
        return true;
    }
    friend bool operator==(const EoeIp&, const EoeIp&) = default;
};

// The frames that a slave passes on to the master, by their destination. A frame passes if its destination is in
// `addresses`, or equals one of them in the bits that are set in one of the `masks`. Broadcasts pass unless
// `no_broadcasts` is set. Without addresses all other frames pass.
struct EoeFilter {
    // The message has places for 16 and 4, but its counters have 4 and 2 bits.
    static constexpr std::size_t kAddresses = 15;
    static constexpr std::size_t kMasks = 3;

    std::array<MacAddress, kAddresses> addresses{};
    std::array<MacAddress, kMasks> masks{};
    std::uint8_t address_count = 0;
    std::uint8_t mask_count = 0;
    bool no_broadcasts = false;
    friend bool operator==(const EoeFilter&, const EoeFilter&) = default;

    // Whether a frame with this destination passes.
    [[nodiscard]] bool passes(const MacAddress& destination) const;
};

// The result codes of EoE requests (ETG.1000.6 "EoE result codes").
enum class EoeResult : std::uint16_t {
    success = 0x0000,
    unspecified = 0x0001,
    unsupported_type = 0x0002,
    no_ip_support = 0x0201,
    no_dhcp_support = 0x0202,
    no_filter_support = 0x0401,
};

}  // namespace margay
