#include "source/sii_file.hpp"

#include "source/esi_image.hpp"
#include "wire/sii.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <optional>

namespace margay::hosted {
namespace {

std::optional<std::vector<std::byte>> read_file(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) return std::nullopt;
    const std::string content((std::istreambuf_iterator<char>(in)), {});
    std::vector<std::byte> bytes(content.size());
    std::transform(content.begin(), content.end(), bytes.begin(), [](char c) { return static_cast<std::byte>(c); });
    return bytes;
}

}  // namespace

std::string odd_file(const std::filesystem::path& path) {
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (error || !std::filesystem::is_other(status)) return {};
    return fmt::format("'{}' is no file", path.string());
}

std::string load_image(const std::filesystem::path& path, std::vector<std::byte>& image) {
    if (names_esi(path.string())) {
        auto made = esi_image(path.string());
        image = std::move(made.octets);
        return made.error;
    }
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        return fmt::format("'{}' is a folder, not an SII image", path.string());
    if (auto odd = odd_file(path); !odd.empty()) return odd;
    auto bytes = read_file(path);
    if (!bytes) return fmt::format("cannot read the SII image '{}'", path.string());
    if (bytes->size() < wire::sii::kFixedBytes)
        return fmt::format("'{}' is no SII image: {} octets, where the fixed part alone takes {}", path.string(),
                           bytes->size(), wire::sii::kFixedBytes);
    const auto printable = [](std::byte octet) {
        const auto c = std::to_integer<unsigned>(octet);
        return (c >= 0x20 && c < 0x7F) || c == '\n' || c == '\r' || c == '\t';
    };
    if (std::all_of(bytes->begin(), bytes->begin() + wire::sii::kFixedBytes, printable))
        return fmt::format("'{}' is text, not an SII image (the name of a segment description ends in .toml)",
                           path.string());
    if (bytes->size() > 4u * 1024 * 1024) return fmt::format("'{}' is larger than any EEPROM", path.string());
    image = std::move(*bytes);
    return {};
}

}  // namespace margay::hosted
