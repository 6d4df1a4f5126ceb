// Flags of a configuration, and their use and that of the IP parameters at the start-up of a slave; the SyncManagers of
// a late slave.
#include "compat/ecrt/start_up.hpp"

#include "compat/ecrt/log.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <string_view>

namespace margay::compat::ecrt {
namespace {

constexpr std::uint16_t kFirstAssignment = 0x1C10;   // of SyncManager 0
constexpr std::uint16_t kFirstSyncManager = 0x0800;  // ESC registers, 8 octets each
constexpr std::uint16_t kActivate = 6;               // the octet of them that switches the SyncManager on

bool is_listed(const ec_slave_config& config, std::uint8_t sm) {
    return std::ranges::find(config.plan.sms, sm, &SmPdos::sync_manager) != config.plan.sms.end();
}

// The bits of the PDOs that a SyncManager has at present.
Task<Result<std::uint32_t>> assigned_bits(HookedSlave slave, std::uint8_t sm) {
    const auto assignment = static_cast<std::uint16_t>(kFirstAssignment + sm);
    std::uint32_t bits = 0;
    const auto pdos = co_await slave.sdo_read<std::uint8_t>(assignment, 0);
    if (!pdos) co_return pdos.error();
    for (unsigned n = 1; n <= *pdos; ++n) {
        const auto pdo = co_await slave.sdo_read<std::uint16_t>(assignment, static_cast<std::uint8_t>(n));
        if (!pdo) co_return pdo.error();
        if (*pdo == 0) continue;
        const auto entries = co_await slave.sdo_read<std::uint8_t>(*pdo, 0);
        if (!entries) co_return entries.error();
        for (unsigned m = 1; m <= *entries; ++m) {
            const auto entry = co_await slave.sdo_read<std::uint32_t>(*pdo, static_cast<std::uint8_t>(m));
            if (!entry) co_return entry.error();
            bits += *entry & 0xFFU;
        }
    }
    co_return bits;
}

// Switches a SyncManager on that the frames have no place for: the slave needs it to leave PREOP.
Task<> switch_on(HookedSlave slave, std::uint8_t sm) {
    const SmInfo& info = slave.slave().sync_managers[sm];
    std::uint32_t bytes = info.length_bytes;
    const MailboxInfo& mailbox = slave.slave().mailbox;
    if (mailbox.present() && (mailbox.protocols & mailbox_protocol::kCoE) != 0) {
        const auto bits = co_await assigned_bits(slave, sm);
        // If the slave refuses the upload, the length is taken from the SII.
        if (!bits && bits.error().code != Errc::sdo_abort) co_return bits.error();
        if (bits) bytes = (*bits + 7) / 8;
    }
    const auto octet = [](unsigned value) { return static_cast<std::byte>(value & 0xFFU); };
    const std::array<std::byte, 8> settings{
        octet(info.start), octet(info.start >> 8U),     octet(bytes), octet(bytes >> 8U), octet(info.control),
        std::byte{0},      octet(bytes != 0 ? 1U : 0U), std::byte{0}};
    const auto registers = static_cast<std::uint16_t>(kFirstSyncManager + settings.size() * sm);
    const std::array<std::byte, 1> off{};
    const auto switched_off = co_await slave.register_write(static_cast<std::uint16_t>(registers + kActivate), off);
    if (!switched_off) co_return switched_off;
    const auto written = co_await slave.register_write(registers, settings);
    co_return written;
}

// The process data of the lists, at the places of the SII.
void take_lists(const Slave& slave, const ec_slave_config& config) {
    slave.config.sm_count = 0;
    slave.config.source = ConfigurationSource::application;
    for (const SmPdos& list : config.plan.sms) {
        if (list.pdos.empty() || list.sync_manager >= slave.sm_count) continue;
        std::uint32_t bits = 0;
        for (const Pdo& pdo : list.pdos)
            for (const PdoEntry& entry : pdo.entries) bits += entry.bits;
        const SmInfo& info = slave.sync_managers[list.sync_manager];
        const bool inputs = list.pdos.front().index >= 0x1A00;
        (void)slave.config.add({.number = list.sync_manager,
                                .direction = inputs ? Direction::inputs : Direction::outputs,
                                .control = info.control,
                                .start = info.start,
                                .bits = bits});
    }
}

// A slave that is started after the frames were laid out has the process data that the program has set. Inputs in other
// SyncManagers of the slave are enabled, but not exchanged.
Task<> keep_to_the_lists(HookedSlave hooked, const ec_slave_config& config) {
    const Slave& slave = hooked.slave();
    take_lists(slave, config);
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        if (slave.sync_managers[n].type != SmType::inputs || is_listed(config, n)) continue;
        const auto done = co_await switch_on(hooked, n);
        if (!done) co_return done;
    }
    co_return {};
}

bool is_whole(const SmPdos& list) {
    return std::ranges::none_of(list.pdos, [](const Pdo& pdo) { return pdo.entries.empty(); });
}

// Whether the data of the lists fits into the memory of the slave. If it does not fit, the library lays out no frames
// for the slave, and the other slaves must not be affected.
bool is_apart(const Slave& slave) {
    struct Area {
        std::uint32_t begin = 0;
        std::uint32_t end = 0;
    };
    std::array<Area, SlaveConfiguration::kProcessSms + 2> areas{};
    std::size_t count = 0;
    const auto add = [&](std::uint32_t start, std::uint32_t bytes) {
        if (bytes != 0) areas[count++] = {start, start + bytes};
    };
    for (const ProcessSm& sm : slave.config.used_sms()) {
        if (sm.number >= slave.dl.sync_managers) return false;
        add(sm.start, sm.bytes());
    }
    const std::size_t own = count;
    add(slave.mailbox.out_start, slave.mailbox.out_bytes);
    add(slave.mailbox.in_start, slave.mailbox.in_bytes);
    const std::uint32_t memory = slave.dl.ram_kib == 0 ? 0x10000U : 0x1000U + slave.dl.ram_kib * 1024U;
    for (std::size_t n = 0; n < own; ++n) {
        if (areas[n].begin < 0x0F00 || areas[n].end > std::min(memory, 0x10000U)) return false;
        for (std::size_t m = n + 1; m < count; ++m)
            if (areas[n].begin < areas[m].end && areas[m].begin < areas[n].end) return false;
    }
    return true;
}

Task<> before_safeop(HookedSlave slave, void* user) {
    const auto& config = *static_cast<const ec_slave_config*>(user);
    if (config.late) {
        const auto kept = co_await keep_to_the_lists(slave, config);
        if (!kept) co_return kept;
    }
    if (!(config.ip == EoeIp{})) {
        co_await completion(set_ip(slave, config));
    }
    if (config.wait_before_safeop > Duration{0}) {
        co_await completion(slave.sleep(config.wait_before_safeop));
    }
    co_return {};
}

}  // namespace

bool has_whole_lists(const ec_slave_config& config) {
    const auto& lists = config.plan.sms;
    return !lists.empty() && std::ranges::all_of(lists, is_whole);
}

void hold_downloads(ec_slave_config& config) { config.plan.setup.startup = {}; }

void give_downloads(ec_slave_config& config) {
    if (!config.plan.startup.empty()) config.plan.setup.startup = StartupCommands(config.plan.startup);
}

bool place_by_lists(const Slave& slave, ec_slave_config& config) {
    const bool known = slave.seen && !slave.held && slave.al.state == AlState::preop;
    if (!known || !has_whole_lists(config)) return false;
    const auto lacks = [&](const SmPdos& list) { return !list.pdos.empty() && list.sync_manager >= slave.sm_count; };
    if (std::ranges::any_of(config.plan.sms, lacks)) return false;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n)
        if (slave.sync_managers[n].type == SmType::outputs && !is_listed(config, n)) return false;
    take_lists(slave, config);
    const auto wanted = std::ranges::count_if(config.plan.sms, [](const SmPdos& list) { return !list.pdos.empty(); });
    if (wanted == 0 || slave.config.sm_count != wanted || !is_apart(slave)) {
        slave.config.sm_count = 0;
        slave.config.source = ConfigurationSource::none;
        return false;
    }
    slave.config.highest = AlState::preop;
    return true;
}

void allow_start(const Slave& slave, ec_slave_config& config) {
    give_downloads(config);
    if (config.late && slave.number != 0) slave.config.highest = AlState::op;
}

void note_start(const Slave& slave, ec_slave_config& config) {
    const StartUp before = config.start_up.load(std::memory_order_relaxed);
    if (before == StartUp::over) return;
    StartUp now = before;
    if (slave.al.state == AlState::init)
        now = StartUp::in_init;
    else if (before == StartUp::in_init || slave.al.state != AlState::preop)
        now = StartUp::over;
    config.start_up.store(now, std::memory_order_release);
}

void prepare_start_up(const Slave& slave, ec_slave_config& config) {
    if (config.ip == EoeIp{} && config.wait_before_safeop == Duration{0} && !config.late) return;
    slave.hooks.preop_to_safeop = before_safeop;
    slave.hooks.user = &config;
}

}  // namespace margay::compat::ecrt

using namespace margay;
using namespace margay::compat::ecrt;

// The interface stores any key, and reads the keys that it knows.
int ecrt_slave_config_flag(ec_slave_config_t* sc, const char* key, int32_t value) {
    if (key == nullptr) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    const std::string_view flag(key);
    if (flag == "WaitBeforeSAFEOPms") {
        if (value < 0) return -EINVAL;
        sc->wait_before_safeop = std::chrono::milliseconds(value);
    } else if (flag != "AssignToPdi") {  // each slave has its EEPROM from before PREOP on
        say("configuration %u:%u: the flag %s has no effect", sc->alias, sc->position, key);
    }
    return 0;
}
