// Reads and writes image files; see eeprom.hpp.
#include "common/eeprom.hpp"
#include "common/intel_hex.hpp"
#include "common/new_file.hpp"
#include "common/program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace margay::samples {
namespace {

namespace fs = std::filesystem;

struct CloseFile {
    void operator()(std::FILE* file) const { (void)std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string failure(const std::string& path, std::string_view what) {
    return fmt::format("{}: {}: {}", path, what, std::strerror(errno));
}

}  // namespace

ImageFormat format_by_name(std::string_view path) {
    auto extension = fs::path(path).extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    const bool hex = extension == ".hex" || extension == ".ihex" || extension == ".ihx";
    return hex ? ImageFormat::intel_hex : ImageFormat::binary;
}

ImageFile load_image(const std::string& path) {
    constexpr std::size_t kMostOctets = std::size_t{64} * 1024 * 1024;
    const File opened(path == "-" ? nullptr : std::fopen(path.c_str(), "rb"));
    std::FILE* file = path == "-" ? stdin : opened.get();
    if (file == nullptr) return {.error = failure(path, "cannot be read")};
    std::string content;
    std::array<char, 4096> block{};
    while (const auto n = std::fread(block.data(), 1, block.size(), file)) {
        content.append(block.data(), n);
        if (content.size() > kMostOctets) return {.error = fmt::format("{}: too long for an image", path)};
    }
    if (std::ferror(file) != 0) return {.error = failure(path, "cannot be read")};
    if (content.empty()) return {.error = fmt::format("{}: the file is empty", path)};
    if (!looks_like_intel_hex(content)) {
        const auto octets = std::as_bytes(std::span(content));
        return {.octets = {octets.begin(), octets.end()}, .format = ImageFormat::binary};
    }
    auto parsed = parse_intel_hex(content);
    if (!parsed.error.empty()) return {.error = fmt::format("{}: {}", path, parsed.error)};
    return {.octets = std::move(parsed.octets), .format = ImageFormat::intel_hex};
}

std::string save_image(const std::string& path, ImageFormat format, Bytes image) {
    std::string content;
    if (format == ImageFormat::intel_hex)
        content = to_intel_hex(image);
    else
        std::ranges::transform(image, std::back_inserter(content), [](std::byte b) { return static_cast<char>(b); });
    if (path == "-") {
        write_out(content);  // run_program() reports a failure of the output
        return {};
    }
    NewFile file(path);
    const auto failed = file.write(content);
    return failed.empty() ? file.commit() : failed;
}

}  // namespace margay::samples
