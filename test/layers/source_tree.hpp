// The project's sources as data, so that the checks run on the real tree and on made-up bad ones alike.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace margay::layers {

struct SourceFile {
    std::string path;  // from the top of the project, with '/'
    std::string text;
};

using SourceTree = std::vector<SourceFile>;

// All C++ files below include, src, osal, oshw, samples and test.
SourceTree load_tree(const std::filesystem::path& top);

// The text with comments, string and character literals blanked out; lines stay where they are.
std::string strip(std::string_view code);

std::vector<std::string_view> lines_of(std::string_view text);

// The folder's name in the table of layers: "include", "util" … "sim", "api" for src/ itself, "osal",
// "oshw/linux" …, "nic contract" and "osal contract" for the two headers, "samples", "test"; empty for a file
// that has no place in the house.
std::string layer_of(std::string_view path);

// One readable line a fault: "file:line: what".
using Faults = std::vector<std::string>;
std::string joined(const Faults& faults);

}  // namespace margay::layers
