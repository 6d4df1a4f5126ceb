#include "common/xml_files.hpp"

#include "common/program.hpp"
#include "common/slave_report.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::samples {
EniFile load_eni(const std::string& path) {
    const auto content = files::read_file(path);
    if (!content.error.empty()) return {.error = content.error};
    auto eni = files::read_eni(content.octets);
    for (const files::Remark& remark : eni.remarks) warn(fmt::format("warning: {}: {}", path, to_text(remark)));
    if (!eni) return {.error = fmt::format("{}: {}", path, to_text(eni.problem))};
    return {.configuration = std::move(*eni)};
}

bool has_device(const files::EsiFile& esi, const Identity& identity) {
    return std::ranges::any_of(esi.devices, [&](const files::EsiDevice& device) {
        return device.identity.vendor == identity.vendor && device.identity.product == identity.product &&
               device.identity.revision == identity.revision;
    });
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
    if (!found) return found;
    for (const files::Remark& remark : files::remarks_after_scan(ctx, *eni))
        warn(fmt::format("warning: ENI file: {}", to_text(remark)));
    const auto told = files::check_modules(ctx, *eni);
    if (eni->clocks)
        if (const auto reference = configdc(ctx, *eni->clocks); !reference) {
            if (!told) warn(fmt::format("ENI file: {}", sentence(told.error())));  // only one error can be returned
            return reference.error();
        }
    if (!told) return told.error();
    return found;
}

Result<std::size_t> map_groups(Context& ctx, const files::EniConfiguration* eni, std::span<std::byte> image) {
    std::size_t sum = 0;
    Error first;
    const std::size_t groups = eni == nullptr ? 1 : std::max<std::size_t>(eni->groups.size(), 1);
    for (std::size_t n = 0; n < groups; ++n) {
        const auto used = config_map(ctx, image.subspan(sum), static_cast<std::uint8_t>(n));
        if (!used && first.code == Errc::none) first = used.error();
        sum += used ? *used : ctx.group(n).image.size();
    }
    if (first.code != Errc::none) return first;
    return sum;
}

}  // namespace margay::samples
