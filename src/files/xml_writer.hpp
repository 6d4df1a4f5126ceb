// Writes XML: elements in the order in which they are added.
#pragma once

#include "files/xml.hpp"

#include <span>
#include <sstream>

namespace margay::files {

// Replaces characters that XML 1.0 does not have: control characters become blanks, and U+FFFE and U+FFFF become
// U+FFFD.
[[nodiscard]] inline std::string printable(std::string_view text) {
    std::string result(text);
    for (char& c : result)
        if (static_cast<unsigned char>(c) < 0x20) c = ' ';
    for (const std::string_view none : {"\xEF\xBF\xBE", "\xEF\xBF\xBF"})
        for (auto at = result.find(none); at != std::string::npos; at = result.find(none, at)) result[at + 2] = '\xBD';
    return result;
}

inline Node add(Node parent, const char* name) { return parent.append_child(name); }
inline Node add(Node parent, const char* name, const std::string& text) {
    Node node = parent.append_child(name);
    node.text().set(printable(text).c_str());
    return node;
}
inline Node add(Node parent, const char* name, std::uint64_t value) { return add(parent, name, std::to_string(value)); }
inline void set(Node node, const char* attribute, const std::string& value) {
    node.append_attribute(attribute).set_value(printable(value).c_str());
}
inline void set(Node node, const char* attribute, bool value) { set(node, attribute, std::string(value ? "1" : "0")); }

// "#x1c12": the notation of ESI files.
[[nodiscard]] inline std::string hex_dec(std::uint64_t value, int digits = 4) {
    return "#x" + hex(value, digits).substr(2);
}

// Octets in the order of the wire.
[[nodiscard]] inline std::string hex_octets(std::span<const std::byte> octets) {
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string text;
    for (const std::byte octet : octets) {
        text += kDigits[std::to_integer<unsigned>(octet) >> 4];
        text += kDigits[std::to_integer<unsigned>(octet) & 0xF];
    }
    return text;
}
[[nodiscard]] inline std::string hex_value(std::uint64_t value, std::size_t octets) {
    std::vector<std::byte> bytes;
    for (std::size_t n = 0; n < octets; ++n) bytes.push_back(static_cast<std::byte>(value >> (8 * n)));
    return hex_octets(bytes);
}

[[nodiscard]] inline std::string to_string(const pugi::xml_document& document) {
    std::ostringstream out;
    document.save(out, "  ", pugi::format_indent, pugi::encoding_utf8);
    return out.str();
}

}  // namespace margay::files
