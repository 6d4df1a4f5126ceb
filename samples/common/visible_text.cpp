#include "common/visible_text.hpp"

#include <algorithm>
#include <utility>

namespace margay::samples {
namespace {

// One character of a text in UTF-8. An incomplete character ends before the next character.
std::string_view character_at(std::string_view text, std::size_t at) {
    const auto lead = static_cast<unsigned char>(text[at]);
    const auto most = text.substr(at, lead < 0xC0 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4);
    std::size_t size = 1;
    while (size < most.size() && (static_cast<unsigned char>(most[size]) & 0xC0) == 0x80) ++size;
    return most.substr(0, size);
}

// The order of texts in UTF-8 is that of their characters.
bool is_hidden(std::string_view c) {
    constexpr std::pair<std::string_view, std::string_view> kHidden[] = {
        {"\u00AD", "\u00AD"}, {"\u061C", "\u061C"}, {"\u200B", "\u200F"}, {"\u2028", "\u202E"},
        {"\u2060", "\u206F"}, {"\uFEFF", "\uFEFF"}, {"\uFFF9", "\uFFFF"}, {"\U000E0000", "\U000E0FFF"}};
    return c.size() > 1 &&
           std::ranges::any_of(kHidden, [c](const auto& range) { return range.first <= c && c <= range.second; });
}

}  // namespace

std::string visible(std::string_view text) {
    std::string shown;
    shown.reserve(text.size());
    for (std::size_t at = 0; at < text.size();) {
        const auto character = character_at(text, at);
        shown += is_hidden(character) ? "?" : character;
        at += character.size();
    }
    return shown;
}

}  // namespace margay::samples
