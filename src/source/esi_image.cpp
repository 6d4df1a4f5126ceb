#include "source/esi_image.hpp"

#include "source/sii_file.hpp"

#include <margay/files/esi.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>

namespace margay::hosted {
namespace {

std::string device_list(const files::EsiFile& esi) {
    std::string list;
    for (const files::EsiDevice& device : esi.devices)
        list += fmt::format("\n  {} (product 0x{:08x}, revision 0x{:08x}): {}", device.type, device.identity.product,
                            device.identity.revision, device.name);
    return list;
}

std::pair<std::string, std::string> split(const std::string& path) {
    const auto at = path.rfind(".xml#");
    if (at == std::string::npos) return {path, {}};
    return {path.substr(0, at + 4), path.substr(at + 5)};
}

// The device of an order code or a name, or of TYPE/REVISION. If there are several revisions, the greatest one, with a
// remark.
const files::EsiDevice* choose(const files::EsiFile& esi, const std::string& wanted,
                               std::vector<std::string>& remarks) {
    const auto is = [](const files::EsiDevice& device, std::string_view type) {
        return device.type == type || device.name == type;
    };
    if (const auto* device = files::find_device(esi, wanted); device != nullptr) {
        const auto revisions = std::ranges::count_if(esi.devices, [&](const auto& one) { return is(one, wanted); });
        if (revisions > 1)
            remarks.push_back(
                fmt::format("of {} revisions of {} the greatest is taken, 0x{:08x}; another one by {}/REVISION",
                            revisions, wanted, device->identity.revision, wanted));
        return device;
    }
    const auto slash = wanted.rfind('/');
    if (slash == std::string::npos) return nullptr;
    const std::string_view type = std::string_view(wanted).substr(0, slash);
    std::string_view digits = std::string_view(wanted).substr(slash + 1);
    const int base = digits.starts_with("0x") ? 16 : 10;
    if (base == 16) digits.remove_prefix(2);
    std::uint32_t revision = 0;
    const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), revision, base);
    if (digits.empty() || read.ec != std::errc{} || read.ptr != digits.data() + digits.size()) return nullptr;
    const auto found = std::ranges::find_if(
        esi.devices, [&](const auto& one) { return is(one, type) && one.identity.revision == revision; });
    return found == esi.devices.end() ? nullptr : &*found;
}

// The first remark about a device that the reader has left out because of a fault; empty: there is none.
std::string left_out(const std::vector<std::string>& remarks, std::string_view device) {
    const auto found = std::ranges::find_if(remarks, [&](const std::string& remark) {
        return remark.find(device) != std::string::npos && remark.find(" is left out: ") != std::string::npos;
    });
    return found == remarks.end() ? std::string() : *found;
}

}  // namespace

bool names_esi(const std::string& path) { return split(path).first.ends_with(".xml"); }

EsiImage esi_image(const std::string& file, const std::string& type) {
    if (auto odd = odd_file(file); !odd.empty()) return {.error = std::move(odd)};
    const auto content = files::read_file(file);
    if (!content.error.empty()) return {.error = content.error};
    const auto esi = files::read_esi(content.octets);
    if (!esi) return {.error = fmt::format("{}: {}", file, to_text(esi.problem))};
    EsiImage result;
    for (const files::Remark& remark : esi.remarks)
        result.remarks.push_back(fmt::format("{}: {}", file, to_text(remark)));
    if (esi->devices.empty()) {
        result.error = left_out(result.remarks, "Device '");
        if (result.error.empty()) result.error = fmt::format("{}: describes modules only, and no device", file);
        return result;
    }
    if (type.empty() && esi->devices.size() > 1) {
        result.error = fmt::format(
            "{}: describes {} devices; choose one of them by TYPE or TYPE/REVISION, in a SOURCE by sim:{}#TYPE or "
            "sim:{}#TYPE/REVISION:{}",
            file, esi->devices.size(), file, file, device_list(*esi));
        result.needs_type = true;
        return result;
    }
    std::vector<std::string> remarks;
    const files::EsiDevice* device = type.empty() ? &esi->devices.front() : choose(*esi, type, remarks);
    if (device == nullptr) {
        result.error = left_out(result.remarks, fmt::format("Device '{}' is", type));
        if (!result.error.empty()) return result;
        result.error = fmt::format("{}: describes no device '{}'; it describes:{}", file, type, device_list(*esi));
        return result;
    }
    files::SiiImage image = files::make_sii(*device);
    if (!image) {
        result.error = fmt::format("{}: line {}: {}", file, device->line, image.error);
        return result;
    }
    remarks.insert(remarks.end(), image.remarks.begin(), image.remarks.end());
    for (const std::string& remark : remarks) result.remarks.push_back(fmt::format("{}: {}", file, remark));
    result.octets = std::move(image.octets);
    result.type = device->type;
    return result;
}

EsiImage esi_image(const std::string& path) {
    const auto [file, type] = split(path);
    return esi_image(file, type);
}

}  // namespace margay::hosted
