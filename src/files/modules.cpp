// The modules of a slave: the configured list (object 0xF030) and the detected one (0xF050).
#include <margay/files/esi.hpp>
#include <margay/margay.hpp>

#include "files/modules.hpp"
#include "files/said.hpp"
#include "files/xml.hpp"

#include <algorithm>

namespace margay::files {
namespace {

constexpr std::size_t kMostSlots = 255;

std::uint32_t ident_at(std::span<const std::byte> octets, std::size_t at) {
    std::uint32_t ident = 0;
    for (std::size_t n = 0; n < sizeof(ident) && at + n < octets.size(); ++n)
        ident |= std::to_integer<std::uint32_t>(octets[at + n]) << (8 * n);
    return ident;
}

}  // namespace

std::vector<std::uint32_t> configured_modules(std::span<const StartupCommand> commands) {
    std::vector<std::uint32_t> idents;
    const auto set = [&](std::size_t slot, std::uint32_t ident) {
        if (slot >= kMostSlots) return;
        if (idents.size() <= slot) idents.resize(slot + 1);
        idents[slot] = ident;
    };
    for (const StartupCommand& one : commands) {
        if (one.kind != StartupCommand::Kind::write_object || one.index != kConfiguredModules) continue;
        const auto octets = one.octets();
        if (!one.complete_access) {
            if (one.subindex != 0) set(one.subindex - 1U, ident_at(octets, 0));
            continue;
        }
        // A write from subindex 0 on begins with the number of modules in two octets.
        std::size_t slot = 0;
        for (std::size_t at = one.subindex == 0 ? 2 : 0; at + 4 <= octets.size(); at += 4)
            set(slot++, ident_at(octets, at));
    }
    return idents;
}

Result<OtherModule> find_other_module(Context& ctx, std::uint16_t slave, std::span<const std::uint32_t> wanted) {
    const auto count = SDOread<std::uint8_t>(ctx, slave, kDetectedModules, 0);
    if (!count) return count.error();
    while (!wanted.empty() && wanted.back() == 0) wanted = wanted.first(wanted.size() - 1);
    for (std::size_t slot = 0; slot < std::max<std::size_t>(wanted.size(), *count); ++slot) {
        std::uint32_t found = 0;
        if (slot < *count) {
            const auto ident =
                SDOread<std::uint32_t>(ctx, slave, kDetectedModules, static_cast<std::uint8_t>(slot + 1));
            if (!ident) return ident.error();
            found = *ident;
        }
        const std::uint32_t expected = slot < wanted.size() ? wanted[slot] : 0;
        if (found != expected) return OtherModule{true, slot, expected, found};
    }
    return OtherModule{};
}

std::string check_modules(Context& ctx, std::uint16_t slave, std::span<const std::uint32_t> wanted) {
    const auto other = find_other_module(ctx, slave, wanted);
    if (!other) return said(other.error());
    if (!other->there) return {};
    return "slave " + std::to_string(slave) + ", slot " + std::to_string(other->slot) + ": module " +
           hex(other->found, 8) + " is there, and " + hex(other->wanted, 8) + " is wanted";
}

std::vector<std::uint32_t> modules_in_use(Context& ctx, std::uint16_t slave) {
    std::vector<std::uint32_t> idents;
    const auto count = SDOread<std::uint8_t>(ctx, slave, kConfiguredModules, 0);
    if (!count) return idents;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto ident = SDOread<std::uint32_t>(ctx, slave, kConfiguredModules, static_cast<std::uint8_t>(n));
        if (!ident) return {};
        idents.push_back(*ident);
    }
    const bool any = std::ranges::any_of(idents, [](std::uint32_t ident) { return ident != 0; });
    return any ? idents : std::vector<std::uint32_t>();
}

}  // namespace margay::files
