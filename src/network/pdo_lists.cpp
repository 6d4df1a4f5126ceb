#include "network/pdo_lists.hpp"

#include "util/check_value.hpp"
#include "wire/esc.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::size_t kMostElements = 254;  // subindices 1 to 254 of a list in the dictionary

bool is_output(std::uint16_t pdo) { return pdo >= 0x1600 && pdo < 0x1800; }
bool is_input(std::uint16_t pdo) { return pdo >= 0x1A00 && pdo < 0x1C00; }

Error fault(const Slave& slave, Errc code, std::uint16_t index, std::size_t subindex = 0) {
    return {.code = code,
            .step = Step::configure_pdos,
            .slave = slave.number,
            .index = index,
            .subindex = static_cast<std::uint8_t>(std::min<std::size_t>(subindex, 255))};
}

std::uint16_t sm_register(const SmPdos& list) { return wire::reg::sync_manager(list.sync_manager).address; }

Error list_fault(const Slave& slave, PdoListFault why, std::uint16_t index, std::size_t subindex = 0) {
    Error error = fault(slave, Errc::pdo_list, index, subindex);
    error.detail = static_cast<std::uint32_t>(why);
    return error;
}

Error check_entries(const Slave& slave, const Pdo& pdo) {
    if (pdo.entries.size() > kMostElements) return list_fault(slave, PdoListFault::too_many_entries, pdo.index);
    const auto empty = std::ranges::find(pdo.entries, 0, &PdoEntry::bits);
    if (empty == pdo.entries.end()) return {};
    const auto number = static_cast<std::size_t>(empty - pdo.entries.begin()) + 1;
    return list_fault(slave, PdoListFault::no_bits, pdo.index, number);
}

// Returns how often the PDO occurs in the lists of the slave.
std::size_t times_listed(const Slave& slave, std::uint16_t pdo) {
    std::size_t times = 0;
    for (const SmPdos& list : slave.config.pdos())
        times += static_cast<std::size_t>(std::ranges::count(list.pdos, pdo, &Pdo::index));
    return times;
}

Error check_list(const Slave& slave, const SmPdos& list) {
    const std::uint16_t place = sm_register(list);
    if (list.sync_manager >= slave.sm_count) {
        Error error = fault(slave, Errc::sm_shortage, place);
        error.expected = list.sync_manager + 1U;
        error.actual = slave.sm_count;
        return error;
    }
    const SmType type = slave.sync_managers[list.sync_manager].type;
    if (type == SmType::mailbox_out || type == SmType::mailbox_in) return fault(slave, Errc::not_process_sm, place);
    if (std::ranges::count(slave.config.pdos(), list.sync_manager, &SmPdos::sync_manager) > 1)
        return list_fault(slave, PdoListFault::sync_manager_twice, place);
    if (list.pdos.size() > kMostElements) return list_fault(slave, PdoListFault::too_many_pdos, place);
    for (const Pdo& pdo : list.pdos) {
        if (!is_output(pdo.index) && !is_input(pdo.index))
            return list_fault(slave, PdoListFault::no_pdo_index, pdo.index);
        if (times_listed(slave, pdo.index) > 1) return list_fault(slave, PdoListFault::pdo_twice, pdo.index);
        const bool other = (type == SmType::outputs && is_input(pdo.index)) ||
                           (type == SmType::inputs && is_output(pdo.index)) ||
                           is_input(pdo.index) != is_input(list.pdos.front().index);
        if (other) return fault(slave, Errc::wrong_direction, pdo.index);
        const Error entries = check_entries(slave, pdo);
        if (entries.code != Errc::none) return entries;
    }
    return {};
}

// Compares the bits of the list with the bits that the application has set for the SyncManager.
Error check_size(const Slave& slave, const SmPdos& list) {
    const ListedBits listed = listed_bits(list);
    if (listed.open != 0) return {};
    for (const ProcessSm& sm : slave.config.used_sms()) {
        if (sm.number != list.sync_manager || sm.bits == listed.bits) continue;
        Error error = fault(slave, Errc::pdo_size, sm_register(list));
        error.expected = sm.bits;
        error.actual = listed.bits;
        return error;
    }
    return {};
}

}  // namespace

const SmPdos* find_list(const Slave& slave, std::uint8_t sync_manager) {
    const auto found = std::ranges::find(slave.config.pdos(), sync_manager, &SmPdos::sync_manager);
    return found == slave.config.pdos().end() ? nullptr : &*found;
}

ListedBits listed_bits(const SmPdos& list) {
    ListedBits sum;
    for (const Pdo& pdo : list.pdos) {
        if (pdo.entries.empty()) ++sum.open;
        for (const PdoEntry& entry : pdo.entries) sum.bits += entry.bits;
    }
    return sum;
}

Direction direction_of(const Slave& slave, const SmPdos& list) {
    const bool input = list.pdos.empty() ? slave.sync_managers[list.sync_manager].type == SmType::inputs
                                         : is_input(list.pdos.front().index);
    return input ? Direction::inputs : Direction::outputs;
}

Error check_pdo_lists(const Slave& slave) {
    const bool sizes =
        slave.config.source == ConfigurationSource::application || slave.config.source == ConfigurationSource::file;
    for (const SmPdos& list : slave.config.pdos()) {
        const Error wrong = check_list(slave, list);
        if (wrong.code != Errc::none) return wrong;
        const Error size = sizes ? check_size(slave, list) : Error{};
        if (size.code != Errc::none) return size;
    }
    return {};
}

namespace {

// Whether the lists contain all entries, so that nothing needs to be read from the slave.
bool lists_all_entries(const Slave& slave) {
    const auto lists = slave.config.pdos();
    return !lists.empty() && std::ranges::all_of(lists, [&](const SmPdos& list) {
        const bool once = std::ranges::count(lists, list.sync_manager, &SmPdos::sync_manager) == 1;
        return once && list.sync_manager < Slave::kSyncManagers && listed_bits(list).open == 0 &&
               std::ranges::all_of(list.pdos, [&](const Pdo& p) {
                   return (is_output(p.index) || is_input(p.index)) && check_entries(slave, p).code == Errc::none;
               });
    });
}

}  // namespace

void add_lists(CheckValue& check, const Slave& slave) {
    for (const SmPdos& list : slave.config.pdos()) {
        check.add(list.sync_manager);
        for (const Pdo& pdo : list.pdos) {
            check.add_word(pdo.index);
            for (const PdoEntry& entry : pdo.entries) {
                check.add_word(std::uint32_t{entry.index} << 8 | entry.subindex);
                check.add_word(entry.bits);
            }
        }
    }
}

bool is_by_application(const SlaveConfiguration& config) {
    switch (config.source) {
        case ConfigurationSource::application:
        case ConfigurationSource::file: return true;
        case ConfigurationSource::none: return config.sm_count != 0;
        default: return false;
    }
}

bool keep_place(Slave& slave) {
    SlaveConfiguration& config = slave.config;
    forget_kept_place(slave);
    if (config.sm_count != 0 || is_by_application(config)) return true;
    return pdo_part(slave) != nullptr && pdo_part(slave)->place(slave);
}

bool place_by_lists(Slave& slave) {
    SlaveConfiguration& config = slave.config;
    if (!lists_all_entries(slave)) return false;
    if (slave.seen && !slave.held && check_pdo_lists(slave).code != Errc::none) return false;
    // The order of the SyncManagers, as for process data that is read from the slave.
    for (std::uint8_t n = 0; n < Slave::kSyncManagers; ++n) {
        const SmPdos* list = find_list(slave, n);
        if (list == nullptr || list->pdos.empty()) continue;
        const bool input = is_input(list->pdos.front().index);
        (void)config.add({.number = n,
                          .direction = input ? Direction::inputs : Direction::outputs,
                          .bits = listed_bits(*list).bits});
    }
    slave.place_kept = true;
    return true;
}

namespace {

void forget_process_data(SlaveConfiguration& config) {
    config.sm_count = 0;
    config.source = ConfigurationSource::none;
}

}  // namespace

void forget_kept_place(Slave& slave) {
    if (slave.place_kept) forget_process_data(slave.config);
    slave.place_kept = false;
}

void forget_described(Slave& slave) {
    const ConfigurationSource source = slave.config.source;
    if (source >= ConfigurationSource::sii && source <= ConfigurationSource::coe) forget_process_data(slave.config);
}

}  // namespace margay
