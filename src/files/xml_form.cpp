#include "files/xml_form.hpp"

#include "files/xml.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace margay::files {
namespace {

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
// Whether the character may be in a name. Characters beyond ASCII are not checked.
bool is_name(char c) {
    const bool ascii = static_cast<unsigned char>(c) < 0x80;
    return !ascii || is_letter(c) || is_digit(c) || c == '_' || c == ':' || c == '-' || c == '.';
}

bool is_character(std::uint32_t point) {
    if (point < 0x20) return point == '\t' || point == '\n' || point == '\r';
    return point < 0xD800 || (point >= 0xE000 && point < 0xFFFE) || (point >= 0x10000 && point < 0x110000);
}

class Checker {
  public:
    explicit Checker(std::string_view text) : text_(text) {}

    std::optional<FormFault> run() {
        if (has("\xEF\xBB\xBF")) fail(0, "a second byte order mark");
        if (has("<?xml") && !is_name(at(5))) declaration();
        while (!fault_ && at_ < text_.size() && !is_doctype()) step();
        // Characters are checked in the whole text. The first fault is reported.
        const std::size_t end = fault_ ? fault_->offset : at_;
        if (auto other = character_fault(end)) return other;
        return fault_;
    }

  private:
    [[nodiscard]] bool is_doctype() const { return at(0) == '<' && at(1) == '!' && !has("<!--") && !has("<![CDATA["); }

    void step() {
        switch (at(0)) {
            case '<': return markup();
            case '&': return reference();
            case ']':
                if (has("]]>")) return fail(at_, "']]>' in a text");
                break;
            default: break;
        }
        ++at_;
    }

    void markup() {
        if (has("<!--")) return comment();
        if (has("<![CDATA[")) return skip_behind("]]>");
        if (has("<?")) return instruction();
        tag();
    }

    [[nodiscard]] std::optional<FormFault> character_fault(std::size_t end) const {
        for (std::size_t n = 0; n < end; ++n) {
            const auto octet = static_cast<unsigned char>(text_[n]);
            if (!is_character(octet)) return FormFault{n, "the octet " + hex(octet, 2) + " is no character of XML"};
            const std::string_view three = text_.substr(n, 3);
            if (octet == 0xEF && (three == "\xEF\xBF\xBE" || three == "\xEF\xBF\xBF"))
                return FormFault{n, "U+FFFE and U+FFFF are no characters of XML"};
        }
        return std::nullopt;
    }

    // "&amp;", "&#181;": the offset is at the "&".
    void reference() {
        const std::size_t begin = at_++;
        const bool number = at(0) == '#';
        if (number) ++at_;
        const std::size_t name = at_;
        while (at_ < text_.size() && is_name(at(0))) ++at_;
        const std::string_view word = text_.substr(name, at_ - name);
        const std::string whole = quoted(text_.substr(begin, at_ - begin + (at(0) == ';' ? 1 : 0)));
        if (number) {
            if (word.empty() || at(0) != ';') return fail(begin, whole + " is no reference to a character");
            return character_reference(begin, word, whole);
        }
        if (word.empty() || at(0) != ';') return fail(begin, "an '&' that begins no reference: as a text it is &amp;");
        static constexpr std::array<std::string_view, 5> kEntities{"amp", "lt", "gt", "quot", "apos"};
        if (std::ranges::find(kEntities, word) == kEntities.end()) fail(begin, "the entity " + whole + " is unknown");
    }

    void character_reference(std::size_t begin, std::string_view digits, const std::string& whole) {
        const bool hexadecimal = digits.front() == 'x';
        if (hexadecimal) digits.remove_prefix(1);
        std::uint32_t point = 0;
        const char* const end = digits.data() + digits.size();
        const auto [stopped, error] = std::from_chars(digits.data(), end, point, hexadecimal ? 16 : 10);
        if (stopped != end || error == std::errc::invalid_argument)
            fail(begin, whole + " is no reference to a character");
        else if (error != std::errc{} || !is_character(point))
            fail(begin, whole + " refers to no character of XML");
    }

    void tag() {
        ++at_;
        char quote = 0;
        for (; !fault_ && at_ < text_.size(); ++at_) {
            const char c = at(0);
            if (quote == 0 && c == '>') break;
            if (quote == 0 && (c == '"' || c == '\'')) {
                quote = c;
            } else if (c == quote) {
                quote = 0;
            } else if (quote != 0 && c == '<') {
                fail(at_, "'<' in the value of an attribute");
            } else if (quote != 0 && c == '&') {
                reference();
            } else if (quote == 0 && c == '<') {
                return;  // the tag has no end: the XML library reports this
            }
        }
    }

    void comment() {
        at_ += 4;
        const std::size_t dashes = text_.find("--", at_);
        if (dashes != std::string_view::npos && !text_.substr(dashes).starts_with("-->"))
            return fail(dashes, "'--' in a comment");
        skip_behind("-->");
    }

    void instruction() {
        const std::size_t begin = at_;
        at_ += 2;
        const std::size_t name = at_;
        while (at_ < text_.size() && is_name(at(0))) ++at_;
        const std::string_view target = text_.substr(name, at_ - name);
        if (same_word(target, "xml")) return fail(begin, "an XML declaration that is not at the beginning of the file");
        if (!is_blank(at(0)) && !has("?>")) return fail(begin, "a processing instruction whose name has no end");
        skip_behind("?>");
    }

    // Checks the version, and then encoding and standalone if they are present.
    void declaration() {
        at_ += 5;
        const auto version = value_of("version");
        const bool is_version =
            version.size() >= 3 && version.starts_with("1.") && std::ranges::all_of(version.substr(2), is_digit);
        if (!is_version) return fail(0, "the XML declaration has no version 1.0");
        if (const std::size_t before = at_; next_is("encoding")) {
            const auto encoding = value_of("encoding");
            if (encoding.empty() || !is_letter(encoding.front())) return fail(before, "the encoding has no name");
        }
        if (const std::size_t before = at_; next_is("standalone")) {
            const auto standalone = value_of("standalone");
            if (standalone != "yes" && standalone != "no") return fail(before, "standalone is neither yes nor no");
        }
        skip_blanks();
        if (!has("?>")) return fail(at_, "the XML declaration has more than version, encoding and standalone");
        at_ += 2;
    }
    [[nodiscard]] bool next_is(std::string_view name) {
        const std::size_t before = at_;
        skip_blanks();
        const bool is = at_ != before && has(name);
        at_ = before;
        return is;
    }
    // Reads ' name="value"' and returns the value; empty: the text is different.
    std::string_view value_of(std::string_view name) {
        if (!next_is(name)) return {};
        skip_blanks();
        at_ += name.size();
        skip_blanks();
        if (at(0) != '=') return {};
        ++at_;
        skip_blanks();
        const char quote = at(0);
        const std::size_t end = quote == '"' || quote == '\'' ? text_.find(quote, at_ + 1) : std::string_view::npos;
        if (end == std::string_view::npos) return {};
        const auto value = text_.substr(at_ + 1, end - at_ - 1);
        at_ = end + 1;
        return value;
    }

    void skip_blanks() {
        while (is_blank(at(0))) ++at_;
    }
    // If the end is missing, the XML library reports this.
    void skip_behind(std::string_view end) {
        const std::size_t found = text_.find(end, at_);
        at_ = found == std::string_view::npos ? text_.size() : found + end.size();
    }
    [[nodiscard]] char at(std::size_t n) const { return at_ + n < text_.size() ? text_[at_ + n] : '\0'; }
    [[nodiscard]] bool has(std::string_view word) const { return text_.substr(at_).starts_with(word); }
    void fail(std::size_t offset, std::string text) {
        if (!fault_) fault_ = {offset, std::move(text)};
    }

    std::string_view text_;
    std::size_t at_ = 0;
    std::optional<FormFault> fault_;
};

}  // namespace

std::optional<FormFault> form_fault(std::string_view text) { return Checker(text).run(); }

}  // namespace margay::files
