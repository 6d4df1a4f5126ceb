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

// The values of all slaves of a group, if they are not all the same.
std::optional<Difference> compare(const Report& report, const std::vector<std::uint16_t>& group, Kind kind,
                                  std::string what, const std::function<std::string(const SlaveState&)>& value_of) {
    Difference difference{.kind = kind, .what = std::move(what)};
    for (const auto place : group) {
        const SlaveState& slave = report.slaves[place];
        const auto value = value_of(slave);
        auto same = std::ranges::find(difference.variants, value, &Variant::value);
        if (same == difference.variants.end())
            same = difference.variants.insert(difference.variants.end(), {.value = value});
        same->positions.push_back(slave.facts.position);
    }
    if (difference.variants.size() < 2) return std::nullopt;
    std::ranges::stable_sort(difference.variants, std::greater<>(),
                             [](const Variant& variant) { return variant.positions.size(); });
    return difference;
}

// The content of the EEPROM without what belongs to one device: the configuration area with the alias and the
// checksum, and the serial number.
std::string eeprom_text(const SlaveState& slave) {
    constexpr std::size_t kSerial = 0x0E;
    if (!slave.eeprom.problem.empty()) return "could not be read";
    std::uint64_t sum = 0xCBF2'9CE4'8422'2325;  // FNV-1a
    for (std::size_t n = 2 * kCommonWords; n < slave.eeprom.used.size(); ++n)
        if (n / 2 != kSerial && n / 2 != kSerial + 1)
            sum = (sum ^ std::to_integer<std::uint64_t>(slave.eeprom.used[n])) * 0x0000'0100'0000'01B3;
    return fmt::format("{}, sum {:08x}", samples::counted(slave.eeprom.used.size(), "octet"),
                       static_cast<std::uint32_t>(sum ^ (sum >> 32)));
}

std::string configuration_text(const SlaveState& slave) {
    std::string text;
    for (std::size_t word = 0; word < kCommonWords - 1; ++word)
        if (word != 4 && 2 * word + 1 < slave.eeprom.used.size())  // word 4 is the alias
            text +=
                fmt::format("{}{:04x}", text.empty() ? "" : " ", load_le<std::uint16_t>(slave.eeprom.used, 2 * word));
    return text.empty() ? "could not be read" : text;
}

std::vector<Difference> device_differences(const Report& report, const std::vector<std::uint16_t>& group) {
    std::vector<Difference> all;
    const auto add = [&](Kind kind, std::string_view what, const std::function<std::string(const SlaveState&)>& value) {
        if (auto difference = compare(report, group, kind, std::string(what), value))
            all.push_back(std::move(*difference));
    };
    add(Kind::device, "revision", [](const auto& s) { return fmt::format("0x{:08x}", s.facts.identity.revision); });
    add(Kind::device, "software version (object 0x100A)", [](const auto& s) { return s.versions.software; });
    add(Kind::device, "hardware version (object 0x1009)", [](const auto& s) { return s.versions.hardware; });
    add(Kind::device, "device name (object 0x1008)", [](const auto& s) { return s.versions.name; });
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

// Slaves without a dictionary take no part in the comparison of objects.
void add_object_differences(const Report& report, const std::vector<std::uint16_t>& group, AlikeGroup& out) {
    std::vector<std::uint16_t> with;
    std::map<std::string, std::vector<std::uint16_t>> remarks;
    for (const auto place : group) {
        const SlaveState& slave = report.slaves[place];
        if (!slave.dictionary) continue;
        const auto& [objects, values, unread, problem] = *slave.dictionary;
        if (problem.empty()) with.push_back(place);
        if (!problem.empty()) remarks["no dictionary to compare: " + problem].push_back(slave.facts.position);
        if (unread != 0) remarks[fmt::format("{} values could not be read", unread)].push_back(slave.facts.position);
    }
    for (const auto& [words, positions] : remarks)
        out.remarks.push_back(fmt::format("{}: {}", slaves_text(positions), words));
    if (with.size() < 2) return;
    for (const auto& [key, facts] : entries_of(report, with)) {
        if (covered_elsewhere(key)) continue;
        ++out.objects;
        const auto value = [&, key = key, type = facts.type](const SlaveState& slave) {
            const auto at = slave.dictionary->values.find(key);
            return at == slave.dictionary->values.end() ? std::string(kAbsent) : samples::value_text(type, at->second);
        };
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
