// Reads XML with bounds: the document, the values in it, and remarks with line and column. Refuses contents that the
// XML library accepts and a configuration must not have: document types, entities that a file defines, unlimited depth
// and size.
#pragma once

#include <margay/files/text_place.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace margay::files {

using Node = pugi::xml_node;

// A value of the document: the content of an element or an attribute. `text` has no blanks around it.
struct Value {
    Node at{};           // the element, for line and column
    std::string name{};  // for sentences: "BitLen", "attribute Sm of Sm"
    std::string_view text{};
    bool there = false;  // the element or attribute exists and is not empty
};
[[nodiscard]] Value content(Node node);
[[nodiscard]] Value child(Node node, const char* name);
[[nodiscard]] Value attribute(Node node, const char* name);
[[nodiscard]] constexpr bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
// Compares without regard to upper and lower case.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b);

// A number in one of the notations of the two formats.
struct Number {
    std::uint64_t magnitude = 0;
    bool negative = false;
    bool valid = false;         // it is a number of at most 64 bits
    bool odd_notation = false;  // "#x0x12": two prefixes
};
[[nodiscard]] Number parse_number(std::string_view text);

class Reader {
  public:
    static constexpr unsigned kMostDepth = 64;
    static constexpr std::size_t kMostRemarks = 200;

    // Parses the octets. Returns false if they are no XML document that this reader accepts; problem() has the reason.
    bool open(std::string_view octets);
    [[nodiscard]] Node root() const { return document_.document_element(); }

    [[nodiscard]] std::uint32_t line_of(Node at) const { return remark_at(at, {}).line; }
    [[nodiscard]] Remark remark_at(Node at, std::string text) const;
    // Adds a remark. No effect while a problem is stored, because the remaining remarks would concern values that the
    // file does not contain.
    void remark(Node at, std::string text);
    // Stores the first problem; later ones are ignored until take_problem().
    void fail(Node at, std::string text);
    [[nodiscard]] bool failed() const { return failed_; }
    // Some elements are expanded to many: an object to the subindices of its type, a broadcast to one command for each
    // slave. Counts the results. If a file exceeds the number of any real file, the reader fails, and the function
    // returns false.
    bool expand(Node at, std::size_t count);
    // Returns the problem and forgets it.
    Remark take_problem();
    [[nodiscard]] std::vector<Remark> take_remarks() { return std::move(remarks_); }

    // Reads a value. If the text is no value of the type, the reader fails, and the function returns the fallback. For
    // an absent value it returns the fallback, too.
    template <class T>
    [[nodiscard]] T number(const Value& value, T fallback = T{}) {
        using Limits = std::numeric_limits<T>;
        if constexpr (std::is_signed_v<T>)
            return static_cast<T>(signed_number(value, fallback, Limits::min(), Limits::max()));
        else
            return static_cast<T>(unsigned_number(value, fallback, Limits::max()));
    }
    // The same; an absent value is a problem.
    template <class T>
    [[nodiscard]] T required(Node parent, const char* name) {
        const Value value = child(parent, name);
        if (!value.there) fail(parent, std::string(parent.name()) + " has no " + name);
        return number<T>(value);
    }
    [[nodiscard]] bool boolean(const Value& value, bool fallback = false);
    // Octets in the order of the file.
    [[nodiscard]] std::vector<std::byte> octets(const Value& value);
    [[nodiscard]] static std::string text(const Value& value) { return std::string(value.text); }

  private:
    bool refuse(std::size_t offset, std::string text);
    bool check_top();
    bool check_attributes(Node at);
    bool check_tree();
    std::uint64_t unsigned_number(const Value& value, std::uint64_t fallback, std::uint64_t most);
    std::int64_t signed_number(const Value& value, std::int64_t fallback, std::int64_t least, std::int64_t most);
    Number checked_number(const Value& value);

    std::string text_;                // UTF-8
    std::vector<std::size_t> lines_;  // offsets of the first octets of the lines
    pugi::xml_document document_;
    std::vector<Remark> remarks_;
    Remark problem_;
    std::size_t expanded_ = 0;
    bool failed_ = false;
};

// A text of the file for sentences: 'abc', shortened, without control characters.
[[nodiscard]] std::string quoted(std::string_view text);
// A number for sentences: "0x1c12".
[[nodiscard]] std::string hex(std::uint64_t value, int digits = 4);

}  // namespace margay::files
