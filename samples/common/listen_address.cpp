#include "common/listen_address.hpp"

#include <fmt/format.h>

#include <netdb.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>

namespace margay::samples {

bool is_ip_address(const std::string& text) {
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST;
    addrinfo* found = nullptr;
    if (::getaddrinfo(text.c_str(), nullptr, &hints, &found) != 0) return false;
    ::freeaddrinfo(found);
    return true;
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
