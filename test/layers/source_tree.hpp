// The sources of the project as data, so that the checks work on the real tree and on trees with faults.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace margay::layers {

struct SourceFile {
    std::string path;  // relative to the top of the project, with '/'
    std::string text;
};

using SourceTree = std::vector<SourceFile>;

// Loads all C++ files below include, src, osal, oshw, samples and test.
SourceTree load_tree(const std::filesystem::path& top);

// The content of a file; empty when it cannot be read.
std::string text_of(const std::filesystem::path& file);

// The text with comments, string literals and character literals replaced by blanks; line numbers do not change.
std::string strip(std::string_view code);

std::vector<std::string_view> lines_of(std::string_view text);

// The name of the folder in the table of layers: "include", "util" … "sim", "api" for src/ itself, "osal",
// "oshw/linux" …, "nic contract" and "osal contract" for the two headers, "samples", "test". Empty for a file outside
// all layers.
std::string layer_of(std::string_view path);

// One readable line per fault: "file:line: what".
using Faults = std::vector<std::string>;
std::string joined(const Faults& faults);

}  // namespace margay::layers
