// Pieces of an HTML page. Text becomes markup by escaping. Only Markup::raw() makes a Markup without escaping, so that
// a text of a slave cannot become a tag by mistake.
//
// The page is HTML and well-formed XML at the same time, so that programs can read it by either parser.
#pragma once

#include "common/counted.hpp"

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace margay::segment_report {

class Markup {
  public:
    Markup() = default;
    // Escapes the text. Octets that are no UTF-8, control characters and characters that change the direction of
    // writing become U+FFFD.
    Markup(std::string_view text);
    Markup(const std::string& text) : Markup(std::string_view(text)) {}
    Markup(const char* text) : Markup(std::string_view(text)) {}

    // For markup that this program writes itself.
    [[nodiscard]] static Markup raw(std::string html);

    Markup& operator+=(const Markup& more);
    [[nodiscard]] friend Markup operator+(Markup left, const Markup& right) { return left += right; }
    [[nodiscard]] const std::string& html() const { return html_; }
    [[nodiscard]] bool empty() const { return html_.empty(); }

  private:
    std::string html_{};
};

// <name attributes>content</name>. `attributes` is written as it is.
[[nodiscard]] Markup tag(std::string_view name, std::string_view attributes, const Markup& content);
[[nodiscard]] inline Markup tag(std::string_view name, const Markup& content) { return tag(name, {}, content); }
// ` name="text"`, with the text escaped.
[[nodiscard]] std::string attribute(std::string_view name, std::string_view text);
// Text in a font with digits of the same width.
[[nodiscard]] Markup code(std::string_view text);
[[nodiscard]] Markup paragraph(const Markup& content);
// A section that the reader can fold.
[[nodiscard]] Markup folded(const Markup& title, const Markup& content, bool open = false);
// A list of points; empty for no points.
[[nodiscard]] Markup list_of(const std::vector<std::string>& points);

// A table that scrolls by itself when the page is too narrow. Each row has a cell for each column; columns without any
// content are left out.
class Table {
  public:
    struct Column {
        std::string_view title;
        bool number = false;  // aligned to the right
    };
    struct Row {
        std::vector<Markup> cells{};
        std::string_view style{};  // class of the row
    };

    explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
    void add(std::vector<Markup> cells, std::string_view style = {}) { rows_.push_back({std::move(cells), style}); }
    [[nodiscard]] bool empty() const { return rows_.empty(); }
    [[nodiscard]] std::size_t size() const { return rows_.size(); }
    [[nodiscard]] Markup markup(std::string_view id = {}) const;

  private:
    std::vector<Column> columns_;
    std::vector<Row> rows_{};
};

// Names and values in two columns. A value that is empty is left out.
class Facts {
  public:
    void add(std::string_view name, const Markup& value) {
        if (!value.empty()) rows_ += tag("dt", name) + tag("dd", value);
    }
    [[nodiscard]] Markup markup() const { return rows_.empty() ? Markup() : tag("dl", rows_); }

  private:
    Markup rows_{};
};

using samples::counted;

}  // namespace margay::segment_report
