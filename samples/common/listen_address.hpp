// Where a server listens, as users write it.
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

// ADDRESS, ADDRESS:PORT or [ADDRESS]:PORT; without a port, `port`. Nothing: the text is none of these.
[[nodiscard]] std::optional<ListenAddress> parse_listen_address(std::string_view text, std::uint16_t port);

// ADDRESS, port PORT: for messages.
[[nodiscard]] std::string to_text(const ListenAddress& where);

}  // namespace margay::samples
