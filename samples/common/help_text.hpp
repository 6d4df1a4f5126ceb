// Functions for the text of --help and of manual pages, for programs that generate both from a table.
#pragma once

#include <string>
#include <string_view>

namespace margay::samples {

// Wraps the text to lines of up to 100 characters, each after `indent` blanks. The first line continues a line with
// `used` characters.
[[nodiscard]] std::string wrapped(std::string_view text, std::size_t indent, std::size_t used = 0);
// A row of a list: `left`, and the text from column `indent` on.
[[nodiscard]] std::string row(std::string_view left, std::string_view text, std::size_t indent);

// Escapes a text so that roff prints it unchanged.
[[nodiscard]] std::string escaped(std::string_view text);
// A paragraph of a manual page with a name in bold.
[[nodiscard]] std::string man_entry(std::string_view name, std::string_view text);

}  // namespace margay::samples
