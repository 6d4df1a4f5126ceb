#include "analyse/names.hpp"

#include "analyse/mail_watch.hpp"
#include "wire/coe.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::analyse {

namespace sii = wire::sii;

namespace {

std::string string_of(Bytes strings, sii::StringNumber number) {
    const auto found = sii::string(strings, number);
    return found.ok() ? printable(found.value) : std::string();
}

// The octets of the first category of this type, if the recording has all of them.
Bytes category_of(const SlaveTrack& track, std::uint16_t type) {
    sii::CategoryChain chain(static_cast<std::uint32_t>(track.sii.size() / sii::kWordBytes));
    while (chain.more()) {
        const auto at = chain.header_word() * std::size_t{sii::kWordBytes};
        if (!track.sii_has(at, sii::kCategoryHeaderBytes)) return {};
        const auto place = chain.step(Bytes(track.sii).subspan(at, sii::kCategoryHeaderBytes));
        if (!place) return {};
        const auto from = place->word * std::size_t{sii::kWordBytes};
        const auto octets = place->words * std::size_t{sii::kWordBytes};
        if (place->type == type) return track.sii_has(from, octets) ? Bytes(track.sii).subspan(from, octets) : Bytes{};
    }
    return {};
}

void identify(Slave& facts, const SlaveTrack& track) {
    const auto word = [&](std::uint32_t at) -> std::optional<std::uint32_t> {
        if (!track.sii_has(at * 2, 4)) return std::nullopt;
        return load_le<std::uint32_t>(track.sii, at * 2);
    };
    facts.vendor = word(sii::word::kIdentity);
    facts.product = word(sii::word::kIdentity + 2);
    facts.revision = word(sii::word::kIdentity + 4);
    facts.serial = word(sii::word::kIdentity + 6);
    if (!facts.alias && track.sii_has(sii::word::kAlias * 2, 2))
        facts.alias = load_le<std::uint16_t>(track.sii, sii::word::kAlias * 2);
    std::optional<std::uint32_t>* const fields[] = {&facts.vendor, &facts.product, &facts.revision, &facts.serial};
    for (std::uint32_t sub = 1; sub <= 4; ++sub)
        if (const auto found = track.objects.find(0x1018U << 8 | sub);
            found != track.objects.end() && found->second.size() == 4 && !*fields[sub - 1])
            *fields[sub - 1] = load_le<std::uint32_t>(found->second);
}

void add_sii_pdos(Slave& facts, Bytes strings, Bytes content, bool input) {
    sii::Pdos pdos(content);
    while (const auto pdo = pdos.next()) {
        Pdo out{.index = pdo->index,
                .sync_manager = pdo->assigned() ? pdo->sync_manager : -1,
                .input = input,
                .name = string_of(strings, pdo->name)};
        sii::PdoEntries entries(pdo->entries);
        while (const auto entry = entries.next())
            out.entries.push_back({entry->index, entry->subindex, entry->bit_length, string_of(strings, entry->name)});
        facts.pdos.push_back(std::move(out));
    }
}

// The entries of an object of PDOs, each of `octets`. nullopt: some entries were not seen.
std::optional<std::vector<std::uint32_t>> list_of(const SlaveTrack& track, std::uint16_t index, std::size_t octets) {
    std::vector<std::uint32_t> all;
    const std::uint32_t key = std::uint32_t{index} << 8;
    const auto count = track.objects.find(key);
    if (count == track.objects.end() || count->second.empty()) return std::nullopt;
    for (std::uint32_t sub = 1; sub <= std::to_integer<std::uint32_t>(count->second[0]); ++sub) {
        const auto entry = track.objects.find(key | sub);
        if (entry == track.objects.end() || entry->second.size() < octets) return std::nullopt;
        all.push_back(octets == 4 ? load_le<std::uint32_t>(entry->second) : load_le<std::uint16_t>(entry->second));
    }
    return all;
}

std::string name_of(const SlaveTrack& track, std::uint16_t index, std::uint32_t subindex) {
    const auto found = track.names.find(std::uint32_t{index} << 12 | subindex);
    return found == track.names.end() ? std::string() : found->second;
}

// The name of an entry in the PDOs of the SII.
std::string name_in(const std::vector<Pdo>& pdos, std::uint16_t index, std::uint8_t subindex) {
    for (const auto& pdo : pdos)
        for (const auto& entry : pdo.entries)
            if (entry.index == index && entry.subindex == subindex) return entry.name;
    return {};
}

// The PDOs that are assigned in the slave (objects from 0x1C10 on); empty: no assignment was seen.
std::vector<Pdo> coe_pdos(const SlaveTrack& track, const std::vector<Pdo>& of_sii) {
    constexpr int kSyncManagers = 32;
    std::vector<Pdo> all;
    for (int sm = 0; sm < kSyncManagers; ++sm) {
        const auto assigned = list_of(track, static_cast<std::uint16_t>(0x1C10 + sm), 2);
        if (!assigned) continue;
        for (const auto number : *assigned) {
            const auto index = static_cast<std::uint16_t>(number);
            Pdo pdo{.index = index, .sync_manager = sm, .input = index >= 0x1A00, .name = name_of(track, index, 0xFFF)};
            const auto entries = list_of(track, index, 4);
            for (const auto entry : entries.value_or(std::vector<std::uint32_t>{})) {
                const auto object = static_cast<std::uint16_t>(entry >> 16);
                const auto sub = static_cast<std::uint8_t>(entry >> 8);
                auto name = name_of(track, object, sub);
                if (name.empty()) name = name_of(track, object, 0xFFF);
                if (name.empty()) name = name_in(of_sii, object, sub);
                pdo.entries.push_back({object, sub, static_cast<std::uint8_t>(entry), std::move(name)});
            }
            all.push_back(std::move(pdo));
        }
    }
    return all;
}

}  // namespace

void name_slave(Slave& facts, const SlaveTrack& track) {
    identify(facts, track);
    const auto strings = category_of(track, sii::category::kStrings);
    if (const auto general = category_of(track, sii::category::kGeneral); !general.empty()) {
        const auto parsed = sii::parse_general(general);
        facts.name = string_of(strings, parsed.value.name);
        facts.order = string_of(strings, parsed.value.order);
    }
    if (const auto found = track.objects.find(0x1008U << 8); facts.name.empty() && found != track.objects.end())
        facts.name = printable(found->second);
    add_sii_pdos(facts, strings, category_of(track, sii::category::kRxPdo), false);
    add_sii_pdos(facts, strings, category_of(track, sii::category::kTxPdo), true);
    if (auto pdos = coe_pdos(track, facts.pdos); !pdos.empty()) {
        facts.pdos = std::move(pdos);
        facts.pdos_by_coe = true;
    }
}

}  // namespace margay::analyse
