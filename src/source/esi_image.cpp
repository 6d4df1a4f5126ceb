#include "source/esi_image.hpp"

#include "source/sii_file.hpp"

#include <margay/files/esi.hpp>

#include <fmt/format.h>

#include <algorithm>
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
        result.error = fmt::format("{}: describes {} devices; choose one of them, in a SOURCE by sim:{}#TYPE:{}", file,
                                   esi->devices.size(), file, device_list(*esi));
        return result;
    }
    const files::EsiDevice* device = type.empty() ? &esi->devices.front() : files::find_device(*esi, type);
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
    for (const std::string& remark : image.remarks) result.remarks.push_back(fmt::format("{}: {}", file, remark));
    result.octets = std::move(image.octets);
    result.type = device->type;
    return result;
}

EsiImage esi_image(const std::string& path) {
    const auto [file, type] = split(path);
    return esi_image(file, type);
}

}  // namespace margay::hosted
