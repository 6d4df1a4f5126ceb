#include "layers/source_tree.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <iterator>

namespace margay::layers {
namespace {

bool word_character(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// The end of the literal or comment that begins at `at`; `at` itself when none begins there.
std::size_t end_of_blank(std::string_view code, std::size_t at) {
    const auto end_or_all = [&](std::size_t found, std::size_t length) {
        return found == std::string_view::npos ? code.size() : found + length;
    };
    if (code.substr(at, 2) == "//") return end_or_all(code.find('\n', at), 0);
    if (code.substr(at, 2) == "/*") return end_or_all(code.find("*/", at + 2), 2);
    if (code.substr(at, 2) == "R\"" && (at == 0 || !word_character(code[at - 1]))) {
        const auto open = code.find('(', at);
        if (open == std::string_view::npos) return code.size();
        const auto close = ")" + std::string(code.substr(at + 2, open - at - 2)) + "\"";
        return end_or_all(code.find(close, open), close.size());
    }
    // A quote between digits is a digit separator: 1'000.
    const bool quote = code[at] == '"' || (code[at] == '\'' && (at == 0 || !word_character(code[at - 1])));
    if (!quote) return at;
    for (auto i = at + 1; i < code.size(); ++i) {
        if (code[i] == '\\')
            ++i;
        else if (code[i] == code[at] || code[i] == '\n')
            return i + 1;
    }
    return code.size();
}

}  // namespace

std::string text_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

SourceTree load_tree(const std::filesystem::path& top) {
    SourceTree tree;
    for (const auto* folder : {"include", "src", "osal", "oshw", "samples", "test"}) {
        if (!std::filesystem::exists(top / folder)) continue;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(top / folder)) {
            const auto extension = entry.path().extension();
            if (!entry.is_regular_file() || (extension != ".hpp" && extension != ".cpp")) continue;
            tree.push_back({entry.path().lexically_relative(top).generic_string(), text_of(entry.path())});
        }
    }
    std::sort(tree.begin(), tree.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
    return tree;
}

std::string strip(std::string_view code) {
    std::string out(code);
    for (std::size_t at = 0; at < code.size();) {
        const auto end = end_of_blank(code, at);
        for (auto i = at; i < end; ++i)
            if (out[i] != '\n') out[i] = ' ';
        at = std::max(end, at + 1);
    }
    return out;
}

std::vector<std::string_view> lines_of(std::string_view text) {
    std::vector<std::string_view> lines;
    while (!text.empty()) {
        const auto end = text.find('\n');
        lines.push_back(text.substr(0, end));
        text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    }
    return lines;
}

std::string layer_of(std::string_view path) {
    if (path == "oshw/nic.hpp") return "nic contract";
    if (path == "osal/osal.hpp") return "osal contract";
    const auto folder = path.substr(0, std::min(path.rfind('/'), path.size()));
    const auto below = [&](std::string_view top) {
        return folder == top || (folder.substr(0, top.size()) == top && folder[top.size()] == '/');
    };
    if (below("include/margay/files")) return "files";      // the public headers of src/files
    if (below("include/margay/attach")) return "attach";    // of src/attach
    if (below("include/margay/gateway")) return "gateway";  // of src/gateway
    if (below("include/margay")) return "include";
    if (below("samples")) return "samples";
    if (below("test")) return "test";
    if (folder == "src") return "api";
    if (below("src")) return std::string(folder.substr(4, folder.find('/', 4) - 4));
    if (below("osal") || below("oshw")) return std::string(folder.substr(0, folder.find('/', 5)));
    return {};
}

std::string joined(const Faults& faults) {
    std::string all;
    for (const auto& fault : faults) all += "\n" + fault;
    return all;
}

}  // namespace margay::layers
