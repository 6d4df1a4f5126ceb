// The address at which a server listens, as users write it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace margay::samples {

struct ListenAddress {
    std::string address{};  // in digits; not checked
    std::uint16_t port = 0;
};

// Whether `text` is an address of IPv4 or IPv6 in digits. No name is resolved.
[[nodiscard]] bool is_ip_address(const std::string& text);

// ADDRESS, ADDRESS:PORT or [ADDRESS]:PORT; without a port, `port`. No value: the text has none of these forms.
[[nodiscard]] std::optional<ListenAddress> parse_listen_address(std::string_view text, std::uint16_t port);

// Whether only one server can listen at both: the ports are equal, and the addresses are equal in their octets, or one
// of them means all addresses of its family. Port 0 means any free port.
[[nodiscard]] bool clash(const ListenAddress& a, const ListenAddress& b);

// ADDRESS, port PORT: for messages.
[[nodiscard]] std::string to_text(const ListenAddress& where);

}  // namespace margay::samples
