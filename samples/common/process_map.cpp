#include "common/process_map.hpp"

#include "common/counted.hpp"
#include "common/eeprom.hpp"
#include "common/process_entries.hpp"
#include "common/slave_eeprom.hpp"
#include "common/slave_report.hpp"
#include "network/image_layout.hpp"
#include "wire/sii_category.hpp"

#include <margay/margay.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <optional>

namespace margay::samples {
namespace {

namespace sii = wire::sii;

std::string text_of(Bytes strings, sii::StringNumber number) {
    std::array<char, 512> utf8{};
    const auto octets = sii::string(strings, number);
    return octets.ok() ? words_of_slave(sii::to_utf8(octets.value, utf8)) : std::string();
}

struct NamedEntry {
    std::uint16_t pdo = 0;
    std::uint8_t pdo_place = 0;
    std::uint8_t entry_place = 0;
    std::string pdo_name{};
    sii::PdoEntry entry{};
    std::string name{};
};

// The entries of all PDOs that the SII assigns to one SyncManager. Without a SyncManager: the entries of all PDOs of
// this direction.
std::vector<NamedEntry> entries_of(Bytes image, std::optional<std::uint8_t> sync_manager, Direction direction) {
    std::vector<NamedEntry> all;
    const Bytes strings = sii::find_category(image, sii::category::kStrings).value_or(Bytes{});
    const auto wanted = direction == Direction::outputs ? sii::category::kRxPdo : sii::category::kTxPdo;
    std::uint8_t place = 0;
    sii::CategoryWalker walker(image);
    while (const auto category = walker.next()) {
        if (category->place.type != wanted) continue;
        sii::Pdos pdos(category->content);
        while (const auto pdo = pdos.next()) {
            if (sync_manager && pdo->sync_manager != *sync_manager) continue;
            ++place;
            std::uint8_t n = 0;
            sii::PdoEntries entries(pdo->entries);
            while (const auto entry = entries.next())
                all.push_back(
                    {pdo->index, place, ++n, text_of(strings, pdo->name), *entry, text_of(strings, entry->name)});
        }
    }
    return all;
}

// Copies the name and type of an entry from the SII. When the SII has no name, the name comes from the dictionary.
void name_entry(Context& ctx, const Slave& slave, const std::vector<NamedEntry>& known, NamedEntry& e) {
    for (const auto& k : known) {
        if (k.pdo == e.pdo) e.pdo_name = k.pdo_name;
        if (e.entry.index == 0 || k.entry.index != e.entry.index || k.entry.subindex != e.entry.subindex) continue;
        e.name = k.name;
        e.entry.data_type = k.entry.data_type;
    }
    const bool informs = (slave.coe_details & coe_detail::kSdoInformation) != 0;
    if (!informs || e.entry.index == 0 || !e.name.empty()) return;
    const auto description = read_entry_description(ctx, slave.number, e.entry.index, e.entry.subindex);
    if (description) e.name = words_of_slave(description->name());
    if (description && e.entry.data_type == 0 && description->data_type <= 0xFF)
        e.entry.data_type = static_cast<std::uint8_t>(description->data_type);
}

// The entries that the PDO assignment in the slave's dictionary lists; none when the dictionary cannot be read. A
// subindex of the assignment that holds 0 names no PDO.
std::vector<NamedEntry> entries_by_dictionary(Context& ctx, const Slave& slave, const ProcessSm& sm, Bytes image) {
    const auto known = entries_of(image, std::nullopt, sm.direction);
    const auto assignment = static_cast<std::uint16_t>(0x1C10 + sm.number);
    std::vector<NamedEntry> all;
    const auto pdos = SDOread<std::uint8_t>(ctx, slave.number, assignment, 0);
    for (unsigned p = 1; pdos && p <= *pdos; ++p) {
        const auto pdo = SDOread<std::uint16_t>(ctx, slave.number, assignment, static_cast<std::uint8_t>(p));
        if (pdo && *pdo == 0) continue;
        const auto count = pdo ? SDOread<std::uint8_t>(ctx, slave.number, *pdo, 0) : Result<std::uint8_t>(pdo.error());
        if (!count) return {};
        for (unsigned n = 1; n <= *count; ++n) {
            const auto word = SDOread<std::uint32_t>(ctx, slave.number, *pdo, static_cast<std::uint8_t>(n));
            if (!word) return {};
            NamedEntry e{
                .pdo = *pdo, .pdo_place = static_cast<std::uint8_t>(p), .entry_place = static_cast<std::uint8_t>(n)};
            e.entry.index = static_cast<std::uint16_t>(*word >> 16);
            e.entry.subindex = static_cast<std::uint8_t>(*word >> 8);
            e.entry.bit_length = static_cast<std::uint8_t>(*word);
            name_entry(ctx, slave, known, e);
            all.push_back(std::move(e));
        }
    }
    return all;
}

std::vector<std::byte> read_image(Context& ctx, const Slave& slave, ProcessMap& map) {
    if (!slave.sii_read) return {};
    SlaveEeprom eeprom(ctx, slave.number);
    auto content = read_used_part(eeprom, no_progress());
    if (!content.error.empty()) map.remarks.push_back(content.error);
    return std::move(content.octets);
}

std::uint32_t bits_of(const std::vector<NamedEntry>& entries) {
    std::uint32_t bits = 0;
    for (const auto& e : entries) bits += e.entry.bit_length;
    return bits;
}

void add_sync_manager(Context& ctx, const Slave& slave, const ProcessSm& sm, std::uint32_t offset_bits, Bytes image,
                      ProcessMap& map) {
    std::vector<NamedEntry> entries;
    if (slave.config.source == ConfigurationSource::coe) entries = entries_by_dictionary(ctx, slave, sm, image);
    if (bits_of(entries) != sm.bits) entries = entries_of(image, sm.number, sm.direction);
    const std::uint32_t described = bits_of(entries);
    if (described != sm.bits) {
        if (described != 0)
            map.remarks.push_back(
                fmt::format("slave {}: SyncManager {} is mapped with {} bits, the PDOs of its SII have {}",
                            slave.number, sm.number, sm.bits, described));
        map.entries.push_back({.slave = slave.number,
                               .direction = sm.direction,
                               .sync_manager = sm.number,
                               .offset_bits = offset_bits,
                               .bits = sm.bits});
        return;
    }
    for (const auto& e : entries) {
        map.entries.push_back({slave.number, sm.direction, sm.number, e.pdo, e.pdo_place, e.entry_place, e.pdo_name,
                               e.entry.index, e.entry.subindex, e.name, e.entry.data_type, offset_bits,
                               e.entry.bit_length});
        offset_bits += e.entry.bit_length;
    }
}

const char* direction_text(Direction direction) { return direction == Direction::outputs ? "out" : "in"; }

std::string offset_text(std::uint32_t bits) { return fmt::format("{}.{}", bits / 8, bits % 8); }

std::string length_text(std::uint32_t bits) {
    return bits % 8 == 0 ? counted(bits / 8, "octet") : counted(bits, "bit");
}

std::string what(const MapEntry& e) {
    if (e.pdo == 0) return "(not described)";
    if (e.index == 0) return "(gap)";
    std::string text = fmt::format("{:#06x}:{}", e.index, e.subindex);
    if (!e.pdo_name.empty()) text += " " + e.pdo_name;
    if (!e.name.empty()) text += (e.pdo_name.empty() ? " " : " / ") + e.name;
    return text;
}

}  // namespace

ProcessMap read_process_map(Context& ctx, std::uint8_t group) {
    ProcessMap map{.output_bytes = ctx.group(group).output_bytes, .input_bytes = ctx.group(group).input_bytes};
    const Packing packing = ctx.group(group).config.packing;
    for (const Slave& slave : ctx.slaves()) {
        if (slave.config.group != group || (slave.image.outputs.bits == 0 && slave.image.inputs.bits == 0)) continue;
        const auto image = read_image(ctx, slave, map);
        for (std::size_t n = 0; n < slave.config.sm_count; ++n)
            if (slave.config.sms[n].bits != 0)
                add_sync_manager(ctx, slave, slave.config.sms[n], sm_offset_bits(slave, packing, n), image, map);
        if (slave.image.mailbox_status_bit != SlaveImage::kNone)
            map.entries.push_back({.slave = slave.number,
                                   .direction = Direction::inputs,
                                   .sync_manager = 1,
                                   .pdo = 0,
                                   .name = "mailbox has something to read",
                                   .offset_bits = slave.image.mailbox_status_bit,
                                   .bits = 1});
    }
    std::ranges::stable_sort(map.entries, {}, &MapEntry::offset_bits);
    return map;
}

std::string map_text(Context& ctx, const ProcessMap& map) {
    std::string text = fmt::format("Process image: {}, outputs 0 to {}, inputs {} to {}\n",
                                   counted(map.output_bytes + map.input_bytes, "octet"), map.output_bytes,
                                   map.output_bytes, map.output_bytes + map.input_bytes);
    std::uint16_t slave = 0;
    auto direction = Direction::outputs;
    for (const MapEntry& e : map.entries) {
        if (e.slave != slave || e.direction != direction)
            text += fmt::format("  slave {} {}, {}\n", e.slave, words_of_slave(ctx.slave(e.slave).name()),
                                e.direction == Direction::outputs ? "outputs" : "inputs");
        slave = e.slave;
        direction = e.direction;
        text += fmt::format("    {:>8}  {:<10}  SM{}  {}\n", offset_text(e.offset_bits), length_text(e.bits),
                            e.sync_manager, what(e));
    }
    if (const std::string code = entries_code(map); !code.empty()) text += "By name, with <margay/entry.hpp>:\n" + code;
    for (const auto& remark : map.remarks) text += "  note: " + remark + "\n";
    return text;
}

nlohmann::ordered_json map_json(Context& ctx, const ProcessMap& map) {
    auto entries = nlohmann::ordered_json::array();
    const auto declarations = entry_declarations(map);
    std::size_t n = 0;
    for (const MapEntry& e : map.entries)
        entries.push_back({{"slave", e.slave},
                           {"slave_name", words_of_slave(ctx.slave(e.slave).name())},
                           {"direction", direction_text(e.direction)},
                           {"sync_manager", e.sync_manager},
                           {"offset_bits", e.offset_bits},
                           {"bits", e.bits},
                           {"pdo", e.pdo},
                           {"pdo_name", e.pdo_name},
                           {"index", e.index},
                           {"subindex", e.subindex},
                           {"name", e.name},
                           {"data_type", e.data_type},
                           {"pdo_place", e.pdo_place},
                           {"entry_place", e.entry_place},
                           {"declaration", declarations[n++]}});
    return {{"output_bytes", map.output_bytes},
            {"input_bytes", map.input_bytes},
            {"entries", entries},
            {"remarks", map.remarks}};
}

}  // namespace margay::samples
