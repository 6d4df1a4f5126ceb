#include "ethercat/values.hpp"

#include "common/counted.hpp"
#include "ethercat/selection.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <optional>

namespace margay::ethercat {
namespace {

using Kind = DataType::Kind;

constexpr DataType kDataTypes[] = {
    {"bool", 0x0001, 1, Kind::boolean},        {"int8", 0x0002, 1, Kind::integer},
    {"int16", 0x0003, 2, Kind::integer},       {"int32", 0x0004, 4, Kind::integer},
    {"int64", 0x0015, 8, Kind::integer},       {"uint8", 0x0005, 1, Kind::cardinal},
    {"uint16", 0x0006, 2, Kind::cardinal},     {"uint32", 0x0007, 4, Kind::cardinal},
    {"uint64", 0x001B, 8, Kind::cardinal},     {"float", 0x0008, 4, Kind::real},
    {"double", 0x0011, 8, Kind::real},         {"string", 0x0009, 0, Kind::text},
    {"octet_string", 0x000A, 0, Kind::octets}, {"unicode_string", 0x000B, 0, Kind::unicode},
    {"sm8", 0, 1, Kind::sign_magnitude},       {"sm16", 0, 2, Kind::sign_magnitude},
    {"sm32", 0, 4, Kind::sign_magnitude},      {"sm64", 0, 8, Kind::sign_magnitude},
    {"int24", 0x0010, 3, Kind::integer},       {"int40", 0x0012, 5, Kind::integer},
    {"int48", 0x0013, 6, Kind::integer},       {"int56", 0x0014, 7, Kind::integer},
    {"uint24", 0x0016, 3, Kind::cardinal},     {"uint40", 0x0018, 5, Kind::cardinal},
    {"uint48", 0x0019, 6, Kind::cardinal},     {"uint56", 0x001A, 7, Kind::cardinal},
};
// Other names of the standard for types above, as dictionaries contain them: bits and bit fields.
struct Synonym {
    std::uint16_t code;
    std::uint16_t of;
};
constexpr Synonym kSynonyms[] = {{0x001E, 0x0005}, {0x001F, 0x0006}, {0x0020, 0x0007}, {0x0030, 0x0005},
                                 {0x0031, 0x0005}, {0x0032, 0x0005}, {0x0033, 0x0005}, {0x0034, 0x0005},
                                 {0x0035, 0x0005}, {0x0036, 0x0005}, {0x0037, 0x0005}, {0x000F, 0x000A}};

Octets little_endian(std::uint64_t value, std::size_t bytes) {
    Octets out;
    for (std::size_t n = 0; n < bytes; ++n) out.push_back(static_cast<std::byte>(value >> (8 * n)));
    return out;
}

std::uint64_t number(std::span<const std::byte> value) {
    std::uint64_t out = 0;
    for (std::size_t n = 0; n < value.size() && n < 8; ++n)
        out |= std::uint64_t{std::to_integer<std::uint8_t>(value[n])} << (8 * n);
    return out;
}

unsigned bits_of(const DataType& type) { return 8U * type.bytes; }

std::int64_t signed_number(const DataType& type, std::span<const std::byte> value) {
    const auto bits = number(value);
    if (type.kind == Kind::sign_magnitude) {
        const auto sign = std::uint64_t{1} << (bits_of(type) - 1);
        const auto magnitude = static_cast<std::int64_t>(bits & (sign - 1));
        return (bits & sign) != 0 ? -magnitude : magnitude;
    }
    const unsigned unused = 64 - bits_of(type);
    return static_cast<std::int64_t>(bits << unused) >> unused;
}

double real(std::span<const std::byte> value) {
    const auto bits = number(value);
    return value.size() == 4 ? std::bit_cast<float>(static_cast<std::uint32_t>(bits)) : std::bit_cast<double>(bits);
}

// A value that the user has given, for a sentence, which shows its beginning: the value may be a whole file of octets.
std::string shown(std::string_view text) {
    constexpr std::size_t kMost = 60;
    const bool shortened = text.size() > kMost;
    text = text.substr(0, kMost);
    if (shortened)  // no part of a character of UTF-8
        while (!text.empty() && static_cast<unsigned char>(text.back()) >= 0x80) text.remove_suffix(1);
    std::string out;
    for (const char c : text) {
        const auto octet = static_cast<unsigned char>(c);
        out += octet >= 0x20 && octet != 0x7F ? std::string(1, c) : fmt::format("\\x{:02x}", octet);
    }
    return shortened ? out + "…" : out;
}

Problem wrong_value(const DataType& type, std::string_view text, std::string_view wanted) {
    return {fmt::format("'{}' is no value of type {}: {} is needed", shown(text), type.name, wanted),
            samples::exit_code::kUsage};
}

Answer<Octets> parse_integer(const DataType& type, std::string_view text) {
    const unsigned bits = bits_of(type);
    if (type.kind == Kind::cardinal) {
        const auto most = UINT64_MAX >> (64 - bits);
        const auto value = parse_unsigned(text, most);
        if (!value) return wrong_value(type, text, fmt::format("a whole number from 0 to {}", most));
        return little_endian(*value, type.bytes);
    }
    const auto most = static_cast<std::int64_t>(UINT64_MAX >> (65 - bits));
    const auto least = type.kind == Kind::sign_magnitude ? -most : -most - 1;
    const auto value = parse_signed(text, least, most);
    if (!value) return wrong_value(type, text, fmt::format("a whole number from {} to {}", least, most));
    if (type.kind == Kind::integer) return little_endian(static_cast<std::uint64_t>(*value), type.bytes);
    const auto magnitude = static_cast<std::uint64_t>(*value < 0 ? -*value : *value);
    return little_endian(*value < 0 ? magnitude | std::uint64_t{1} << (bits - 1) : magnitude, type.bytes);
}

Answer<Octets> parse_real(const DataType& type, std::string_view text) {
    double value = 0;
    const auto digits = text.starts_with('+') ? text.substr(1) : text;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (text.empty() || error != std::errc{} || end != digits.data() + digits.size())
        return wrong_value(type, text, "a decimal number");
    if (type.bytes == 8) return little_endian(std::bit_cast<std::uint64_t>(value), 8);
    const auto narrow = static_cast<float>(value);
    if (std::isinf(narrow) && !std::isinf(value)) return wrong_value(type, text, "a number up to 3.4e38");
    return little_endian(std::bit_cast<std::uint32_t>(narrow), 4);
}

// The next character of UTF-8 at `at`, which is advanced. Nothing: no valid UTF-8.
std::optional<std::uint32_t> next_character(std::string_view text, std::size_t& at) {
    const auto first = static_cast<unsigned char>(text[at++]);
    if (first < 0x80) return first;
    const int more = first >= 0xF0 && first < 0xF5 ? 3 : first >= 0xE0 ? 2 : first >= 0xC2 ? 1 : 0;
    if (more == 0 || first >= 0xF5 || at + static_cast<std::size_t>(more) > text.size()) return std::nullopt;
    std::uint32_t value = first & (0x3FU >> more);
    for (int n = 0; n < more; ++n) {
        const auto octet = static_cast<unsigned char>(text[at++]);
        if ((octet & 0xC0) != 0x80) return std::nullopt;
        value = value << 6 | (octet & 0x3FU);
    }
    return value;
}

// UNICODE_STRING of CoE: UTF-16.
Answer<Octets> parse_unicode(const DataType& type, std::string_view text) {
    Octets out;
    const auto unit = [&](std::uint32_t value) {
        out.push_back(static_cast<std::byte>(value));
        out.push_back(static_cast<std::byte>(value >> 8));
    };
    for (std::size_t at = 0; at < text.size();) {
        const auto c = next_character(text, at);
        if (!c) return wrong_value(type, text, "a text in UTF-8");
        if (*c < 0x10000) {
            unit(*c);
        } else {
            unit(0xD800 + ((*c - 0x10000) >> 10));
            unit(0xDC00 + ((*c - 0x10000) & 0x3FF));
        }
    }
    return out;
}

void append_utf8(std::string& out, std::uint32_t c) {
    const auto octet = [&](std::uint32_t value) { out += static_cast<char>(static_cast<unsigned char>(value)); };
    if (c < 0x80) return octet(c);
    if (c < 0x800) {
        octet(0xC0 | c >> 6);
    } else if (c < 0x10000) {
        octet(0xE0 | c >> 12);
        octet(0x80 | ((c >> 6) & 0x3F));
    } else {
        octet(0xF0 | c >> 18);
        octet(0x80 | ((c >> 12) & 0x3F));
        octet(0x80 | ((c >> 6) & 0x3F));
    }
    octet(0x80 | (c & 0x3F));
}

std::string unicode_text(std::span<const std::byte> value) {
    std::string out;
    for (std::size_t at = 0; at + 1 < value.size(); at += 2) {
        auto c = static_cast<std::uint32_t>(number(value.subspan(at, 2)));
        if (c == 0) break;
        if (c >= 0xD800 && c < 0xDC00 && at + 3 < value.size()) {
            const auto low = static_cast<std::uint32_t>(number(value.subspan(at + 2, 2)));
            if (low >= 0xDC00 && low < 0xE000) {
                c = 0x10000 + ((c - 0xD800) << 10) + (low - 0xDC00);
                at += 2;
            }
        }
        append_utf8(out, c >= 0xD800 && c < 0xE000 ? 0xFFFD : c);
    }
    return out;
}

std::string plain_text(std::span<const std::byte> value) {
    std::string out;
    for (const std::byte b : value) {
        if (b == std::byte{0}) break;
        out += static_cast<char>(b);
    }
    return out;
}

// The text for a terminal and JSON, with \xNN in place of characters that are not printable ASCII.
std::string printable(std::span<const std::byte> value) {
    std::string out;
    for (const char c : plain_text(value)) {
        const auto octet = static_cast<unsigned char>(c);
        out += octet >= 0x20 && octet < 0x7F ? std::string(1, c) : fmt::format("\\x{:02x}", octet);
    }
    return out;
}

}  // namespace

std::span<const DataType> data_types() { return kDataTypes; }

const DataType* type_by_name(std::string_view name) {
    const auto* found = std::ranges::find(kDataTypes, name, &DataType::name);
    return found == std::end(kDataTypes) ? nullptr : found;
}

const DataType* type_by_code(std::uint16_t code) {
    const auto* synonym = std::ranges::find(kSynonyms, code, &Synonym::code);
    if (synonym != std::end(kSynonyms)) code = synonym->of;
    const auto* found = std::ranges::find(kDataTypes, code, &DataType::code);
    return code == 0 || found == std::end(kDataTypes) ? nullptr : found;
}

std::string type_text(std::uint16_t code) {
    const auto* found = std::ranges::find(kDataTypes, code, &DataType::code);
    return code == 0 || found == std::end(kDataTypes) ? fmt::format("type {:#06x}", code) : std::string(found->name);
}

Answer<Octets> parse_value(const DataType& type, std::string_view text) {
    switch (type.kind) {
        case Kind::boolean:
            if (text == "1" || text == "true") return Octets{std::byte{1}};
            if (text == "0" || text == "false") return Octets{std::byte{0}};
            return wrong_value(type, text, "0, 1, true or false");
        case Kind::integer:
        case Kind::cardinal:
        case Kind::sign_magnitude: return parse_integer(type, text);
        case Kind::real: return parse_real(type, text);
        case Kind::unicode: return parse_unicode(type, text);
        case Kind::text:
        case Kind::octets: break;
    }
    const auto octets = std::as_bytes(std::span(text));
    return Octets(octets.begin(), octets.end());
}

Answer<std::string> value_text(const DataType& type, std::span<const std::byte> value) {
    if (type.bytes != 0 && value.size() != type.bytes)
        return Problem{fmt::format("the value has {}, and type {} has {}: {}", samples::counted(value.size(), "octet"),
                                   type.name, type.bytes, octets_text(value))};
    switch (type.kind) {
        case Kind::boolean:
        case Kind::cardinal: return fmt::format("0x{:0{}x} {}", number(value), 2 * type.bytes, number(value));
        case Kind::integer:
        case Kind::sign_magnitude:
            return fmt::format("0x{:0{}x} {}", number(value), 2 * type.bytes, signed_number(type, value));
        case Kind::real:
            return type.bytes == 4 ? fmt::format("{}", static_cast<float>(real(value)))
                                   : fmt::format("{}", real(value));
        case Kind::text: return plain_text(value);
        case Kind::unicode: return unicode_text(value);
        case Kind::octets: break;
    }
    return octets_text(value);
}

nlohmann::ordered_json value_json(const DataType& type, std::span<const std::byte> value) {
    if (type.bytes != 0 && value.size() != type.bytes) return nullptr;
    switch (type.kind) {
        case Kind::boolean: return number(value) != 0;
        case Kind::cardinal: return number(value);
        case Kind::integer:
        case Kind::sign_magnitude: return signed_number(type, value);
        case Kind::real: return std::isfinite(real(value)) ? nlohmann::ordered_json(real(value)) : nullptr;
        case Kind::text: return printable(value);
        case Kind::unicode: return unicode_text(value);
        case Kind::octets: break;
    }
    return hex(value);
}

std::string octets_text(std::span<const std::byte> value) {
    std::string text;
    for (const std::byte b : value)
        text += fmt::format("{}0x{:02x}", text.empty() ? "" : " ", std::to_integer<unsigned>(b));
    return text;
}

std::string hex(std::span<const std::byte> value) {
    std::string text;
    for (const std::byte b : value) text += fmt::format("{:02x}", std::to_integer<unsigned>(b));
    return text;
}

}  // namespace margay::ethercat
