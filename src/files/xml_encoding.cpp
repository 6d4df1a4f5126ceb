#include "files/xml_encoding.hpp"

#include <array>
#include <cstdint>

namespace margay::files {
namespace {

void add_utf8(std::string& text, std::uint32_t code) {
    if (code < 0x80) {
        text += static_cast<char>(code);
    } else if (code < 0x800) {
        text += static_cast<char>(0xC0 | (code >> 6));
        text += static_cast<char>(0x80 | (code & 0x3F));
    } else {
        text += static_cast<char>(0xE0 | (code >> 12));
        text += static_cast<char>(0x80 | ((code >> 6) & 0x3F));
        text += static_cast<char>(0x80 | (code & 0x3F));
    }
}

// 0x80 to 0x9F. Five octets have no character: they stay control characters.
constexpr std::array<std::uint16_t, 32> kWindows1252{0x20AC, 0x0081, 0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021,
                                                     0x02C6, 0x2030, 0x0160, 0x2039, 0x0152, 0x008D, 0x017D, 0x008F,
                                                     0x0090, 0x2018, 0x2019, 0x201C, 0x201D, 0x2022, 0x2013, 0x2014,
                                                     0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0x009D, 0x017E, 0x0178};

}  // namespace

std::string from_latin1(std::string_view octets) {
    std::string utf8;
    utf8.reserve(octets.size() + octets.size() / 16);
    for (const char c : octets) add_utf8(utf8, static_cast<unsigned char>(c));
    return utf8;
}

std::string from_windows_1252(std::string_view octets) {
    std::string utf8;
    utf8.reserve(octets.size() + octets.size() / 16);
    for (const char c : octets) {
        const auto octet = static_cast<unsigned char>(c);
        add_utf8(utf8, octet >= 0x80 && octet < 0xA0 ? kWindows1252[octet - 0x80U] : octet);
    }
    return utf8;
}

}  // namespace margay::files
