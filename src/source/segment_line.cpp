#include "source/segment_line.hpp"

#include "source/esi_image.hpp"
#include "source/ready_made.hpp"
#include "source/sii_file.hpp"

#include "sim/devices.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <sstream>

namespace margay::hosted {
namespace {

bool is_device(const std::string& name) {
    return std::ranges::find(sim::device_names(), name) != sim::device_names().end();
}

// Reads a decimal number, and removes it from the text.
std::optional<std::uint32_t> number_before(std::string_view& text) {
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{}) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return value;
}

std::optional<std::uint16_t> alias_from(std::string_view text) {
    const auto alias = number_before(text);
    if (!alias || !text.empty() || *alias < 1 || *alias > 0xFFFF) return std::nullopt;
    return static_cast<std::uint16_t>(*alias);
}

// Reads a delay, and returns it in milliseconds.
std::optional<std::uint32_t> delay_from(std::string_view text) {
    const auto number = number_before(text);
    if (!number || *number > 1'000'000) return std::nullopt;
    if (text == "s") return *number * 1000;
    if (text == "ms") return *number;
    return std::nullopt;
}

// One slave of the line as [[slave]] of a description. Returns the error in words.
std::string describe_slave(const std::string& whole, std::string& description) {
    std::string name = whole;
    std::string keys;
    // A file may have these characters in its name.
    const auto is_file = [&name] { return names_esi(name) || std::filesystem::exists(name); };
    if (const auto at = name.rfind('@'); at != std::string::npos && !is_file()) {
        const auto delay = delay_from(std::string_view(name).substr(at + 1));
        if (!delay) return fmt::format("'{}': behind @ is a time, for example 3s or 500ms", whole);
        keys += fmt::format("power_after_ms = {}\n", *delay);
        name.resize(at);
    }
    if (const auto hash = name.rfind('#'); hash != std::string::npos && !is_file()) {
        const auto alias = alias_from(std::string_view(name).substr(hash + 1));
        if (!alias) return fmt::format("'{}': behind # is an alias, 1 to 65535", whole);
        keys += fmt::format("alias = {}\n", *alias);
        name.resize(hash);
    }
    if (is_device(name)) {
        description += fmt::format("[[slave]]\ndevice = \"{}\"\n{}", name, keys);
        return {};
    }
    if (is_plain_name(name) && !std::filesystem::exists(name))
        return fmt::format("'{}' is neither a file nor a ready-made segment; ready-made segments: {}; nor a device: {}",
                           name, fmt::join(ready_made_names(), ", "), fmt::join(sim::device_names(), ", "));
    std::vector<std::byte> image;
    if (auto fault = load_image(name, image); !fault.empty()) return fault;
    std::ostringstream quoted;
    quoted << toml::value<std::string>(std::filesystem::absolute(name).string());
    description += "[[slave]]\nsii = " + quoted.str() + "\n" + keys;
    return {};
}

}  // namespace

LineDescription describe_line(const std::string& line) {
    LineDescription result;
    for (std::size_t begin = 0; begin <= line.size();) {
        const std::size_t end = std::min(line.find(',', begin), line.size());
        result.error = describe_slave(line.substr(begin, end - begin), result.description);
        if (!result.error.empty()) return result;
        begin = end + 1;
    }
    return result;
}

}  // namespace margay::hosted
