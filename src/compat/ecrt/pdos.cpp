#include "compat/ecrt/pdos.hpp"

#include "compat/ecrt/bus.hpp"
#include "wire/sii_category.hpp"

#include <array>
#include <optional>

namespace margay::compat::ecrt {
namespace {

namespace sii = wire::sii;

constexpr std::uint16_t kFirstAssignment = 0x1C10;  // of SyncManager 0

bool has_dictionary(const Slave& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
}

template <class T>
std::optional<T> read_object(Bus& bus, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex) {
    SdoUpload request;
    std::array<std::byte, sizeof(T)> octets{};
    request.slave = slave;
    request.index = index;
    request.subindex = subindex;
    request.data = octets;
    if (!submit(*bus.ctx, request) || !wait(*bus.ctx, request) || request.bytes > sizeof(T)) return std::nullopt;
    return value_from_octets<T>(octets);
}

std::optional<std::vector<PdoEntry>> read_mapping(Bus& bus, std::uint16_t slave, std::uint16_t pdo) {
    const auto count = read_object<std::uint8_t>(bus, slave, pdo, 0);
    if (!count) return std::nullopt;
    std::vector<PdoEntry> entries;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto value = read_object<std::uint32_t>(bus, slave, pdo, static_cast<std::uint8_t>(n));
        if (!value) return std::nullopt;
        entries.push_back({static_cast<std::uint16_t>(*value >> 16), static_cast<std::uint8_t>(*value >> 8),
                           static_cast<std::uint8_t>(*value)});
    }
    return entries;
}

// The assignment of all SyncManagers by the object dictionary; false: it has none.
bool read_dictionary(Bus& bus, const Slave& slave, KnownPdos& known) {
    bool any = false;
    for (unsigned n = 0; n < slave.sm_count && n < Slave::kSyncManagers; ++n) {
        const SmType type = slave.sync_managers[n].type;
        if (type == SmType::mailbox_out || type == SmType::mailbox_in) continue;
        const auto assignment = static_cast<std::uint16_t>(kFirstAssignment + n);
        const auto count = read_object<std::uint8_t>(bus, slave.number, assignment, 0);
        if (!count) continue;
        any = true;
        for (unsigned m = 1; m <= *count; ++m) {
            const auto pdo = read_object<std::uint16_t>(bus, slave.number, assignment, static_cast<std::uint8_t>(m));
            if (!pdo) return false;
            if (*pdo == 0) continue;
            auto entries = read_mapping(bus, slave.number, *pdo);
            if (!entries) return false;
            known.offered[*pdo] = *entries;
            known.syncs[n].pdos.push_back({*pdo, true, std::move(*entries)});
        }
    }
    return any;
}

// All PDOs of one category of the SII.
void read_category(Bytes content, KnownPdos& known, bool assign) {
    sii::Pdos pdos(content);
    while (const auto pdo = pdos.next()) {
        std::vector<PdoEntry> entries;
        sii::PdoEntries list(pdo->entries);
        while (const auto entry = list.next()) entries.push_back({entry->index, entry->subindex, entry->bit_length});
        if (!known.offered.contains(pdo->index)) known.offered[pdo->index] = entries;
        if (assign && pdo->assigned() && pdo->sync_manager < EC_MAX_SYNC_MANAGERS)
            known.syncs[pdo->sync_manager].pdos.push_back({pdo->index, true, std::move(entries)});
    }
}

void read_sii_pdos(Bus& bus, const Slave& slave, KnownPdos& known, bool assign) {
    sii::CategoryChain chain(sii::content_end_word(slave.sii_bytes));
    while (chain.more()) {
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        if (!read_sii(*bus.ctx, slave.number, chain.header_word(), header)) return;
        const auto place = chain.step(header);
        if (!place) return;
        if (place->type != sii::category::kTxPdo && place->type != sii::category::kRxPdo) continue;
        std::vector<std::byte> content(place->words * sii::kWordBytes);
        if (content.empty() || !read_sii(*bus.ctx, slave.number, place->word, content)) continue;
        read_category(content, known, assign);
    }
}

}  // namespace

ec_direction_t direction_of(const SmInfo& sm) {
    switch (sm.type) {
        case SmType::mailbox_out:
        case SmType::outputs: return EC_DIR_OUTPUT;
        case SmType::mailbox_in:
        case SmType::inputs: return EC_DIR_INPUT;
        default: return (sm.control & 0x0C) == 0x04 ? EC_DIR_OUTPUT : EC_DIR_INPUT;
    }
}

KnownPdos read_pdos(Bus& bus, const Slave& slave) {
    KnownPdos known;
    known.identity = slave.identity;
    for (unsigned n = 0; n < slave.sm_count && n < Slave::kSyncManagers; ++n) {
        known.syncs[n].from_slave = true;
        known.syncs[n].direction = direction_of(slave.sync_managers[n]);
    }
    const bool by_dictionary = has_dictionary(slave) && read_dictionary(bus, slave, known);
    if (!by_dictionary)
        for (SyncWish& sync : known.syncs) sync.pdos.clear();
    read_sii_pdos(bus, slave, known, !by_dictionary);
    return known;
}

std::vector<PdoEntry> read_pdo(Bus& bus, const Slave& slave, KnownPdos& known, std::uint16_t index) {
    if (const auto found = known.offered.find(index); found != known.offered.end()) return found->second;
    if (!has_dictionary(slave)) return {};
    auto entries = read_mapping(bus, slave.number, index);
    if (!entries) return {};
    return known.offered[index] = *entries;
}

std::shared_ptr<KnownPdos> pdos_of(Bus& bus, const Slave& slave) {
    const std::uint16_t position = slave.ring_position;
    {
        const std::lock_guard lock(bus.known_mutex);
        const auto found = bus.known_pdos.find(position);
        if (found != bus.known_pdos.end() && found->second->identity == slave.identity) return found->second;
    }
    auto known = std::make_shared<KnownPdos>(read_pdos(bus, slave));
    const std::lock_guard lock(bus.known_mutex);
    return bus.known_pdos[position] = std::move(known);
}

}  // namespace margay::compat::ecrt
