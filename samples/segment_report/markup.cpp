#include "segment_report/markup.hpp"

#include <fmt/format.h>

#include <cstdint>

namespace margay::segment_report {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD

// The character at the beginning of `text`, and its octets; 0 octets: the text does not begin with UTF-8.
struct Character {
    std::uint32_t code = 0;
    std::size_t octets = 0;
};

Character first_character(std::string_view text) {
    const auto at = [&](std::size_t n) { return static_cast<std::uint8_t>(text[n]); };
    const std::uint8_t lead = at(0);
    if (lead < 0x80) return {lead, 1};
    const std::size_t octets = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if (lead < 0xC2 || lead > 0xF4 || text.size() < octets) return {};
    std::uint32_t code = lead & (0x7FU >> octets);
    for (std::size_t n = 1; n < octets; ++n) {
        if ((at(n) & 0xC0) != 0x80) return {};
        code = code << 6 | (at(n) & 0x3FU);
    }
    const std::uint32_t least = octets == 2 ? 0x80 : octets == 3 ? 0x800 : 0x10000;
    const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
    if (code < least || code > 0x10FFFF || surrogate) return {};
    return {code, octets};
}

// Characters that XML does not allow, or that make a text look like another one.
bool forbidden(std::uint32_t code) {
    if (code == '\n' || code == '\t') return false;
    const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
    const bool direction = (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069) || code == 0x200E ||
                           code == 0x200F || code == 0x061C;
    return control || direction || code == 0xFEFF || code == 0xFFFE || code == 0xFFFF;
}

std::string escaped(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    while (!text.empty()) {
        const auto [code, octets] = first_character(text);
        if (octets == 0 || forbidden(code))
            out += kReplacement;
        else if (code == '&')
            out += "&amp;";
        else if (code == '<')
            out += "&lt;";
        else if (code == '>')
            out += "&gt;";
        else if (code == '"')
            out += "&quot;";
        else if (code == '\'')
            out += "&#39;";
        else
            out += text.substr(0, octets);
        text.remove_prefix(octets == 0 ? 1 : octets);
    }
    return out;
}

}  // namespace

Markup::Markup(std::string_view text) : html_(escaped(text)) {}

Markup Markup::raw(std::string html) {
    Markup markup;
    markup.html_ = std::move(html);
    return markup;
}

Markup& Markup::operator+=(const Markup& more) {
    html_ += more.html_;
    return *this;
}

Markup tag(std::string_view name, std::string_view attributes, const Markup& content) {
    const bool space = !attributes.empty() && !attributes.starts_with(' ');
    return Markup::raw(fmt::format("<{0}{1}{2}>{3}</{0}>", name, space ? " " : "", attributes, content.html()));
}

std::string attribute(std::string_view name, std::string_view text) {
    return fmt::format(" {}=\"{}\"", name, escaped(text));
}

Markup code(std::string_view text) { return tag("code", text); }

Markup paragraph(const Markup& content) { return tag("p", content) + Markup::raw("\n"); }

Markup folded(const Markup& title, const Markup& content, bool open) {
    return tag("details", open ? "open=\"open\"" : "", tag("summary", title) + Markup::raw("\n") + content) +
           Markup::raw("\n");
}

Markup list_of(const std::vector<std::string>& points) {
    Markup items;
    for (const auto& point : points) items += tag("li", point);
    return items.empty() ? items : tag("ul", items) + Markup::raw("\n");
}

Markup Table::markup(std::string_view id) const {
    // A column without any content is left out.
    std::vector<bool> used(columns_.size());
    for (const Row& row : rows_)
        for (std::size_t n = 0; n < row.cells.size(); ++n) used[n] = used[n] || !row.cells[n].empty();
    Markup head;
    for (std::size_t n = 0; n < columns_.size(); ++n)
        if (used[n])
            head += tag("th", columns_[n].number ? "scope=\"col\" class=\"n\"" : "scope=\"col\"", columns_[n].title);
    Markup body;
    for (const Row& row : rows_) {
        Markup cells;
        for (std::size_t n = 0; n < row.cells.size(); ++n)
            if (used[n]) cells += tag("td", columns_[n].number ? "class=\"n\"" : "", row.cells[n]);
        body += tag("tr", row.style.empty() ? std::string() : fmt::format("class=\"{}\"", row.style), cells) +
                Markup::raw("\n");
    }
    const auto table = tag("table", id.empty() ? std::string() : fmt::format("id=\"{}\"", id),
                           tag("thead", tag("tr", head)) + Markup::raw("\n") + tag("tbody", body));
    return tag("div", "class=\"wide\"", table) + Markup::raw("\n");
}

}  // namespace margay::segment_report
