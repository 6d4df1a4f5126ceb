#include "common/help_text.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::samples {
namespace {

constexpr std::size_t kWidth = 100;

}  // namespace

std::string wrapped(std::string_view text, std::size_t indent, std::size_t used) {
    std::string out;
    std::size_t column = used;
    const auto begin_line = [&] {
        out += std::string(indent - std::min(column, indent), ' ');
        column = std::max(column, indent);
    };
    begin_line();
    bool first = true;
    for (std::size_t at = 0; at < text.size();) {
        const auto end = std::min(text.find(' ', at), text.size());
        const auto word = text.substr(at, end - at);
        if (!first && column + 1 + word.size() > kWidth) {
            out += '\n';
            column = 0;
            begin_line();
            first = true;
        }
        if (!first) out += ' ';
        column += word.size() + (first ? 0 : 1);
        out += word;
        first = false;
        at = end + 1;
    }
    return out + '\n';
}

std::string row(std::string_view left, std::string_view text, std::size_t indent) {
    std::string line = fmt::format("  {}", left);
    if (line.size() + 2 <= indent) return line + wrapped(text, indent, line.size());
    return line + '\n' + wrapped(text, indent);
}

std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : text) {
        if (c == '\\')
            out += "\\e";
        else if (c == '-')
            out += "\\-";
        else
            out += c;
    }
    if (out.starts_with('.') || out.starts_with('\'')) out.insert(0, "\\&");
    return out;
}

std::string man_entry(std::string_view name, std::string_view text) {
    // The macro .B is not used, because it removes the quotes of its arguments.
    return fmt::format(".TP\n\\fB{}\\fR\n{}\n", escaped(name), escaped(text));
}

}  // namespace margay::samples
