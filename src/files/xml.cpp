#include "files/xml.hpp"

#include "files/xml_encoding.hpp"
#include "files/xml_form.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <memory>

#include <sys/stat.h>

namespace margay::files {
namespace {

struct CloseReadFile {
    void operator()(std::FILE* file) const { (void)std::fclose(file); }
};

struct FreeText {
    void operator()(char* text) const { std::free(text); }
};

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
    while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
    return text;
}

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; }

int digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    const char l = lower(c);
    return l >= 'a' && l <= 'f' ? l - 'a' + 10 : -1;
}

bool has_prefix(std::string_view text, std::string_view prefix) {
    return text.size() >= prefix.size() && same_word(text.substr(0, prefix.size()), prefix);
}

// The name of the encoding in the XML declaration, in lower case; empty: there is none.
std::string declared_encoding(std::string_view octets) {
    if (!octets.starts_with("<?xml")) return {};
    const std::string_view declaration = octets.substr(0, octets.find("?>"));
    const auto at = declaration.find("encoding");
    if (at == std::string_view::npos) return {};
    const auto begin = declaration.find_first_of("'\"", at);
    if (begin == std::string_view::npos) return {};
    const auto end = declaration.find(declaration[begin], begin + 1);
    if (end == std::string_view::npos) return {};
    std::string name(declaration.substr(begin + 1, end - begin - 1));
    std::ranges::transform(name, name.begin(), lower);
    return name;
}

bool is_text(Node node) { return node.type() == pugi::node_pcdata || node.type() == pugi::node_cdata; }

// Comments and CDATA sections divide a text into several nodes: the first gets all of it.
void merge_text(Node first) {
    std::string all = first.value();
    for (Node next = first.next_sibling(); is_text(next); next = first.next_sibling()) {
        all += next.value();
        first.parent().remove_child(next);
    }
    first.set_value(all.c_str());
}

// Whether opening the file would wait for a program that writes. False for a pipe that is open already: the system
// names of descriptors (standard input, a pipe of the shell) are links.
bool is_fifo(const std::string& path) {
    struct stat found {};
    if (::lstat(path.c_str(), &found) != 0) return false;
    if (S_ISFIFO(found.st_mode)) return true;
    if (!S_ISLNK(found.st_mode) || path == "/dev/stdin" || path.starts_with("/dev/fd/") || path.starts_with("/proc/"))
        return false;
    const std::unique_ptr<char, FreeText> target(::realpath(path.c_str(), nullptr));
    return target != nullptr && ::lstat(target.get(), &found) == 0 && S_ISFIFO(found.st_mode);
}

}  // namespace

std::string to_text(const Remark& remark) {
    if (remark.line == 0) return remark.text;
    return "line " + std::to_string(remark.line) + ", column " + std::to_string(remark.column) + ": " + remark.text;
}

FileContent read_file(const std::string& path, std::size_t most_bytes) {
    const auto failed = [&path] { return FileContent{.error = path + ": cannot be read: " + std::strerror(errno)}; };
    if (is_fifo(path)) return {.error = path + ": is no file"};
    const std::unique_ptr<std::FILE, CloseReadFile> file(std::fopen(path.c_str(), "rb"));
    if (file == nullptr) return failed();
    FileContent content;
    std::vector<char> block(65536);
    while (const auto bytes = std::fread(block.data(), 1, block.size(), file.get())) {
        content.octets.append(block.data(), bytes);
        if (content.octets.size() > most_bytes)
            return {.error = path + ": has more than " + std::to_string(most_bytes) + " octets"};
    }
    if (std::ferror(file.get()) != 0) return failed();
    if (content.octets.empty()) return {.error = path + ": the file is empty"};
    return content;
}

std::string quoted(std::string_view text) {
    constexpr std::size_t kMost = 40;
    const auto octet = [text](std::size_t n) { return n < text.size() ? static_cast<unsigned char>(text[n]) : 0U; };
    std::size_t end = std::min(text.size(), kMost);
    while (end != 0 && (octet(end) & 0xC0) == 0x80) --end;  // whole characters of UTF-8
    std::string q = "'";
    for (std::size_t n = 0; n < end; ++n) {
        // U+0080 to U+009F: a terminal may execute these control characters.
        const bool c1 = octet(n) == 0xC2 && octet(n + 1) < 0xA0;
        const bool control = octet(n) < 0x20 || octet(n) == 0x7F || c1;
        q += control ? ' ' : text[n];
        n += c1 ? 1 : 0;
    }
    return q + (end < text.size() ? "…'" : "'");
}

std::string hex(std::uint64_t value, int digits) {
    char text[24];
    const int n = std::snprintf(text, sizeof(text), "0x%0*llx", digits, static_cast<unsigned long long>(value));
    return {text, static_cast<std::size_t>(n)};
}

bool same_word(std::string_view a, std::string_view b) {
    return std::ranges::equal(a, b, [](char x, char y) { return lower(x) == lower(y); });
}

Value content(Node node) {
    const std::string_view text = trimmed(node.text().get());
    return {node, node.name(), text, node && !text.empty()};
}

Value child(Node node, const char* name) { return content(node.child(name)); }

Value attribute(Node node, const char* name) {
    const auto found = node.attribute(name);
    const std::string_view text = trimmed(found.value());
    return {node, std::string("attribute ") + name + " of " + node.name(), text, found && !text.empty()};
}

Number parse_number(std::string_view text) {
    text = trimmed(text);
    Number number;
    if (!text.empty() && (text.front() == '+' || text.front() == '-')) {
        number.negative = text.front() == '-';
        text.remove_prefix(1);
    }
    int base = 10;
    for (const std::string_view prefix : {"#x", "0x"}) {
        if (!has_prefix(text, prefix)) continue;
        number.odd_notation = base == 16;
        base = 16;
        text.remove_prefix(prefix.size());
    }
    const char* const end = text.data() + text.size();
    const auto [stopped, error] = std::from_chars(text.data(), end, number.magnitude, base);
    number.valid = error == std::errc{} && stopped == end;
    return number;
}

Remark Reader::remark_at(Node at, std::string text) const {
    const std::ptrdiff_t offset = at ? at.offset_debug() : -1;
    if (offset < 0) return {.text = std::move(text)};
    const auto line = std::ranges::upper_bound(lines_, static_cast<std::size_t>(offset));
    const auto number = static_cast<std::uint32_t>(line - lines_.begin());
    return {number, static_cast<std::uint32_t>(static_cast<std::size_t>(offset) - *std::prev(line) + 1),
            std::move(text)};
}

void Reader::remark(Node at, std::string text) {
    if (failed_) return;  // after a problem, the value does not come from the file
    if (remarks_.size() == kMostRemarks) remarks_.push_back({.text = "there are more remarks than are listed"});
    if (remarks_.size() > kMostRemarks) return;
    remarks_.push_back(remark_at(at, std::move(text)));
}

void Reader::fail(Node at, std::string text) {
    if (failed_) return;
    failed_ = true;
    problem_ = remark_at(at, std::move(text));
}

bool Reader::expand(Node at, std::size_t count) {
    constexpr std::size_t kMost = 1'000'000;
    if (count <= kMost - expanded_) {
        expanded_ += count;
        return true;
    }
    fail(at, "the file stands for more than " + std::to_string(kMost) + " commands, subindices and entries");
    return false;
}

Remark Reader::take_problem() {
    failed_ = false;
    return std::move(problem_);
}

bool Reader::refuse(std::size_t offset, std::string text) {
    const auto line = std::ranges::upper_bound(lines_, offset);
    failed_ = true;
    problem_ = {static_cast<std::uint32_t>(line - lines_.begin()),
                static_cast<std::uint32_t>(offset - *std::prev(line) + 1), std::move(text)};
    return false;
}

bool Reader::open(std::string_view octets) {
    lines_ = {0};
    if (octets.starts_with("\xEF\xBB\xBF")) octets.remove_prefix(3);
    if (octets.starts_with("\xFF\xFE") || octets.starts_with("\xFE\xFF"))
        return refuse(0, "the file is UTF-16, which is not supported: convert it to UTF-8");
    // Projects of configuration tools are such archives.
    if (octets.starts_with("\x1F\x8B")) return refuse(0, "the file is compressed by gzip, and is no XML");
    if (octets.starts_with("PK\x03\x04")) return refuse(0, "the file is a ZIP archive, and is no XML");
    if (const auto zero = octets.find('\0'); zero != std::string_view::npos) {
        for (std::size_t n = 0; n < zero; ++n)
            if (octets[n] == '\n') lines_.push_back(n + 1);
        return refuse(zero, "a zero octet is no XML");
    }
    const std::string encoding = declared_encoding(octets);
    const bool latin1 = encoding == "iso-8859-1" || encoding == "latin1";
    const bool windows = encoding == "windows-1252";
    if (!latin1 && !windows && !encoding.empty() && encoding != "utf-8" && encoding != "us-ascii")
        return refuse(0, "the encoding " + quoted(encoding) + " is not supported: convert the file to UTF-8");
    const bool wrong = !latin1 && !windows && !wire::sii::is_utf8(std::as_bytes(std::span(octets)));
    text_ = windows ? from_windows_1252(octets) : latin1 || wrong ? from_latin1(octets) : std::string(octets);
    for (std::size_t n = 0; n < text_.size(); ++n)
        if (text_[n] == '\n') lines_.push_back(n + 1);
    if (const auto fault = form_fault(text_)) return refuse(fault->offset, "no well-formed XML: " + fault->text);
    // The document is parsed as a fragment. Otherwise text outside of the root element would not be found.
    constexpr unsigned kWanted = pugi::parse_default | pugi::parse_doctype | pugi::parse_fragment;
    const auto parsed = document_.load_buffer(text_.data(), text_.size(), kWanted, pugi::encoding_utf8);
    if (!parsed)
        return refuse(std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(parsed.offset, 0)), text_.size()),
                      std::string("no well-formed XML: ") + parsed.description());
    if (!check_top() || !check_tree()) return false;
    if (wrong) remark({}, "the file is declared or taken as UTF-8 and is not: it is read as ISO 8859-1");
    return true;
}

// Checks that the document has one root element. After it there may be another file, or the rest of a longer file.
bool Reader::check_top() {
    bool any = false;
    for (const Node at : document_.children()) {
        const bool element = at.type() == pugi::node_element;
        auto offset = static_cast<std::size_t>(std::max<std::ptrdiff_t>(at.offset_debug(), 0));
        while (offset < text_.size() && is_blank(text_[offset])) ++offset;
        if (element && any) return refuse(offset, "no well-formed XML: a second element beside the root element");
        if (is_text(at)) return refuse(offset, "no well-formed XML: text outside of the root element");
        any |= element;
    }
    return true;
}

// pugixml accepts two attributes of the same name.
bool Reader::check_attributes(Node at) {
    std::vector<std::string_view> names;
    for (const auto& one : at.attributes()) names.emplace_back(one.name());
    std::ranges::sort(names);
    const auto twice = std::ranges::adjacent_find(names);
    if (twice == names.end()) return true;
    const auto offset = static_cast<std::size_t>(std::max<std::ptrdiff_t>(at.offset_debug(), 0));
    return refuse(offset, "no well-formed XML: " + std::string(at.name()) + " has two attributes " + quoted(*twice));
}

// Visits the tree without recursion.
bool Reader::check_tree() {
    unsigned depth = 0;
    Node at = document_;
    for (;;) {
        if (at.type() == pugi::node_doctype) {
            const auto offset = at.offset_debug();
            return refuse(offset < 0 ? 0 : static_cast<std::size_t>(offset),
                          "a document type (DOCTYPE, entities of its own) is not accepted");
        }
        if (!check_attributes(at)) return false;
        if (is_text(at) && is_text(at.next_sibling())) merge_text(at);
        if (at.first_child()) {
            at = at.first_child();
            if (++depth > kMostDepth) {
                fail(at, "elements are nested deeper than " + std::to_string(kMostDepth) + " levels");
                return false;
            }
            continue;
        }
        while (at && !at.next_sibling()) {
            at = at.parent();
            if (depth > 0) --depth;
        }
        if (!at) break;
        at = at.next_sibling();
    }
    return root() || refuse(0, "no well-formed XML: the file has no element");
}

Number Reader::checked_number(const Value& value) {
    const Number number = parse_number(value.text);
    if (!number.valid) fail(value.at, value.name + " is " + quoted(value.text) + ", which is no number of 64 bits");
    if (number.valid && number.odd_notation)
        remark(value.at,
               value.name + " has two prefixes, " + quoted(value.text) + ": read as " + hex(number.magnitude));
    return number;
}

std::uint64_t Reader::unsigned_number(const Value& value, std::uint64_t fallback, std::uint64_t most) {
    if (!value.there) return fallback;
    const Number number = checked_number(value);
    if (!number.valid) return fallback;
    if ((!number.negative || number.magnitude == 0) && number.magnitude <= most) return number.magnitude;
    fail(value.at, value.name + " is " + quoted(value.text) + ", which is not between 0 and " + std::to_string(most));
    return fallback;
}

std::int64_t Reader::signed_number(const Value& value, std::int64_t fallback, std::int64_t least, std::int64_t most) {
    if (!value.there) return fallback;
    const Number number = checked_number(value);
    if (!number.valid) return fallback;
    constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    if (number.magnitude <= kMost) {
        const auto magnitude = static_cast<std::int64_t>(number.magnitude);
        const std::int64_t signed_value = number.negative ? -magnitude : magnitude;
        if (signed_value >= least && signed_value <= most) return signed_value;
    }
    fail(value.at, value.name + " is " + quoted(value.text) + ", which is not between " + std::to_string(least) +
                       " and " + std::to_string(most));
    return fallback;
}

bool Reader::boolean(const Value& value, bool fallback) {
    if (!value.there) return fallback;
    if (value.text == "1" || same_word(value.text, "true")) return true;
    if (value.text == "0" || same_word(value.text, "false")) return false;
    fail(value.at, value.name + " is " + quoted(value.text) + ", which is neither true nor false");
    return fallback;
}

std::vector<std::byte> Reader::octets(const Value& value) {
    std::vector<std::byte> result;
    int high = -1;
    for (const char c : value.text) {
        if (is_blank(c)) continue;
        const int d = digit(c);
        if (d < 0) {
            fail(value.at, value.name + " has '" + (static_cast<unsigned char>(c) < 0x80 ? std::string(1, c) : "…") +
                               "', which is no hexadecimal digit");
            return {};
        }
        if (high < 0) {
            high = d;
        } else {
            result.push_back(static_cast<std::byte>(high * 16 + d));
            high = -1;
        }
    }
    if (high >= 0) {
        fail(value.at, value.name + " has an odd number of hexadecimal digits");
        return {};
    }
    return result;
}

}  // namespace margay::files
