#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::wire::sii {
namespace {

constexpr unsigned octet_at(Bytes octets, std::size_t i) { return std::to_integer<unsigned>(octets[i]); }

// The length of the UTF-8 sequence at `i`; 0 when there is no valid sequence. Overlong forms, surrogates and code
// points above U+10FFFF are not valid.
std::size_t utf8_length(Bytes octets, std::size_t i) {
    const unsigned lead = octet_at(octets, i);
    if (lead < 0x80) return 1;
    const std::size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                               : (lead & 0xF0) == 0xE0       ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    if (length == 0 || length > octets.size() - i) return 0;
    for (std::size_t k = 1; k < length; ++k)
        if ((octet_at(octets, i + k) & 0xC0) != 0x80) return 0;
    const unsigned second = octet_at(octets, i + 1);
    const bool bad = (lead == 0xE0 && second < 0xA0) || (lead == 0xED && second >= 0xA0) ||
                     (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second >= 0x90);
    return bad ? 0 : length;
}

}  // namespace

bool is_utf8(Bytes octets) {
    for (std::size_t i = 0; i < octets.size();) {
        const auto length = utf8_length(octets, i);
        if (length == 0) return false;
        i += length;
    }
    return true;
}

std::uint8_t string_count(Bytes strings) { return strings.empty() ? std::uint8_t{0} : load_le<std::uint8_t>(strings); }

Parsed<Bytes> string(Bytes strings, StringNumber number) {
    if (number == 0) return {};
    if (number > string_count(strings)) return {{}, Fault::string_missing};
    std::size_t at = 1;
    for (unsigned n = 1;; ++n) {
        if (at >= strings.size()) return {{}, Fault::string_past_end};
        const std::size_t length = octet_at(strings, at);
        if (length > strings.size() - at - 1) return {{}, Fault::string_past_end};
        if (n == number) return {strings.subspan(at + 1, length), Fault::none};
        at += 1 + length;
    }
}

std::string_view to_utf8(Bytes octets, std::span<char> out) {
    while (!octets.empty() && (octets.back() == std::byte{0} || octets.back() == std::byte{' '}))
        octets = octets.first(octets.size() - 1);
    const bool utf8 = is_utf8(octets);
    std::size_t size = 0;
    for (std::size_t i = 0; i < octets.size();) {
        const std::size_t taken = utf8 ? utf8_length(octets, i) : 1;
        const unsigned first = octet_at(octets, i);
        const unsigned point = taken == 2 ? ((first & 0x1F) << 6) | (octet_at(octets, i + 1) & 0x3F) : first;
        const bool control = taken <= 2 && (point < 0x20 || (point >= 0x7F && point < 0xA0));
        const std::size_t needed = control ? 1 : taken == 1 && first >= 0xA0 ? 2 : taken;
        if (needed > out.size() - size) break;
        if (control) {
            out[size] = '?';
        } else if (needed == taken) {
            for (std::size_t k = 0; k < taken; ++k) out[size + k] = static_cast<char>(octet_at(octets, i + k));
        } else {  // the characters of ISO 8859-1 are the first 256 code points
            out[size] = static_cast<char>(0xC0 | (first >> 6));
            out[size + 1] = static_cast<char>(0x80 | (first & 0x3F));
        }
        size += needed;
        i += taken;
    }
    return {out.data(), size};
}

Parsed<General> parse_general(Bytes content) {
    std::array<std::byte, kGeneralBytes> at{};
    // Only whole words, because every field of more than one octet is a word.
    const auto there = std::min(content.size() / kWordBytes * kWordBytes, at.size());
    std::copy_n(content.begin(), there, at.begin());
    const General g{.group = load_le<std::uint8_t>(at, 0),
                    .image = load_le<std::uint8_t>(at, 1),
                    .order = load_le<std::uint8_t>(at, 2),
                    .name = load_le<std::uint8_t>(at, 3),
                    .coe_details = load_le<std::uint8_t>(at, 5),
                    .foe_details = load_le<std::uint8_t>(at, 6),
                    .eoe_details = load_le<std::uint8_t>(at, 7),
                    .soe_channels = load_le<std::uint8_t>(at, 8),
                    .ds402_channels = load_le<std::uint8_t>(at, 9),
                    .sysman_class = load_le<std::uint8_t>(at, 10),
                    .flags = load_le<std::uint8_t>(at, 11),
                    .ebus_current_ma = load_le<std::int16_t>(at, 12),
                    .physical_ports = load_le<std::uint16_t>(at, 16),
                    .identification_address = load_le<std::uint16_t>(at, 18)};
    return {g, content.size() < kGeneralBytes ? Fault::truncated : Fault::none};
}

}  // namespace margay::wire::sii
