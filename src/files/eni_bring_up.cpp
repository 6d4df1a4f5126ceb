// Brings a segment up by an ENI file.
#include <margay/files/eni.hpp>
#include <margay/margay.hpp>

#include <algorithm>

namespace margay::files {

Result<> apply(Context& ctx, const EniConfiguration& eni) {
    if (eni.groups.size() > ctx.limits().groups)
        return Error{.code = Errc::unknown_group,
                     .step = Step::map_process_data,
                     .index = static_cast<std::uint16_t>(ctx.limits().groups)};
    for (std::size_t n = 0; n < eni.groups.size(); ++n) ctx.group(n).config = eni.groups[n].config;
    return expect(ctx, eni.expected());
}

Result<> bring_up(Context& ctx, const EniConfiguration& eni, std::span<std::byte> image) {
    if (const auto applied = apply(ctx, eni); !applied) return applied;
    if (const auto found = config_init(ctx); !found) return found.error();
    if (const auto told = check_modules(ctx, eni); !told) return told;
    if (eni.clocks)
        if (const auto reference = configdc(ctx, *eni.clocks); !reference) return reference.error();
    // Without a Cyclic element, the library reads the process data from the slaves.
    const std::size_t groups = std::max<std::size_t>(eni.groups.size(), 1);
    for (std::size_t n = 0; n < groups; ++n) {
        const auto used = config_map(ctx, image, static_cast<std::uint8_t>(n));
        if (!used) return used.error();
        image = image.subspan(*used);
    }
    return Result<>();
}

}  // namespace margay::files
