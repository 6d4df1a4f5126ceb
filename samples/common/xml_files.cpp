#include "common/xml_files.hpp"

#include "common/program.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::samples {
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

}  // namespace

bool names_esi(const std::string& path) { return split(path).first.ends_with(".xml"); }

EsiImage esi_image(const std::string& file, const std::string& type) {
    const auto content = files::read_file(file);
    if (!content.error.empty()) return {.error = content.error};
    const auto esi = files::read_esi(content.octets);
    if (!esi) return {.error = fmt::format("{}: {}", file, to_text(esi.problem))};
    EsiImage result;
    for (const files::Remark& remark : esi.remarks)
        result.remarks.push_back(fmt::format("{}: {}", file, to_text(remark)));
    if (esi->devices.empty()) {
        result.error = fmt::format("{}: describes modules only, and no device", file);
        return result;
    }
    if (type.empty() && esi->devices.size() > 1) {
        result.error = fmt::format("{}: describes {} devices; choose one of them:{}", file, esi->devices.size(),
                                   device_list(*esi));
        return result;
    }
    const files::EsiDevice* device = type.empty() ? &esi->devices.front() : files::find_device(*esi, type);
    if (device == nullptr) {
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

EniFile load_eni(const std::string& path) {
    const auto content = files::read_file(path);
    if (!content.error.empty()) return {.error = content.error};
    auto eni = files::read_eni(content.octets);
    for (const files::Remark& remark : eni.remarks) warn(fmt::format("warning: {}: {}", path, to_text(remark)));
    if (!eni) return {.error = fmt::format("{}: {}", path, to_text(eni.problem))};
    return {.configuration = std::move(*eni)};
}

Limits with_room(Limits limits, const files::EniConfiguration* eni) {
    if (eni == nullptr) return limits;
    const Limits wanted = eni->limits();
    limits.slaves = std::max(limits.slaves, wanted.slaves);
    limits.groups = std::max(limits.groups, wanted.groups);
    limits.process_frames = std::max(limits.process_frames, wanted.process_frames);
    return limits;
}

Result<std::uint16_t> scan_by(Context& ctx, const files::EniConfiguration* eni) {
    if (eni == nullptr) return config_init(ctx);
    if (const auto applied = files::apply(ctx, *eni); !applied) return applied.error();
    const auto found = config_init(ctx);
    if (!found || !eni->clocks) return found;
    if (const auto reference = configdc(ctx, *eni->clocks); !reference) return reference.error();
    return found;
}

Result<std::size_t> map_groups(Context& ctx, const files::EniConfiguration* eni, std::span<std::byte> image) {
    std::size_t sum = 0;
    const std::size_t groups = eni == nullptr ? 1 : std::max<std::size_t>(eni->groups.size(), 1);
    for (std::size_t n = 0; n < groups; ++n) {
        const auto used = config_map(ctx, image.subspan(sum), static_cast<std::uint8_t>(n));
        if (!used) return used.error();
        sum += *used;
    }
    return sum;
}

}  // namespace margay::samples
