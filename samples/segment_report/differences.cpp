#include "segment_report/differences.hpp"

#include "common/counted.hpp"
#include "common/dictionary_report.hpp"
#include "wire/coe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>

namespace margay::segment_report {
namespace {

using Kind = Difference::Kind;
using Key = std::pair<std::uint16_t, std::uint8_t>;

constexpr std::string_view kAbsent = "(not there)";
constexpr std::size_t kCommonWords = 0x08;  // words 0 to 7 of the EEPROM: the configuration area

// No value: the value could not be read, and the slave is not compared.
using ValueOf = std::function<std::optional<std::string>(const SlaveState&)>;

// The values of all slaves of a group, if they are not all the same.
std::optional<Difference> compare(const Report& report, const std::vector<std::uint16_t>& group, Kind kind,
                                  std::string what, const ValueOf& value_of) {
    Difference difference{.kind = kind, .what = std::move(what)};
    for (const auto place : group) {
        const SlaveState& slave = report.slaves[place];
        const auto value = value_of(slave);
        if (!value) continue;
        auto same = std::ranges::find(difference.variants, *value, &Variant::value);
        if (same == difference.variants.end())
            same = difference.variants.insert(difference.variants.end(), {.value = *value});
        same->positions.push_back(slave.facts.position);
    }
    if (difference.variants.size() < 2) return std::nullopt;
    std::ranges::stable_sort(difference.variants, std::greater<>(),
                             [](const Variant& variant) { return variant.positions.size(); });
    return difference;
}

// The content of the EEPROM except the data of the single device: the configuration area with the alias and the
// checksum, and the serial number.
std::optional<std::string> eeprom_text(const SlaveState& slave) {
    constexpr std::size_t kSerial = 0x0E;
    if (!slave.eeprom.problem.empty()) return std::nullopt;
    std::uint64_t sum = 0xCBF2'9CE4'8422'2325;  // FNV-1a
    for (std::size_t n = 2 * kCommonWords; n < slave.eeprom.used.size(); ++n)
        if (n / 2 != kSerial && n / 2 != kSerial + 1)
            sum = (sum ^ std::to_integer<std::uint64_t>(slave.eeprom.used[n])) * 0x0000'0100'0000'01B3;
    return fmt::format("{}, sum {:08x}", samples::counted(slave.eeprom.used.size(), "octet"),
                       static_cast<std::uint32_t>(sum ^ (sum >> 32)));
}

std::optional<std::string> configuration_text(const SlaveState& slave) {
    std::string text;
    for (std::size_t word = 0; word < kCommonWords - 1; ++word)
        if (word != 4 && 2 * word + 1 < slave.eeprom.used.size())  // word 4 is the alias
            text +=
                fmt::format("{}{:04x}", text.empty() ? "" : " ", load_le<std::uint16_t>(slave.eeprom.used, 2 * word));
    return text.empty() ? std::nullopt : std::optional(text);
}

std::vector<Difference> device_differences(const Report& report, const std::vector<std::uint16_t>& group) {
    std::vector<Difference> all;
    const auto add = [&](Kind kind, std::string_view what, const ValueOf& value) {
        if (auto difference = compare(report, group, kind, std::string(what), value))
            all.push_back(std::move(*difference));
    };
    add(Kind::device, "revision", [](const auto& s) { return fmt::format("0x{:08x}", s.facts.identity.revision); });
    const auto add_version = [&](std::string_view what, std::uint16_t index, std::string DeviceVersions::*text) {
        add(Kind::device, what, [index, text](const SlaveState& s) {
            return s.versions.unread.contains(index) ? std::nullopt : std::optional(s.versions.*text);
        });
    };
    add_version("software version (object 0x100A)", 0x100A, &DeviceVersions::software);
    add_version("hardware version (object 0x1009)", 0x1009, &DeviceVersions::hardware);
    add_version("device name (object 0x1008)", 0x1008, &DeviceVersions::name);
    add(Kind::device, "name", [](const auto& s) { return s.facts.name; });
    add(Kind::device, "ESC", [](const auto& s) {
        return fmt::format("type 0x{:02x}, revision {}, build {}", s.facts.dl.type, s.facts.dl.revision,
                           s.facts.dl.build);
    });
    add(Kind::device, "EEPROM: configuration area (words 0 to 6 without the alias)", configuration_text);
    add(Kind::device, "EEPROM: content behind the configuration area, without the serial number", eeprom_text);
    add(Kind::own, "alias", [](const auto& s) { return fmt::to_string(s.facts.alias); });
    add(Kind::own, "serial number", [](const auto& s) { return fmt::format("0x{:08x}", s.facts.identity.serial); });
    return all;
}

struct EntryFacts {
    std::string name{};
    std::uint16_t type = 0;
    std::uint16_t access = 0;
};

bool covered_elsewhere(Key key) {
    return (key.first >= 0x1008 && key.first <= 0x100A) || (key.first == 0x1018 && key.second >= 1);
}

Kind kind_of(Key key, const EntryFacts& facts) {
    constexpr std::uint16_t kTimestamp = 0x10F8, kDiagnosis = 0x10F3;
    constexpr std::uint16_t kErrorRegister = 0x1001, kErrorHistory = 0x1003;
    if (key.first == kTimestamp || key.first == kDiagnosis || key.first == kErrorRegister || key.first == kErrorHistory)
        return Kind::live;
    return (facts.access & wire::coe::access::kTxMappable) != 0 ? Kind::live : Kind::setting;
}

std::map<Key, EntryFacts> entries_of(const Report& report, const std::vector<std::uint16_t>& group) {
    std::map<Key, EntryFacts> entries;
    for (const auto place : group) {
        const auto& dictionary = report.slaves[place].dictionary;
        if (!dictionary || !dictionary->problem.empty()) continue;
        for (const auto& object : dictionary->objects)
            for (const auto& entry : object.entries) {
                const bool same = entry.name.empty() || entry.name == object.name;
                entries.try_emplace({object.index, entry.subindex},
                                    EntryFacts{.name = same ? object.name : object.name + ": " + entry.name,
                                               .type = entry.data_type,
                                               .access = entry.access});
            }
    }
    return entries;
}

// The objects of slaves without a dictionary are not compared.
void add_object_differences(const Report& report, const std::vector<std::uint16_t>& group, AlikeGroup& out) {
    std::vector<std::uint16_t> with;
    std::map<std::string, std::vector<std::uint16_t>> remarks;
    for (const auto place : group) {
        const SlaveState& slave = report.slaves[place];
        if (!slave.eeprom.problem.empty()) remarks["the EEPROM could not be read"].push_back(slave.facts.position);
        if (!slave.dictionary) continue;
        const auto& [objects, values, unread, problem] = *slave.dictionary;
        if (problem.empty()) with.push_back(place);
        if (!problem.empty()) remarks["no dictionary to compare: " + problem].push_back(slave.facts.position);
        if (!unread.empty())
            remarks[samples::counted(unread.size(), "value") + " could not be read"].push_back(slave.facts.position);
    }
    const auto unread_of = [&](std::uint16_t place) { return report.slaves[place].dictionary->unread; };
    out.partly_read = std::ranges::any_of(group, [&](std::uint16_t place) {
        const SlaveState& slave = report.slaves[place];
        return !slave.eeprom.problem.empty() || !slave.versions.unread.empty() ||
               (slave.dictionary && !slave.dictionary->problem.empty());
    });
    for (const auto place : with) out.partly_read |= unread_of(place) != unread_of(with.front());
    for (const auto& [words, positions] : remarks)
        out.remarks.push_back(fmt::format("{}: {}", slaves_text(positions), words));
    if (with.size() < 2) return;
    for (const auto& [key, facts] : entries_of(report, with)) {
        if (covered_elsewhere(key)) continue;
        const auto value = [&, key = key, type = facts.type](const SlaveState& slave) -> std::optional<std::string> {
            if (slave.dictionary->unread.contains(key)) return std::nullopt;
            const auto at = slave.dictionary->values.find(key);
            return at == slave.dictionary->values.end() ? std::string(kAbsent) : samples::value_text(type, at->second);
        };
        // Values that could not be read are not compared.
        if (std::ranges::count_if(with, [&](std::uint16_t place) { return value(report.slaves[place]).has_value(); }) <
            2)
            continue;
        ++out.objects;
        auto difference = compare(report, with, kind_of(key, facts),
                                  fmt::format("object 0x{:04X}:{:02X}", key.first, key.second), value);
        if (!difference) continue;
        difference->name = facts.name;
        out.differences.push_back(std::move(*difference));
    }
}

}  // namespace

std::size_t AlikeGroup::count(Difference::Kind kind) const {
    return static_cast<std::size_t>(std::ranges::count(differences, kind, &Difference::kind));
}

std::vector<std::vector<std::uint16_t>> alike_slaves(const Report& report) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint16_t>> products;
    for (std::size_t n = 0; n < report.slaves.size(); ++n) {
        const auto& identity = report.slaves[n].facts.identity;
        products[{identity.vendor, identity.product}].push_back(static_cast<std::uint16_t>(n));
    }
    std::vector<std::vector<std::uint16_t>> groups;
    for (auto& [product, places] : products)
        if (places.size() > 1) groups.push_back(std::move(places));
    std::ranges::sort(groups);
    return groups;
}

std::vector<AlikeGroup> find_differences(const Report& report) {
    std::vector<AlikeGroup> all;
    for (const auto& places : alike_slaves(report)) {
        const SlaveFacts& first = report.slaves[places.front()].facts;
        AlikeGroup group{.vendor = first.identity.vendor, .product = first.identity.product, .name = first.name};
        for (const auto place : places) group.positions.push_back(report.slaves[place].facts.position);
        group.differences = device_differences(report, places);
        add_object_differences(report, places, group);
        std::ranges::stable_sort(group.differences, {}, &Difference::kind);
        all.push_back(std::move(group));
    }
    return all;
}

std::string slaves_text(const std::vector<std::uint16_t>& positions) {
    std::string text;
    for (std::size_t n = 0; n < positions.size();) {
        std::size_t last = n;
        while (last + 1 < positions.size() && positions[last + 1] == positions[last] + 1) ++last;
        if (!text.empty()) text += ", ";
        text += last > n + 1    ? fmt::format("{}-{}", positions[n], positions[last])
                : last == n + 1 ? fmt::format("{}, {}", positions[n], positions[last])
                                : fmt::to_string(positions[n]);
        n = last + 1;
    }
    return (positions.size() == 1 ? "slave " : "slaves ") + text;
}

}  // namespace margay::segment_report
