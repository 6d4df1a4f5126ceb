#include "network/pdo_sii.hpp"

#include "network/pdo_lists.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace sii = wire::sii;

constexpr unsigned kMostCategories = 64;

Error fault(const Station& station, sii::Fault what, std::uint32_t word) {
    Error error = station.error(sii::to_errc(what), Step::parse_sii, static_cast<std::uint16_t>(word));
    return error;
}

// Returns the SyncManager to whose size the PDO is added: the SyncManager in the list of the application if the list
// names the PDO, otherwise the SyncManager in the SII. A PDO whose entries are listed too is not added.
std::uint8_t sync_manager_of(const sii::Pdo& pdo, const Slave& slave) {
    for (const SmPdos& list : slave.config.pdos()) {
        const auto listed = std::ranges::find(list.pdos, pdo.index, &Pdo::index);
        if (listed != list.pdos.end()) return listed->entries.empty() ? list.sync_manager : sii::Pdo::kNoSyncManager;
        if (list.sync_manager == pdo.sync_manager) return sii::Pdo::kNoSyncManager;
    }
    return pdo.sync_manager;
}

// The task of one pass over the PDO categories.
struct PdoWalk {
    FoundSms* assigned = nullptr;  // not null: reads all assigned PDOs
    std::uint16_t only = 0;        // otherwise: reads only this PDO
    FoundEntry at{};               // the place of the next entry
    EntrySink* entries = nullptr;

    // Whether the entries of this PDO are to be read. Notes its SyncManager.
    bool begin(const sii::Pdo& pdo, const Slave& slave, Direction by_category) {
        at.pdo = pdo.index;
        at.entry_place = 0;
        if (assigned == nullptr) return pdo.index == only;
        const std::uint8_t number = sync_manager_of(pdo, slave);
        if (number >= assigned->size()) return false;
        FoundSm& sum = (*assigned)[number];
        sum.any = true;
        ++sum.pdos;
        sum.direction = by_category;
        at = {.direction = by_category, .sync_manager = number, .pdo_place = sum.pdos, .pdo = pdo.index};
        at.offset_bits = sum.bits;
        listed = find_list(slave, number) != nullptr;
        return true;
    }
    void add(const sii::PdoEntry& entry) {
        ++at.entry_place;
        at.index = entry.index;
        at.subindex = entry.subindex;
        at.data_type = entry.data_type;
        at.bits = entry.bit_length;
        if (entries != nullptr && !listed) entries->add(at);
        at.offset_bits += at.bits;
        if (assigned != nullptr) (*assigned)[at.sync_manager].bits = at.offset_bits;
    }

    bool listed = false;  // the application's list defines the order of the entries
};

// Reads one PDO category. Of PDOs that are not needed only the header is read.
Task<Result<>> add_pdos(SiiReader& reader, const Slave& slave, sii::CategoryPlace place, PdoWalk& walk) {
    constexpr std::uint32_t kHeadWords = sii::kPdoBytes / sii::kWordBytes;
    constexpr std::uint32_t kEntryWords = sii::kPdoEntryBytes / sii::kWordBytes;
    const std::uint32_t end = place.word + place.words;
    std::uint32_t word = place.word;
    while (word + kHeadWords <= end) {
        std::array<std::byte, sii::kPdoBytes> head{};
        co_await required(reader.read(word, head, word + kHeadWords));
        const sii::Pdo pdo = sii::load_pdo(head);
        const std::uint32_t first = word + kHeadWords;
        word = first + pdo.entry_count * kEntryWords;
        if (word > end) co_return fault(reader.station(), sii::Fault::category_overlap, first - kHeadWords);
        const auto direction = place.type == sii::category::kTxPdo ? Direction::inputs : Direction::outputs;
        if (!walk.begin(pdo, slave, direction)) continue;
        for (std::uint32_t at = first; at < word; at += kEntryWords) {
            std::array<std::byte, sii::kPdoEntryBytes> entry{};
            co_await required(reader.read(at, entry, at + kEntryWords < end ? at + kEntryWords : SiiReader::kNone));
            walk.add(sii::load_pdo_entry(entry));
        }
    }
    co_return Nothing{};
}

Task<Result<>> read_pdos(SiiReader& reader, const Slave& slave, PdoWalk& walk) {
    sii::CategoryChain chain(sii::content_end_word(slave.sii_bytes));
    for (unsigned n = 0; chain.more(); ++n) {
        if (n == kMostCategories) co_return fault(reader.station(), sii::Fault::no_end, chain.header_word());
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        co_await required(reader.read(chain.header_word(), header, chain.header_word() + 2));
        const auto place = chain.step(header);
        if (!place) break;
        if (place->type != sii::category::kTxPdo && place->type != sii::category::kRxPdo) continue;
        co_await required(add_pdos(reader, slave, *place, walk));
    }
    if (chain.fault() == sii::Fault::none) co_return Nothing{};
    co_return fault(reader.station(), chain.fault(), chain.header_word());
}

// A SyncManager carries process data if its type says so, or if it has no type but a PDO is assigned to it.
void apply_sm_types(const Slave& slave, FoundSms& found) {
    for (std::uint8_t n = 0; n < found.size(); ++n) {
        FoundSm& pdos = found[n];
        if (n >= slave.sm_count) {
            pdos = {};
            continue;
        }
        const SmInfo& sm = slave.sync_managers[n];
        const bool typed = sm.type == SmType::outputs || sm.type == SmType::inputs;
        const bool untyped = sm.type == SmType::unused && pdos.any;
        if ((!typed && !untyped) || (sm.enable & sii::sm_enable::kVirtual) != 0) {
            pdos = {};
            continue;
        }
        if (typed) pdos.direction = sm.type == SmType::outputs ? Direction::outputs : Direction::inputs;
        if (!pdos.any) pdos.bits = sm.length_bytes * 8U;
        pdos.any = true;
    }
}

}  // namespace

Task<Result<>> find_sms_by_sii(Station station, const Slave& slave, FoundSms& found, EntrySink* entries) {
    if (!slave.sii_read) co_return Nothing{};  // the scan has reported the reason
    co_await required(sii_assign(station, false));
    SiiReader reader(station);
    PdoWalk walk{.assigned = &found, .entries = entries};
    auto read = co_await read_pdos(reader, slave, walk);
    auto given_back = co_await sii_assign(station, true);
    if (!read || !given_back) found = {};
    if (!read) co_return read;
    if (!given_back) co_return given_back;
    apply_sm_types(slave, found);
    co_return Nothing{};
}

Task<Result<>> walk_list_by_sii(Station station, const Slave& slave, const SmPdos& list, EntrySink& entries) {
    if (!slave.sii_read) co_return Nothing{};
    co_await required(sii_assign(station, false));
    SiiReader reader(station);
    Result<> read;
    PdoWalk walk{.entries = &entries};
    walk.at.direction = direction_of(slave, list);
    walk.at.sync_manager = list.sync_manager;
    for (const Pdo& pdo : list.pdos) {
        ++walk.at.pdo_place;
        walk.at.pdo = walk.only = pdo.index;
        walk.at.entry_place = 0;
        for (const PdoEntry& entry : pdo.entries)
            walk.add({.index = entry.index, .subindex = entry.subindex, .bit_length = entry.bits});
        if (read && pdo.entries.empty()) read = co_await read_pdos(reader, slave, walk);
    }
    auto given_back = co_await sii_assign(station, true);
    if (!read) co_return read;
    co_return given_back;
}

}  // namespace margay
