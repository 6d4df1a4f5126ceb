// PDOs and SyncManagers of a configuration, and the registration of entries in domains.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"

#include <algorithm>
#include <cerrno>
#include <optional>
#include <span>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

// The number of attempts to read from a slave whose position changes during the reading, or that a scan may find.
constexpr unsigned kTries = 5;
constexpr const char* kUnanswered = "the slave has not answered when it was asked for them";

bool is_known(const ec_slave_config& config, std::uint8_t sync_index) {
    const bool known = sync_index < EC_MAX_SYNC_MANAGERS;
    if (!known) say("configuration %u:%u: there is no SyncManager %u", config.alias, config.position, sync_index);
    return known;
}

// The PDOs of the slave of a configuration, and the slave with its position after the reading. New slaves may change
// the position during the reading. Waits for the slave, and for the end of a scan. Null: config.not_known says why.
std::shared_ptr<KnownPdos> pdos_of(ec_slave_config& config, Slave& slave) {
    Bus& bus = config.bus;
    for (unsigned n = 0; n < kTries; ++n) {
        const bool scanned = bus.await_scan();
        if (!bus.slave_of(config, slave)) {
            if (!scanned) continue;
            config.not_known = "the slave is not there to be asked for them";
            return nullptr;
        }
        const Slave asked = slave;
        auto known = pdos_of(bus, asked);
        const bool stayed =
            bus.slave_of(config, slave) && slave.ring_position == asked.ring_position && slave.number == asked.number;
        if (stayed && known->identity == slave.identity) return known;
    }
    config.not_known = "the segment is being scanned";
    return nullptr;
}

// The slave's own PDOs, where the program has set none. Waits for the slave; once for a configuration.
void ask_slave(ec_slave_config& config) {
    Slave slave;
    if (config.asked) return;
    const auto known = pdos_of(config, slave);
    if (known == nullptr) return;
    config.asked = true;
    config.answered = known->unread.code == Errc::none;
    for (std::size_t n = 0; n < known->syncs.size(); ++n)
        if (!config.syncs[n].set) config.syncs[n] = known->syncs[n];
}

// The entries of a PDO without a list: those of the slave.
void complete(ec_slave_config& config, PdoWish& pdo) {
    Slave slave;
    if (pdo.listed) return;
    for (unsigned n = 0; n < kTries; ++n) {
        const auto known = pdos_of(config, slave);
        if (known == nullptr) return;
        const Passage passage(config.bus, static_cast<std::uint16_t>(slave.ring_position - 1), Ready::for_mail);
        Slave present;
        if (!config.bus.slave_of(config, present) || present.number != slave.number) continue;
        auto entries = read_pdo(config.bus, slave, *known, pdo.index);
        if (!entries) config.not_known = kUnanswered;
        if (entries) pdo.entries = std::move(*entries);
        pdo.listed = !pdo.entries.empty();
        return;
    }
    config.not_known = "the segment is being scanned";
}

// The last part of the message if a PDO or an entry was not found.
std::string reason(const ec_slave_config& config) {
    const char* const why = config.not_known != nullptr ? config.not_known : config.answered ? nullptr : kUnanswered;
    return why == nullptr ? std::string() : std::string(" as far as its PDOs are known: ") + why;
}

std::uint32_t bits_of(const PdoWish& pdo) {
    std::uint32_t bits = 0;
    for (const PdoEntry& entry : pdo.entries) bits += entry.bits;
    return bits;
}

// The place of an entry in its SyncManager.
struct Place {
    std::uint8_t sync_manager = 0;
    std::uint32_t bit = 0;
};

std::optional<Place> find(ec_slave_config& config, std::uint16_t index, std::uint8_t subindex) {
    for (std::uint8_t sm = 0; sm < EC_MAX_SYNC_MANAGERS; ++sm) {
        std::uint32_t bit = 0;
        for (PdoWish& pdo : config.syncs[sm].pdos) {
            complete(config, pdo);
            for (const PdoEntry& entry : pdo.entries) {
                if (entry.index == index && entry.subindex == subindex) return Place{sm, bit};
                bit += entry.bits;
            }
        }
    }
    return std::nullopt;
}

// The offset of the SyncManager in the domain, added at its first entry. Threads with other configurations may do the
// same.
std::uint32_t offset_of(ec_domain& domain, ec_slave_config& config, std::uint8_t sm) {
    std::uint32_t bits = 0;
    for (const PdoWish& pdo : config.syncs[sm].pdos) bits += bits_of(pdo);
    const std::uint32_t bytes = bits / 8 + (bits % 8 != 0 ? 1 : 0);
    const std::lock_guard lock(domain.bus.config_mutex);
    for (const DomainPart& part : domain.parts)
        if (part.config == &config && part.sync_manager == sm) return part.offset;
    domain.parts.push_back({&config, sm, config.syncs[sm].direction == EC_DIR_OUTPUT, domain.size, bytes});
    domain.size += bytes;
    return domain.parts.back().offset;
}

// Whether the size of the SyncManager is known. Then, for each of its PDOs, either the entries are known, or it is
// known that the slave does not have the PDO.
bool is_complete(ec_slave_config& config, std::uint8_t sm) {
    bool all = true;
    for (PdoWish& pdo : config.syncs[sm].pdos) {
        complete(config, pdo);
        all = all && pdo.listed;
    }
    if (all || config.not_known == nullptr) return true;
    say("configuration %u:%u: SyncManager %u has PDOs whose entries are not known: %s", config.alias, config.position,
        sm, config.not_known);
    return false;
}

bool is_domain_of(const ec_slave_config& config, const ec_domain* domain) {
    if (domain != nullptr && &domain->bus == &config.bus) return true;
    say("configuration %u:%u: an entry needs a domain of its own master", config.alias, config.position);
    return false;
}

int put(ec_slave_config& config, ec_domain& domain, Place place, unsigned int* bit_position) {
    if (bit_position == nullptr && place.bit % 8 != 0) {
        say("configuration %u:%u: an entry of SyncManager %u does not begin on an octet, and there is no bit position",
            config.alias, config.position, place.sync_manager);
        return -EFAULT;
    }
    if (!is_complete(config, place.sync_manager)) return -ENOENT;
    const std::uint32_t offset = offset_of(domain, config, place.sync_manager);
    if (bit_position != nullptr) *bit_position = place.bit % 8;
    return static_cast<int>(offset + place.bit / 8);
}

// A PDO that the program changes: its SyncManager is as the program sets it from now on. nullptr: it is not assigned.
PdoWish* changed(ec_slave_config& config, std::uint16_t index) {
    for (SyncWish& sync : config.syncs)
        for (PdoWish& pdo : sync.pdos)
            if (pdo.index == index) {
                sync.set = true;
                sync.from_slave = false;
                return &pdo;
            }
    return nullptr;
}

// The PDO in the assignment of the program, otherwise in the assignment of the slave.
PdoWish* assigned(ec_slave_config& config, std::uint16_t index) {
    PdoWish* pdo = changed(config, index);
    config.not_known = nullptr;
    if (pdo == nullptr) {
        ask_slave(config);
        pdo = changed(config, index);
    }
    if (pdo == nullptr)
        say("configuration %u:%u: PDO 0x%04x is not assigned%s", config.alias, config.position, index,
            reason(config).c_str());
    return pdo;
}

bool is_valid(const ec_slave_config& config, std::uint8_t sync_index, ec_direction_t direction) {
    if (direction == EC_DIR_OUTPUT || direction == EC_DIR_INPUT) return true;
    say("configuration %u:%u: SyncManager %u: invalid direction %d", config.alias, config.position, sync_index,
        static_cast<int>(direction));
    return false;
}

void set(SyncWish& sync, ec_direction_t direction, ec_watchdog_mode_t watchdog) {
    sync.set = true;
    sync.from_slave = false;
    sync.direction = direction;
    sync.watchdog = watchdog;
}

// Checks the list. Returns 0, or the error code of the refusal. A refused list changes nothing.
int check(const ec_slave_config& config, std::span<const ec_sync_info_t> syncs) {
    for (const ec_sync_info_t& sync : syncs) {
        if (!is_known(config, sync.index)) return -ENOENT;
        if (!is_valid(config, sync.index, sync.dir)) return -EINVAL;
    }
    return 0;
}

void take(ec_slave_config& config, const ec_sync_info_t& from) {
    SyncWish& sync = config.syncs[from.index];
    set(sync, from.dir, from.watchdog_mode);
    sync.pdos.clear();  // no data of the slave is needed
    for (unsigned n = 0; from.pdos != nullptr && n < from.n_pdos; ++n) {
        const ec_pdo_info_t& pdo = from.pdos[n];
        PdoWish wish{.index = pdo.index, .listed = false, .entries = {}};
        for (unsigned m = 0; pdo.entries != nullptr && m < pdo.n_entries; ++m) {
            wish.listed = true;
            wish.entries.push_back({pdo.entries[m].index, pdo.entries[m].subindex, pdo.entries[m].bit_length});
        }
        sync.pdos.push_back(std::move(wish));
    }
}

}  // namespace

extern "C" {

int ecrt_slave_config_sync_manager(ec_slave_config_t* sc, uint8_t sync_index, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog_mode) {
    if (!is_known(*sc, sync_index)) return -ENOENT;
    if (!is_valid(*sc, sync_index, direction)) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    // The PDOs of the slave stay assigned until the program clears them.
    if (!sc->syncs[sync_index].set) ask_slave(*sc);
    set(sc->syncs[sync_index], direction, watchdog_mode);
    return 0;
}

int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t* sc, uint8_t sync_index) {
    if (!is_known(*sc, sync_index)) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    SyncWish& sync = sc->syncs[sync_index];
    sync.set = true;
    sync.from_slave = false;
    if (sync.direction == EC_DIR_INVALID) {
        Slave slave;
        const bool found = sc->bus.slave_of(*sc, slave) && sync_index < slave.sm_count;
        sync.direction = found ? direction_of(slave.sync_managers[sync_index])
                               : (sync_index % 2 == 0 ? EC_DIR_OUTPUT : EC_DIR_INPUT);
    }
    sync.pdos.clear();
    return 0;
}

int ecrt_slave_config_pdo_assign_add(ec_slave_config_t* sc, uint8_t sync_index, uint16_t index) {
    if (!is_known(*sc, sync_index)) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    SyncWish& sync = sc->syncs[sync_index];
    if (!sync.set) ask_slave(*sc);  // the PDO is added to the PDOs of the slave
    if (sync.direction == EC_DIR_INVALID) sync.direction = index >= 0x1A00 ? EC_DIR_INPUT : EC_DIR_OUTPUT;
    sync.set = true;
    sync.from_slave = false;
    for (const SyncWish& other : sc->syncs)
        for (const PdoWish& pdo : other.pdos)
            if (other.set && pdo.index == index) {
                say("configuration %u:%u: PDO 0x%04x is assigned already", sc->alias, sc->position, index);
                return -EEXIST;
            }
    sync.pdos.push_back({.index = index, .listed = false, .entries = {}});
    return 0;
}

int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t* sc, uint16_t pdo_index) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    PdoWish* pdo = assigned(*sc, pdo_index);
    if (pdo == nullptr) return -ENOENT;
    pdo->listed = true;
    pdo->entries.clear();
    return 0;
}

int ecrt_slave_config_pdo_mapping_add(ec_slave_config_t* sc, uint16_t pdo_index, uint16_t entry_index,
                                      uint8_t entry_subindex, uint8_t entry_bit_length) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    PdoWish* pdo = assigned(*sc, pdo_index);
    if (pdo == nullptr) return -ENOENT;
    complete(*sc, *pdo);
    pdo->listed = true;
    pdo->entries.push_back({entry_index, entry_subindex, entry_bit_length});
    return 0;
}

int ecrt_slave_config_pdos(ec_slave_config_t* sc, unsigned int n_syncs, const ec_sync_info_t syncs[]) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    std::size_t count = 0;
    while (syncs != nullptr && count < n_syncs && syncs[count].index != 0xFF) ++count;
    const std::span<const ec_sync_info_t> list(syncs, count);
    if (const int error = check(*sc, list); error != 0) return error;
    for (const ec_sync_info_t& sync : list) take(*sc, sync);
    return 0;
}

void ecrt_slave_config_overlapping_pdos(ec_slave_config_t* sc, uint8_t allow_overlapping_pdos) {
    const Change change(*sc);
    if (!change.refused()) sc->overlapping = allow_overlapping_pdos != 0;
}

int ecrt_slave_config_reg_pdo_entry(ec_slave_config_t* sc, uint16_t entry_index, uint8_t entry_subindex,
                                    ec_domain_t* domain, unsigned int* bit_position) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    if (!is_domain_of(*sc, domain)) return -EINVAL;
    sc->not_known = nullptr;
    auto place = find(*sc, entry_index, entry_subindex);
    if (!place) {
        sc->not_known = nullptr;
        ask_slave(*sc);
        place = find(*sc, entry_index, entry_subindex);
    }
    if (!place) {
        say("configuration %u:%u: entry 0x%04x:%02x is not mapped%s", sc->alias, sc->position, entry_index,
            entry_subindex, reason(*sc).c_str());
        return -ENOENT;
    }
    return put(*sc, *domain, *place, bit_position);
}

int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t* sc, uint8_t sync_index, unsigned int pdo_pos,
                                        unsigned int entry_pos, ec_domain_t* domain, unsigned int* bit_position) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    if (!is_domain_of(*sc, domain)) return -EINVAL;
    if (!is_known(*sc, sync_index)) return -EINVAL;
    sc->not_known = nullptr;
    if (!sc->syncs[sync_index].set) ask_slave(*sc);
    SyncWish& sync = sc->syncs[sync_index];
    Place place{sync_index, 0};
    for (unsigned n = 0; n < sync.pdos.size() && n <= pdo_pos; ++n) {
        complete(*sc, sync.pdos[n]);
        if (n < pdo_pos) {
            place.bit += bits_of(sync.pdos[n]);
            continue;
        }
        const auto& entries = sync.pdos[n].entries;
        if (entry_pos >= entries.size()) break;
        for (unsigned m = 0; m < entry_pos; ++m) place.bit += entries[m].bits;
        return put(*sc, *domain, place, bit_position);
    }
    say("configuration %u:%u: SyncManager %u has no entry %u in its PDO %u%s", sc->alias, sc->position, sync_index,
        entry_pos, pdo_pos, reason(*sc).c_str());
    return -ENOENT;
}

int ecrt_domain_reg_pdo_entry_list(ec_domain_t* domain, const ec_pdo_entry_reg_t* pdo_entry_regs) {
    if (pdo_entry_regs == nullptr) return -EINVAL;
    ec_master handle{std::shared_ptr<Bus>(std::shared_ptr<Bus>(), &domain->bus), true};
    for (const ec_pdo_entry_reg_t* reg = pdo_entry_regs; reg->index != 0; ++reg) {
        ec_slave_config_t* config =
            ecrt_master_slave_config(&handle, reg->alias, reg->position, reg->vendor_id, reg->product_code);
        if (config == nullptr) return domain->bus.active ? -EBUSY : -ENOENT;
        const int offset =
            ecrt_slave_config_reg_pdo_entry(config, reg->index, reg->subindex, domain, reg->bit_position);
        if (offset < 0) return offset;
        if (reg->offset != nullptr) *reg->offset = static_cast<unsigned int>(offset);
    }
    return 0;
}

}  // extern "C"
