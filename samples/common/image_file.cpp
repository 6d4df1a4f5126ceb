// Reads and writes image files; see eeprom.hpp.
#include "common/eeprom.hpp"
#include "common/intel_hex.hpp"
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

std::string save_to(std::FILE* file, const std::string& path, std::string_view content) {
    if (std::fwrite(content.data(), 1, content.size(), file) != content.size() || std::fflush(file) != 0)
        return failure(path, "cannot be written");
    return {};
}

// Writes to the file `at`. Errors name `path`, the name that the user gave.
std::string save_directly(const std::string& at, const std::string& path, std::string_view content) {
    const File file(std::fopen(at.c_str(), "wb"));
    return file ? save_to(file.get(), path, content) : failure(path, "cannot be written");
}

// Writes a new file beside the old one and renames it, so that the file has either the old or the new content.
std::string save_in_place(const std::string& path, std::string_view content) {
    std::error_code error;
    auto target = fs::canonical(path, error);
    const bool existed = !error;
    if (!existed) target = path;
    const auto beside = target.string() + ".new";
    auto failed = save_directly(beside, path, content);
    if (failed.empty() && existed) fs::permissions(beside, fs::status(target, error).permissions(), error);
    if (failed.empty() && std::rename(beside.c_str(), target.c_str()) != 0)
        failed = failure(path, "cannot be replaced");
    if (!failed.empty()) fs::remove(beside, error);
    return failed;
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
    std::error_code error;
    const auto kind = fs::status(path, error).type();
    const bool in_place = kind == fs::file_type::regular || kind == fs::file_type::not_found;
    return in_place ? save_in_place(path, content) : save_directly(path, path, content);
}

}  // namespace margay::samples
