// The settings that the library gets at activation: groups, and the configuration of each slave. expected.cpp has the
// list of slaves.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/operation.hpp"
#include "compat/ecrt/start_up.hpp"

#include <algorithm>
#include <cerrno>
#include <map>
#include <set>

namespace margay::compat::ecrt {
namespace {

constexpr std::size_t kImageBytes = 65536;
constexpr std::uint16_t kUsualDivider = 2498;  // 100 us
constexpr std::uint16_t kUsualIntervals = 1000;
constexpr std::uint16_t kWatchdogTime = 0x0420;  // of process data

bool registered(const Bus& bus, const ec_slave_config& config, std::uint8_t sm) {
    for (const auto& domain : bus.domains)
        for (const DomainPart& part : domain->parts)
            if (part.config == &config && part.sync_manager == sm) return true;
    return false;
}

// The process data watchdog of the slave; nothing: as the slave has it.
std::optional<SlaveConfiguration::Watchdog> watchdog_of(const ec_slave_config& config) {
    bool enable = config.watchdog_intervals != 0;
    bool disable = false;
    for (const SyncWish& sync : config.syncs) {
        if (!sync.set || sync.direction != EC_DIR_OUTPUT || sync.pdos.empty()) continue;
        enable |= sync.watchdog == EC_WD_ENABLE;
        disable |= sync.watchdog == EC_WD_DISABLE;
    }
    if (!enable && disable) return SlaveConfiguration::Watchdog{0};
    if (!enable) return std::nullopt;
    const std::uint32_t unit_ns = (config.times.watchdog_divider.value_or(kUsualDivider) + 2U) * 40U;
    const std::uint32_t intervals = config.watchdog_intervals != 0 ? config.watchdog_intervals : kUsualIntervals;
    const std::uint64_t time_us = std::uint64_t{unit_ns} * intervals / 1000;
    return SlaveConfiguration::Watchdog(std::max<std::uint32_t>(static_cast<std::uint32_t>(time_us), 1));
}

StartupCommand command_of(const StartupWrite& write) {
    const Transition when =
        write.parameter && write.state == EC_AL_STATE_SAFEOP ? Transition::safeop_to_op : Transition::init_to_preop;
    const Borrowed<std::byte> data(write.data);
    if (write.parameter) return write_parameter(when, write.subindex, Idn{write.index}, data);
    if (write.complete) return write_whole_object(when, write.index, data);
    return write_object(when, write.index, write.subindex, data);
}

}  // namespace

void Operation::plan_groups() {
    std::map<const ec_slave_config*, ec_domain*> first;  // a domain of each slave
    std::map<ec_domain*, ec_domain*> root;
    for (const auto& domain : bus_.domains) root[domain.get()] = domain.get();
    const auto find = [&](ec_domain* domain) {
        while (root[domain] != domain) domain = root[domain];
        return domain;
    };
    for (const auto& domain : bus_.domains)
        for (const DomainPart& part : domain->parts) {
            const auto [known, added] = first.try_emplace(part.config, domain.get());
            if (!added) root[find(domain.get())] = find(known->second);
        }
    // A domain without entries needs no frames: it belongs to the exchange of the first one that has some, or of the
    // first one if none has.
    auto home = std::ranges::find_if(bus_.domains, [](const auto& domain) { return !domain->parts.empty(); });
    if (home == bus_.domains.end()) home = bus_.domains.begin();
    for (const auto& domain : bus_.domains)
        if (domain->parts.empty() && domain != *home) root[domain.get()] = find(home->get());
    std::map<ec_domain*, Exchange*> exchange_of;
    for (const auto& domain : bus_.domains) {
        Exchange*& exchange = exchange_of[find(domain.get())];
        if (exchange == nullptr) {
            bus_.exchanges.push_back(std::make_unique<Exchange>());
            exchange = bus_.exchanges.back().get();
            exchange->group = static_cast<std::uint8_t>(bus_.exchanges.size() - 1);
        }
        exchange->domains.push_back(domain.get());
        domain->exchange = exchange;
    }
    // Slaves without an entry in a domain are brought to OP with the first group.
    if (bus_.exchanges.empty()) bus_.exchanges.push_back(std::make_unique<Exchange>());
    for (const auto& exchange : bus_.exchanges) exchange->image.assign(kImageBytes, std::byte{0});
    for (const auto& config : bus_.configs) {
        const auto known = first.find(config.get());
        config->group = known == first.end() ? std::uint8_t{0} : known->second->exchange->group;
    }
    for (const auto& exchange : bus_.exchanges) {
        const auto in_frames = [&](const auto& config) { return config->group == exchange->group; };
        const auto refuses = [&](const auto& config) { return in_frames(config) && !config->overlapping; };
        bus_.ctx->group(exchange->group).config.overlapped =
            std::ranges::any_of(bus_.configs, in_frames) && std::ranges::none_of(bus_.configs, refuses);
    }
}

void Operation::plan_slave(ec_slave_config& config) {
    SlavePlan& plan = config.plan;
    plan = {};
    plan.pdos.resize(EC_MAX_SYNC_MANAGERS);
    for (std::uint8_t sm = 0; sm < EC_MAX_SYNC_MANAGERS; ++sm) {
        const SyncWish& sync = config.syncs[sm];
        if (!sync.set && !(sync.from_slave && registered(bus_, config, sm))) continue;
        if (sync.pdos.empty() && sm < 2) continue;  // the mailboxes in lists that name all SyncManagers
        for (const PdoWish& pdo : sync.pdos) plan.pdos[sm].push_back({pdo.index, Borrowed<PdoEntry>(pdo.entries)});
        plan.sms.push_back({sm, Borrowed<Pdo>(plan.pdos[sm])});
    }
    for (const StartupWrite& write : config.startup) plan.startup.push_back(command_of(write));
    // The library has the time of a watchdog in microseconds; the program has given the value of the register.
    if (config.watchdog_intervals != 0)
        plan.startup.push_back(write_register(Transition::preop_to_safeop, kWatchdogTime, config.watchdog_intervals));
    if (!plan.sms.empty()) plan.setup.pdos = PdoLists(plan.sms);
    if (!has_whole_lists(config)) give_downloads(config);
    plan.setup.times = config.times;
    if (config.dc.set && config.dc.assign_activate != 0)
        plan.setup.dc = {.source = SyncSettings::Source::application,
                         .assign_activate = config.dc.assign_activate,
                         .sync0_cycle = Duration(config.dc.sync0_cycle),
                         .sync1_cycle = Duration(config.dc.sync1_cycle),
                         .shift = Duration(config.dc.sync0_shift)};
    plan.configuration.group = config.group;
    plan.configuration.process_data_watchdog = watchdog_of(config);
    plan.configuration.setup = &plan.setup;
}

int Operation::plan() {
    plan_groups();
    if (bus_.exchanges.size() > bus_.ctx->limits().groups) {
        say("master %u: %zu domains, %u at most", bus_.index, bus_.domains.size(), bus_.ctx->limits().groups);
        return -ENOMEM;
    }
    for (const auto& config : bus_.configs) plan_slave(*config);
    return plan_expected();
}

}  // namespace margay::compat::ecrt
