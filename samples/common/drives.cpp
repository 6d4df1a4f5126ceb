#include "common/drives.hpp"

#include "common/process_map.hpp"
#include "common/slave_report.hpp"

#include <margay/margay.hpp>

#include <fmt/format.h>

namespace margay::samples {
namespace {

constexpr std::uint16_t kDeviceType = 0x1000;
constexpr std::uint16_t kDriveProfile = 402;
constexpr std::uint16_t kControlWord = 0x6040;
constexpr std::uint32_t kControlWordBits = 16;
constexpr std::uint16_t kAxisSpacing = 0x800;
constexpr std::uint16_t kLastOfAxes = 0x9FFF;

// Modular devices use the same indices for other objects, with subindices from 1 on: 0x7040:1 is bit 5 of a digital
// output terminal.
bool is_control_word(const MapEntry& entry) {
    return entry.subindex == 0 && entry.bits == kControlWordBits && entry.index >= kControlWord &&
           entry.index <= kLastOfAxes && (entry.index - kControlWord) % kAxisSpacing == 0;
}

// The reason why the outputs of the slave may move an axis; empty: no such reason was found.
std::string why_drive(Context& ctx, const Slave& slave, const ProcessMap& map) {
    if ((slave.mailbox.protocols & mailbox_protocol::kSoE) != 0) return "a drive (SoE)";
    if ((slave.mailbox.protocols & mailbox_protocol::kCoE) != 0) {
        const auto type = SDOread<std::uint32_t>(ctx, slave.number, kDeviceType, 0);
        if (type && (*type & 0xFFFFU) == kDriveProfile) return "a drive (device profile 402)";
        if (!type && type.error().code != Errc::sdo_abort)
            return fmt::format("perhaps a drive ({})", sentence(type.error()));
    }
    for (const MapEntry& entry : map.entries) {
        if (entry.slave != slave.number || entry.direction != Direction::outputs) continue;
        if (is_control_word(entry)) return fmt::format("a drive (object 0x{:04X} in its outputs)", entry.index);
        if (entry.pdo == 0) return "perhaps a drive (nothing describes its outputs)";
    }
    return {};
}

}  // namespace

std::vector<Drive> find_drives(Context& ctx) {
    std::vector<Drive> drives;
    const ProcessMap map = read_process_map(ctx);
    for (const Slave& slave : ctx.slaves()) {
        if (slave.image.outputs.bits == 0) continue;
        if (auto why = why_drive(ctx, slave, map); !why.empty()) drives.push_back({slave.number, std::move(why)});
    }
    return drives;
}

}  // namespace margay::samples
