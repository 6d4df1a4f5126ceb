#include "compat/ecrt/pdos.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "wire/sii_category.hpp"

#include <margay/registers.hpp>

#include <array>

namespace margay::compat::ecrt {
namespace {

namespace sii = wire::sii;

constexpr std::uint16_t kFirstAssignment = 0x1C10;  // of SyncManager 0

bool has_dictionary(const Slave& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
}

template <class T>
Result<T> read_object(Bus& bus, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex) {
    SdoUpload request;
    std::array<std::byte, sizeof(T)> octets{};
    request.slave = slave;
    request.index = index;
    request.subindex = subindex;
    request.data = octets;
    auto done = submit(*bus.ctx, request);
    if (done) done = wait(*bus.ctx, request);
    if (!done) return done.error();
    return value_from_octets<T>(octets);
}

Result<std::vector<PdoEntry>> read_mapping(Bus& bus, std::uint16_t slave, std::uint16_t pdo) {
    const auto count = read_object<std::uint8_t>(bus, slave, pdo, 0);
    if (!count) return count.error();
    std::vector<PdoEntry> entries;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto value = read_object<std::uint32_t>(bus, slave, pdo, static_cast<std::uint8_t>(n));
        if (!value) return value.error();
        entries.push_back({static_cast<std::uint16_t>(*value >> 16), static_cast<std::uint8_t>(*value >> 8),
                           static_cast<std::uint8_t>(*value)});
    }
    return entries;
}

// The PDOs of one SyncManager, as many as are assigned to it.
Result<> read_assignment(Bus& bus, const Slave& slave, std::uint8_t sm, unsigned count, KnownPdos& known) {
    const auto assignment = static_cast<std::uint16_t>(kFirstAssignment + sm);
    for (unsigned n = 1; n <= count; ++n) {
        const auto pdo = read_object<std::uint16_t>(bus, slave.number, assignment, static_cast<std::uint8_t>(n));
        if (!pdo) return pdo.error();
        if (*pdo == 0) continue;
        auto entries = read_mapping(bus, slave.number, *pdo);
        if (!entries) return entries.error();
        known.offered[*pdo] = *entries;
        known.syncs[sm].pdos.push_back({*pdo, true, std::move(*entries)});
    }
    return {};
}

// The assignment of all SyncManagers by the object dictionary; false: it has none.
Result<bool> read_dictionary(Bus& bus, const Slave& slave, KnownPdos& known) {
    bool any = false;
    for (std::uint8_t n = 0; n < slave.sm_count && n < Slave::kSyncManagers; ++n) {
        const SmType type = slave.sync_managers[n].type;
        if (type == SmType::mailbox_out || type == SmType::mailbox_in) continue;
        const auto assignment = static_cast<std::uint16_t>(kFirstAssignment + n);
        const auto count = read_object<std::uint8_t>(bus, slave.number, assignment, 0);
        if (!count && is_answer(count.error())) continue;
        const Result<> read = count ? read_assignment(bus, slave, n, *count, known) : Result<>(count.error());
        if (!read && !is_answer(read.error())) return read.error();
        if (!read) return false;
        any = true;
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

Result<> read_sii_pdos(Bus& bus, const Slave& slave, KnownPdos& known, bool assign) {
    sii::CategoryChain chain(sii::content_end_word(slave.sii_bytes));
    std::vector<std::byte> content;
    while (chain.more()) {
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        if (const auto read = read_sii(*bus.ctx, slave.number, chain.header_word(), header); !read) return read;
        const auto place = chain.step(header);
        if (!place) break;
        if (place->type != sii::category::kTxPdo && place->type != sii::category::kRxPdo) continue;
        content.resize(place->words * sii::kWordBytes);
        if (content.empty()) continue;
        if (const auto read = read_sii(*bus.ctx, slave.number, place->word, content); !read) return read;
        read_category(content, known, assign);
    }
    return {};
}

KnownPdos read_pdos(Bus& bus, const Slave& slave) {
    KnownPdos known;
    known.identity = slave.identity;
    for (unsigned n = 0; n < slave.sm_count && n < Slave::kSyncManagers; ++n) {
        known.syncs[n].from_slave = true;
        known.syncs[n].direction = direction_of(slave.sync_managers[n]);
    }
    const Result<bool> dictionary = has_dictionary(slave) ? read_dictionary(bus, slave, known) : Result<bool>(false);
    const bool assigned = dictionary && *dictionary;
    known.unread = dictionary.error();
    if (!assigned)
        for (SyncWish& sync : known.syncs) sync.pdos.clear();
    // The program runs no cycle, and reading the SII needs a cycle too.
    if (known.unread.code == Errc::not_polled) return known;
    const auto sii = read_sii_pdos(bus, slave, known, !assigned);
    if (!assigned && known.unread.code == Errc::none) known.unread = sii.error();
    return known;
}

// The reason why the PDOs of the slave may change soon. Code none: they do not change.
Error check_settled(Bus& bus, const Slave& slave) {
    constexpr std::uint16_t kAlStatus = 0x0130;
    constexpr unsigned kState = 0x0F;
    if (!is_configured(bus, slave)) return {};
    const auto status = read_register<std::uint8_t>(*bus.ctx, slave.number, kAlStatus);
    if (!status) return status.error();
    const auto least = static_cast<std::uint32_t>(AlState::safeop);
    const std::uint32_t state = *status & kState;
    if (state >= least) return {};
    return {.code = Errc::wrong_state,
            .step = Step::discover_pdos,
            .slave = slave.number,
            .expected = least,
            .actual = state};
}

// PDOs that are read while the slave is being configured may be incomplete.
KnownPdos read_settled(Bus& bus, const Slave& slave) {
    KnownPdos known;
    known.identity = slave.identity;
    known.unread = check_settled(bus, slave);
    if (known.unread.code != Errc::none) return known;
    known = read_pdos(bus, slave);
    if (known.unread.code == Errc::none) known.unread = check_settled(bus, slave);
    return known;
}

}  // namespace

bool is_answer(const Error& error) {
    constexpr std::uint32_t kUnsupportedProtocol = 2;  // of a mailbox error
    return error.code == Errc::sdo_abort || error.code == Errc::unsupported || error.code == Errc::capacity ||
           (error.code == Errc::mailbox_error && error.detail == kUnsupportedProtocol);
}

ec_direction_t direction_of(const SmInfo& sm) {
    switch (sm.type) {
        case SmType::mailbox_out:
        case SmType::outputs: return EC_DIR_OUTPUT;
        case SmType::mailbox_in:
        case SmType::inputs: return EC_DIR_INPUT;
        default: return (sm.control & 0x0C) == 0x04 ? EC_DIR_OUTPUT : EC_DIR_INPUT;
    }
}

Result<std::vector<PdoEntry>> read_pdo(Bus& bus, const Slave& slave, KnownPdos& known, std::uint16_t index) {
    {
        const std::lock_guard lock(bus.known_mutex);
        if (const auto found = known.offered.find(index); found != known.offered.end()) return found->second;
    }
    if (!has_dictionary(slave)) return std::vector<PdoEntry>{};
    auto entries = read_mapping(bus, slave.number, index);
    if (entries) {
        const std::lock_guard lock(bus.known_mutex);
        return known.offered[index] = *entries;
    }
    if (is_answer(entries.error())) return std::vector<PdoEntry>{};
    say_error(bus, "a PDO", entries.error());
    return entries.error();
}

std::shared_ptr<KnownPdos> kept_pdos(Bus& bus, const Slave& slave) {
    const std::lock_guard lock(bus.known_mutex);
    const auto found = bus.known_pdos.find(slave.ring_position);
    const bool is_it = found != bus.known_pdos.end() && found->second->identity == slave.identity && !bus.pdos_written;
    return is_it && found->second->unread.code == Errc::none ? found->second : nullptr;
}

void forget_changed_pdos(Bus& bus, const Slave& slave, const ec_slave_config& config) {
    const auto same_pdo = [](const PdoWish& one, const PdoWish& known) {
        return one.index == known.index && (!one.listed || one.entries == known.entries);
    };
    const std::lock_guard lock(bus.known_mutex);
    const auto found = bus.known_pdos.find(slave.ring_position);
    if (found == bus.known_pdos.end()) return;
    bool changed = std::ranges::any_of(
        config.startup, [](const StartupWrite& write) { return !write.parameter && is_of_pdos(write.index); });
    const SyncWishes& known = found->second->syncs;
    for (std::size_t n = 0; n < config.syncs.size(); ++n) {
        const SyncWish& wanted = config.syncs[n];
        if (wanted.set && !wanted.from_slave) changed |= !std::ranges::equal(wanted.pdos, known[n].pdos, same_pdo);
    }
    if (changed) bus.known_pdos.erase(found);
}

void forget_pdos(Bus& bus, std::uint16_t position) {
    const std::lock_guard lock(bus.known_mutex);
    bus.known_pdos.erase(static_cast<std::uint16_t>(position + 1));
}

std::shared_ptr<KnownPdos> pdos_of(Bus& bus, const Slave& slave, bool again) {
    {
        const std::lock_guard lock(bus.known_mutex);
        const auto found = bus.known_pdos.find(slave.ring_position);
        if (found != bus.known_pdos.end() && found->second->identity == slave.identity && !bus.pdos_written &&
            (!again || found->second->unread.code == Errc::none))
            return found->second;
    }
    std::shared_ptr<KnownPdos> known;
    {
        const auto position = static_cast<std::uint16_t>(slave.ring_position - 1);
        const Passage passage(bus, position, Ready::for_pdos);
        Slave present;  // with the number that it has now: the master may have been activated meanwhile
        if (!bus.slave_at(position, present)) present = slave;
        known = std::make_shared<KnownPdos>(read_settled(bus, present));
        if (known->unread.code != Errc::none)
            known->unread.slave = present.number;  // also if the error of the library has no slave
    }
    const bool is_settling = known->unread.code == Errc::wrong_state && known->unread.step == Step::discover_pdos;
    if (is_settling)
        say("master %u: position %d: it is configured, and its PDOs can be asked for when it has reached SAFEOP",
            bus.index, slave.ring_position - 1);
    else if (known->unread.code != Errc::none)
        say_error(bus, "the PDOs of a slave", known->unread);
    const std::lock_guard lock(bus.known_mutex);
    return bus.known_pdos[slave.ring_position] = std::move(known);
}

}  // namespace margay::compat::ecrt
