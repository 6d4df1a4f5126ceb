#include "common/listen_address.hpp"

#include <fmt/format.h>

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <vector>

namespace margay::samples {

namespace {

// The octets of the address and, for an address of one link, the number of its interface. Empty: the text is not an
// address.
std::vector<std::uint8_t> octets_of(const std::string& text) {
    // getaddrinfo() also accepts "34980" and "1.2.3" as addresses.
    in_addr four_parts{};
    if (text.find(':') == std::string::npos && ::inet_pton(AF_INET, text.c_str(), &four_parts) != 1) return {};
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST;
    addrinfo* found = nullptr;
    if (::getaddrinfo(text.c_str(), nullptr, &hints, &found) != 0) return {};
    std::vector<std::uint8_t> octets;
    const auto take = [&octets](const auto& field) {
        const auto old = octets.size();
        octets.resize(old + sizeof field);
        std::memcpy(octets.data() + old, &field, sizeof field);
    };
    if (found->ai_family == AF_INET) {
        sockaddr_in four{};
        std::memcpy(&four, found->ai_addr, sizeof four);
        take(four.sin_addr);
    } else if (found->ai_family == AF_INET6) {
        sockaddr_in6 six{};
        std::memcpy(&six, found->ai_addr, sizeof six);
        take(six.sin6_addr);
        take(six.sin6_scope_id);
    }
    ::freeaddrinfo(found);
    return octets;
}

}  // namespace

bool is_ip_address(const std::string& text) { return !octets_of(text).empty(); }

bool clash(const ListenAddress& a, const ListenAddress& b) {
    if (a.port == 0 || a.port != b.port) return false;
    const auto one = octets_of(a.address);
    const auto two = octets_of(b.address);
    if (one.empty() || one.size() != two.size()) return false;
    const auto is_zero = [](std::uint8_t octet) { return octet == 0; };
    return one == two || std::ranges::all_of(one, is_zero) || std::ranges::all_of(two, is_zero);
}

std::optional<ListenAddress> parse_listen_address(std::string_view text, std::uint16_t port) {
    const bool bracket = text.starts_with('[');
    const auto end = bracket ? text.find(']') : std::string_view::npos;
    if (bracket && end == std::string_view::npos) return std::nullopt;
    const bool plain_six = !bracket && std::ranges::count(text, ':') > 1;
    const auto colon = plain_six ? std::string_view::npos : text.find(':', bracket ? end : 0);
    ListenAddress where{std::string(bracket ? text.substr(1, end - 1) : text.substr(0, colon)), port};
    if (where.address.empty()) return std::nullopt;
    if (colon == std::string_view::npos)
        return bracket && end + 1 != text.size() ? std::nullopt : std::optional(std::move(where));
    const auto digits = text.substr(colon + 1);
    const auto [rest, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), where.port);
    if (failed != std::errc{} || rest != digits.data() + digits.size() || (bracket && colon != end + 1))
        return std::nullopt;
    return where;
}

std::string to_text(const ListenAddress& where) {
    const bool six = where.address.find(':') != std::string::npos;
    return fmt::format("{}{}{}, port {}", six ? "[" : "", where.address, six ? "]" : "", where.port);
}

}  // namespace margay::samples
