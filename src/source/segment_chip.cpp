#include "source/segment_chip.hpp"

#include "sim/devices.hpp"
#include "wire/sii.hpp"

#include <algorithm>
#include <map>

namespace margay::hosted {

namespace {

// ports = ["mii", "ebus", "unused", "none"]
Fault ports(const DescriptionReader& reader, const toml::table& table, sim::EscDescription& chip) {
    const auto* node = table.get("ports");
    if (node == nullptr) return {};
    const auto* list = node->as_array();
    if (list == nullptr || list->empty() || list->size() > sim::kMaxPorts)
        return reader.at(*node, "'ports' is a list of up to four kinds");
    for (unsigned p = 0; p < sim::kMaxPorts; ++p) {
        std::string kind = "none";
        if (p < list->size())
            if (const auto fault = reader.text((*list)[p], "ports", kind)) return fault;
        auto& port = chip.ports[p];
        using namespace std::chrono_literals;
        if (kind == "mii")
            port = {wire::PortKind::mii, 140ns};
        else if (kind == "ebus")
            port = {wire::PortKind::ebus, 10ns};
        else if (kind == "unused")
            port = {wire::PortKind::not_configured, 0ns};
        else if (kind == "none")
            port = {};
        else
            return reader.at((*list)[p],
                             fmt::format("there is no kind of port '{}'; there are: mii, ebus, unused, none", kind));
    }
    return {};
}

// 'dc' sets the clock, 'features' sets the register 0x0008. When one of them is missing, it follows from the other. If
// both are given, they may differ, as on a chip whose clock is switched off.
Fault dc(const DescriptionReader& reader, const toml::table& table, sim::EscDescription& chip) {
    namespace f = wire::features;
    using sim::DcUnit;
    const auto* node = table.get("dc");
    const bool given = table.contains("features");
    if (node == nullptr && !given) return {};
    if (node == nullptr) {
        const bool clock = (chip.features & f::kDistributedClocks) != 0;
        const bool wide = (chip.features & f::kDistributedClocks64Bit) != 0;
        chip.dc = clock ? (wide ? DcUnit::bits64 : DcUnit::bits32) : std::min(chip.dc, DcUnit::receive_times);
        return {};
    }
    static const std::map<std::string, DcUnit> kUnits{{"none", DcUnit::none},
                                                      {"receive_times", DcUnit::receive_times},
                                                      {"32", DcUnit::bits32},
                                                      {"64", DcUnit::bits64}};
    std::string name;
    if (const auto fault = reader.text(*node, "dc", name)) return fault;
    const auto found = kUnits.find(name);
    if (found == kUnits.end()) return reader.at(*node, "'dc' is \"none\", \"receive_times\", \"32\" or \"64\"");
    chip.dc = found->second;
    chip.dc_needs_enable = false;
    if (given) return {};
    chip.features = static_cast<std::uint16_t>((chip.features & ~(f::kDistributedClocks | f::kDistributedClocks64Bit)) |
                                               (chip.dc >= DcUnit::bits32 ? f::kDistributedClocks : 0) |
                                               (chip.dc == DcUnit::bits64 ? f::kDistributedClocks64Bit : 0));
    return {};
}

}  // namespace

Fault adjust_image(const DescriptionReader& reader, const toml::table& table, MutableBytes image) {
    namespace sii = wire::sii;
    if (image.size() < sii::kFixedBytes) return {};
    auto configuration = sii::load_configuration(image);
    auto identity = sii::load_identity(Bytes(image).subspan(sii::word::kIdentity * 2));
    if (const auto fault = reader.optional_integer(table, "alias", 0, 0xFFFF, configuration.alias)) return fault;
    if (const auto fault = reader.optional_integer(table, "serial", 0, 0xFFFFFFFF, identity.serial)) return fault;
    if (table.contains("alias")) sii::store_configuration(image, configuration);
    if (table.contains("serial")) sii::store_identity(image.subspan(sii::word::kIdentity * 2), identity);
    return {};
}

Fault adjust_chip(const DescriptionReader& reader, const toml::table& table, sim::EscDescription& chip) {
    if (const auto* node = table.get("chip")) {
        std::string name;
        if (const auto fault = reader.text(*node, "chip", name)) return fault;
        const auto found = sim::chip_by_name(name);
        if (!found)
            return reader.at(
                *node,
                fmt::format("there is no chip '{}'; there are: et1100, et1200, ip_core, lan9252, junction", name));
        chip = *found;
    }
    if (const auto fault = reader.optional_integer(table, "type", 0, 0xFF, chip.type)) return fault;
    if (const auto fault = reader.optional_integer(table, "revision", 0, 0xFF, chip.revision)) return fault;
    if (const auto fault = reader.optional_integer(table, "build", 0, 0xFFFF, chip.build)) return fault;
    if (const auto fault = reader.optional_integer(table, "fmmus", 0, sim::kMaxFmmus, chip.fmmus)) return fault;
    if (const auto fault =
            reader.optional_integer(table, "sync_managers", 0, sim::kMaxSyncManagers, chip.sync_managers))
        return fault;
    if (const auto fault = reader.optional_integer(table, "ram_kib", 0, 60, chip.ram_kib)) return fault;
    if (const auto fault = reader.optional_integer(table, "features", 0, 0xFFFF, chip.features)) return fault;
    if (const auto fault = reader.optional_integer(table, "drift_ppb", -100'000'000, 100'000'000, chip.clock.drift_ppb))
        return fault;
    if (const auto fault = reader.optional_integer(table, "clock_start_ns", 0, INT64_MAX, chip.clock.start_ns))
        return fault;
    if (const auto fault = reader.optional_integer(table, "sii_status", 0, 0xFFFF, chip.sii.status_bits)) return fault;
    if (const auto fault = reader.microseconds(table, "sii_read_us", chip.sii.read)) return fault;
    if (const auto fault = reader.microseconds(table, "sii_write_us", chip.sii.write)) return fault;
    if (const auto fault = reader.microseconds(table, "sii_write_busy_us", chip.sii.write_busy)) return fault;
    if (const auto fault = reader.boolean(table, "sii_8_bytes", chip.sii.reads_8_bytes)) return fault;
    if (const auto fault = reader.boolean(table, "emulated_eeprom", chip.sii.emulated)) return fault;
    if (const auto fault = reader.microseconds(table, "firmware_us", chip.firmware_latency)) return fault;
    if (const auto fault = ports(reader, table, chip)) return fault;
    return dc(reader, table, chip);
}

}  // namespace margay::hosted
