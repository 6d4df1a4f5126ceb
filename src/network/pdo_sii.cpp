#include "network/pdo_sii.hpp"

#include "station/sii_access.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"
#include "wire/sync_manager.hpp"

namespace margay {
namespace {

namespace sii = wire::sii;

constexpr unsigned kMostCategories = 64;

// The PDOs that are assigned to each SyncManager.
struct AssignedPdos {
    struct Sum {
        std::uint32_t bits = 0;
        bool any = false;
        Direction direction = Direction::outputs;
    };
    std::array<Sum, Slave::kSyncManagers> at{};
};

Error fault(const Station& station, sii::Fault what, std::uint32_t word) {
    Error error = station.error(sii::to_errc(what), Step::discover_pdos, static_cast<std::uint16_t>(word));
    return error;
}

// One PDO category. Of PDOs that are not assigned only the heads are read.
Task<Result<>> add_pdos(SiiReader& reader, sii::CategoryPlace place, AssignedPdos& assigned) {
    constexpr std::uint32_t kHeadWords = sii::kPdoBytes / sii::kWordBytes;
    constexpr std::uint32_t kEntryWords = sii::kPdoEntryBytes / sii::kWordBytes;
    const std::uint32_t end = place.word + place.words;
    std::uint32_t word = place.word;
    while (word + kHeadWords <= end) {
        std::array<std::byte, sii::kPdoBytes> head{};
        auto read_head = co_await reader.read(word, head, word + kHeadWords);
        if (!read_head) co_return read_head;
        const sii::Pdo pdo = sii::load_pdo(head);
        const std::uint32_t first = word + kHeadWords;
        word = first + pdo.entry_count * kEntryWords;
        if (word > end) co_return fault(reader.station(), sii::Fault::category_overlap, first - kHeadWords);
        if (pdo.sync_manager >= assigned.at.size()) continue;
        auto& sum = assigned.at[pdo.sync_manager];
        sum.any = true;
        sum.direction = place.type == sii::category::kTxPdo ? Direction::inputs : Direction::outputs;
        for (std::uint32_t at = first; at < word; at += kEntryWords) {
            std::array<std::byte, sii::kPdoEntryBytes> entry{};
            auto read_entry = co_await reader.read(at, entry, at + kEntryWords < end ? at + kEntryWords : SiiReader::kNone);
            if (!read_entry) co_return read_entry;
            sum.bits += sii::load_pdo_entry(entry).bit_length;
        }
    }
    co_return Result<>();
}

Task<Result<>> read_pdos(SiiReader& reader, std::uint32_t sii_bytes, AssignedPdos& assigned) {
    sii::CategoryChain chain(static_cast<std::uint32_t>(sii_bytes / sii::kWordBytes));
    for (unsigned n = 0; chain.more(); ++n) {
        if (n == kMostCategories) co_return fault(reader.station(), sii::Fault::no_end, chain.header_word());
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        auto read_header = co_await reader.read(chain.header_word(), header, chain.header_word() + 2);
        if (!read_header) co_return read_header;
        const auto place = chain.step(header);
        if (!place) break;
        if (place->type != sii::category::kTxPdo && place->type != sii::category::kRxPdo) continue;
        auto added = co_await add_pdos(reader, *place, assigned);
        if (!added) co_return added;
    }
    if (chain.fault() == sii::Fault::none) co_return Result<>();
    co_return fault(reader.station(), chain.fault(), chain.header_word());
}

// A SyncManager carries process data if its type says so, or if there is no type but a PDO is assigned to it.
void configure(Slave& slave, const AssignedPdos& assigned) {
    slave.config.sm_count = 0;
    slave.config.source = ConfigurationSource::sii;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        const SmInfo& sm = slave.sync_managers[n];
        const auto& pdos = assigned.at[n];
        const bool typed = sm.type == SmType::outputs || sm.type == SmType::inputs;
        const bool untyped = sm.type == SmType::unused && pdos.any;
        if ((!typed && !untyped) || (sm.enable & sii::sm_enable::kVirtual) != 0) continue;
        const Direction direction = !typed ? pdos.direction : sm.type == SmType::outputs ? Direction::outputs : Direction::inputs;
        const std::uint32_t bits = pdos.any ? pdos.bits : sm.length_bytes * 8U;
        (void)slave.config.add({n, direction, sm.control, sm.start, bits});  // there are no more than it has room for
    }
}
static_assert(Slave::kSyncManagers <= SlaveConfiguration::kProcessSms);

}  // namespace

Task<Result<>> discover_pdos_from_sii(Station station, Slave& slave) {
    if (!slave.sii_read) co_return Result<>();  // scan has said why
    auto taken = co_await sii_assign(station, false);
    if (!taken) co_return taken;
    AssignedPdos assigned;
    SiiReader reader(station);
    auto read = co_await read_pdos(reader, slave.sii_bytes, assigned);
    auto given_back = co_await sii_assign(station, true);
    if (!read) co_return read;
    if (!given_back) co_return given_back;
    configure(slave, assigned);
    co_return Result<>();
}

}  // namespace margay
