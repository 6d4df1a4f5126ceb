// Small files of /proc and /sys.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace margay::nic_check {

// The content without the line end. No value when the file cannot be read. A file may exist and refuse reading, or
// disappear during the reading.
[[nodiscard]] inline std::optional<std::string> text_of(const std::filesystem::path& path) {
    struct Close {
        void operator()(std::FILE* file) const { (void)std::fclose(file); }
    };
    const std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "rbe"));
    if (!file) return {};
    std::string text;
    for (int octet = std::getc(file.get()); octet != EOF; octet = std::getc(file.get()))
        text.push_back(static_cast<char>(octet));
    if (std::ferror(file.get()) != 0) return {};
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    return text;
}

[[nodiscard]] inline std::optional<long> number_of(const std::filesystem::path& path) {
    const auto text = text_of(path);
    if (!text || text->empty()) return {};
    char* end = nullptr;
    const long number = std::strtol(text->c_str(), &end, 10);
    if (end == text->c_str()) return {};
    return number;
}

}  // namespace margay::nic_check
