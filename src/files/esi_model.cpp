// Functions that only need the description of a device.
#include <margay/context.hpp>
#include <margay/files/esi.hpp>

#include "files/esi_types.hpp"
#include "files/xml.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace margay::files {
namespace {

struct BasicType {
    std::string_view name;
    std::uint8_t number;
};
// ETG.1000.6, base data types, and names that files in the field use for them.
constexpr BasicType kBasicTypes[] = {{"BOOL", 0x01},
                                     {"BOOLEAN", 0x01},
                                     {"BIT", 0x01},
                                     {"SINT", 0x02},
                                     {"INT8", 0x02},
                                     {"INT", 0x03},
                                     {"INT16", 0x03},
                                     {"DINT", 0x04},
                                     {"INT32", 0x04},
                                     {"USINT", 0x05},
                                     {"UINT8", 0x05},
                                     {"UINT", 0x06},
                                     {"UINT16", 0x06},
                                     {"UDINT", 0x07},
                                     {"UINT32", 0x07},
                                     {"REAL", 0x08},
                                     {"REAL32", 0x08},
                                     {"FLOAT", 0x08},
                                     {"LREAL", 0x11},
                                     {"REAL64", 0x11},
                                     {"LINT", 0x15},
                                     {"INT64", 0x15},
                                     {"ULINT", 0x1B},
                                     {"UINT64", 0x1B},
                                     {"VISIBLE_STRING", 0x09},
                                     {"OCTET_STRING", 0x0A},
                                     {"BYTE", 0x1E},
                                     {"WORD", 0x1F},
                                     {"DWORD", 0x20},
                                     {"UNICODE_STRING", 0x0B},
                                     {"TIME_OF_DAY", 0x0C},
                                     {"TIME_DIFFERENCE", 0x0D},
                                     {"INT24", 0x10},
                                     {"INT40", 0x12},
                                     {"INT48", 0x13},
                                     {"INT56", 0x14},
                                     {"UINT24", 0x16},
                                     {"UINT40", 0x18},
                                     {"UINT48", 0x19},
                                     {"UINT56", 0x1A},
                                     {"GUID", 0x1D},
                                     {"BITARR8", 0x2D},
                                     {"BITARR16", 0x2E},
                                     {"BITARR32", 0x2F}};

// "STRING(12)" and "BIT3": a name with a number.
bool is_numbered(std::string_view name, std::string_view prefix) {
    return name.size() > prefix.size() && same_word(name.substr(0, prefix.size()), prefix);
}

}  // namespace

std::uint8_t data_type_number(std::string_view name) {
    for (const BasicType& type : kBasicTypes)
        if (same_word(name, type.name)) return type.number;
    if (is_numbered(name, "STRING(") || same_word(name, "STRING")) return 0x09;
    if (is_numbered(name, "OCTET_STRING(")) return 0x0A;
    if (is_numbered(name, "BIT")) {
        unsigned bits = 0;
        const auto [end, error] = std::from_chars(name.data() + 3, name.data() + name.size(), bits);
        if (error == std::errc{} && end == name.data() + name.size() && bits >= 1 && bits <= 8)
            return static_cast<std::uint8_t>(0x30 + bits - 1);
    }
    return 0;
}

std::string_view data_type_name(std::uint16_t number, std::uint32_t bits) {
    static constexpr std::string_view kBits[] = {"BIT1", "BIT2", "BIT3", "BIT4", "BIT5", "BIT6", "BIT7", "BIT8"};
    if (number >= 0x30 && number <= 0x37) return kBits[number - 0x30];
    for (const BasicType& type : kBasicTypes)  // the first name of each number is the name in ESI files
        if (type.number == number) return type.name;
    if (bits >= 1 && bits <= 8) return bits == 1 ? "BOOL" : kBits[bits - 1];
    return bits == 16 ? "UINT" : bits == 32 ? "UDINT" : bits == 64 ? "ULINT" : "";
}

std::uint32_t EsiPdo::bits() const {
    std::uint32_t sum = 0;
    for (const EsiEntry& entry : entries) sum += entry.bits;
    return sum;
}

Direction EsiSyncManager::direction() const {
    if (type == SmType::outputs || type == SmType::mailbox_out) return Direction::outputs;
    if (type == SmType::inputs || type == SmType::mailbox_in) return Direction::inputs;
    constexpr unsigned kDirection = 0x0C;  // of the control octet: 0x04 is written by the master
    return (control & kDirection) == 0x04 ? Direction::outputs : Direction::inputs;
}

std::optional<Direction> direction_by_control(const EsiSyncManager& sm) {
    constexpr unsigned kMode = 0x03;  // of the control octet: 2 is a mailbox
    if (sm.type != SmType::unused || same_word(sm.use, kUnusedSm) || (sm.control & kMode) == 0x02) return std::nullopt;
    return sm.direction();
}

std::uint32_t EsiSlots::count() const {
    std::uint64_t sum = 0;
    for (const EsiSlot& slot : slots) sum += std::max<std::uint32_t>(slot.most, 1);
    if (most != 0) sum = std::min<std::uint64_t>(sum, most);
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(sum, 255));  // 0xF030 has subindices for 255
}

const EsiSlot* EsiSlots::slot(std::uint32_t number) const {
    if (number >= count()) return nullptr;
    std::uint64_t end = 0;
    for (const EsiSlot& slot : slots) {
        end += std::max<std::uint32_t>(slot.most, 1);
        if (number < end) return &slot;
    }
    return nullptr;
}

bool revision_fits(RevisionCheck check, std::uint32_t described, std::uint32_t found) {
    const bool low = (described & 0xFFFF) == (found & 0xFFFF);
    switch (check) {
        case RevisionCheck::none: return true;
        case RevisionCheck::equal: return described == found;
        case RevisionCheck::equal_or_greater: return found >= described;
        case RevisionCheck::low_equal: return low;
        case RevisionCheck::low_equal_high_equal_or_greater: return low && found >> 16 >= described >> 16;
    }
    return false;
}

const EsiPdo* EsiDevice::find_pdo(std::uint16_t index) const {
    const auto found = std::ranges::find(pdos, index, &EsiPdo::index);
    return found == pdos.end() ? nullptr : &*found;
}

const EsiModule* EsiFile::find_module(std::uint32_t ident) const {
    const auto found = std::ranges::find(modules, ident, &EsiModule::ident);
    return found == modules.end() ? nullptr : &*found;
}

const EsiDevice* find_device(const EsiFile& esi, const Identity& identity) {
    const EsiDevice* best = nullptr;
    for (const EsiDevice& device : esi.devices) {
        if (device.identity.vendor != identity.vendor || device.identity.product != identity.product) continue;
        if (device.identity.revision == identity.revision) return &device;
        if (!revision_fits(device.revision_check, device.identity.revision, identity.revision)) continue;
        if (best == nullptr || device.identity.revision > best->identity.revision) best = &device;
    }
    return best;
}

const EsiDevice* find_device(const EsiFile& esi, std::string_view type) {
    const EsiDevice* best = nullptr;
    for (const EsiDevice& device : esi.devices)
        if ((device.type == type || device.name == type) &&
            (best == nullptr || device.identity.revision > best->identity.revision))
            best = &device;
    return best;
}

std::string_view entry_name(const EsiDevice& device, Direction direction, std::uint16_t index, std::uint8_t subindex) {
    // The PDOs that are assigned by default first: several PDOs may have the same entry under different names.
    for (const bool assigned : {true, false})
        for (const EsiPdo& pdo : device.pdos) {
            if (pdo.direction != direction || pdo.sync_manager.has_value() != assigned) continue;
            for (const EsiEntry& entry : pdo.entries)
                if (entry.index == index && entry.subindex == subindex && index != 0 && !entry.name.empty())
                    return entry.name;
        }
    for (const EsiObject& object : device.dictionary) {
        if (object.index != index) continue;
        for (const EsiObject::Item& item : object.items)
            if (item.subindex == subindex && subindex != 0) return item.name;
        if (subindex == 0 && object.items.empty()) return object.name;
    }
    return {};
}

std::optional<std::size_t> find_mode(const EsiDevice& device, std::string_view name) {
    const auto found = std::ranges::find(device.modes, name, &EsiMode::name);
    if (found == device.modes.end()) return std::nullopt;
    return static_cast<std::size_t>(found - device.modes.begin());
}

SyncSettings sync_settings(const EsiMode& mode, Duration cycle) {
    SyncSettings sync;
    if (mode.assign_activate == 0) return sync;
    const auto times = [](Duration time, int factor) { return factor >= 0 ? time * factor : time / -factor; };
    sync.source = SyncSettings::Source::application;
    sync.assign_activate = mode.assign_activate;
    // Without a value and a factor SYNC0 has the cycle of the master.
    sync.sync0_cycle = mode.sync0_cycle_ns != 0 ? Duration(mode.sync0_cycle_ns)
                                                : times(cycle, mode.sync0_factor == 0 ? 1 : mode.sync0_factor);
    // The register of SYNC1 has the time from a SYNC0 to its SYNC1, with the cycles of SYNC0 between.
    sync.sync1_cycle = Duration(mode.sync1_cycle_ns);
    if (mode.sync1_cycle_ns == 0 && mode.sync1_factor > 1)
        sync.sync1_cycle = sync.sync0_cycle * (mode.sync1_factor - 1);
    sync.sync1_cycle += Duration(std::max<std::int64_t>(mode.sync1_shift_ns, 0));
    sync.shift = Duration(mode.sync0_shift_ns);
    return sync;
}

}  // namespace margay::files
