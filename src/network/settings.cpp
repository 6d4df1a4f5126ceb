#include "network/settings.hpp"

#include "network/startup.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint32_t kMostUnits = 0xFFFF;  // of a watchdog register

Argument invalid_time(const SlaveTimes& times) {
    const Duration none{0};
    if (std::min({times.to_preop, times.to_safeop, times.to_op, times.down}) < none) return Argument::state_time;
    if (times.mailbox < none) return Argument::mailbox_time;
    if (!times.pdi_watchdog) return Argument::unknown;
    const Duration longest = watchdog_unit(times) * kMostUnits;
    return *times.pdi_watchdog < none || *times.pdi_watchdog > longest ? Argument::pdi_watchdog : Argument::unknown;
}

Argument invalid_configuration(const SlaveConfiguration& config) {
    if (!is_highest(config.highest)) return Argument::highest;
    if (config.sm_count > SlaveConfiguration::kProcessSms) return Argument::sync_manager_count;
    if (config.source > ConfigurationSource::application) return Argument::configuration_source;
    const auto watchdog = config.process_data_watchdog;
    if (watchdog && *watchdog > watchdog_unit(config.times()) * kMostUnits) return Argument::watchdog_time;
    return invalid_time(config.times());
}

// Checks the SyncManagers that the application has set, not the SyncManagers that the slave has named.
Argument invalid_sync_manager(const Slave& slave) {
    const ConfigurationSource source = slave.config.source;
    if (source >= ConfigurationSource::sii && source <= ConfigurationSource::coe) return Argument::unknown;
    const bool mailbox = slave.mailbox.present() && !slave.config.no_mailbox;
    for (const ProcessSm& sm : slave.config.used_sms()) {
        if (sm.direction > Direction::inputs) return Argument::sync_manager_direction;
        if (mailbox && sm.number < 2) return Argument::sync_manager_of_mailbox;
    }
    return Argument::unknown;
}

}  // namespace

Error invalid_mapping(Argument argument, std::uint16_t slave) {
    return {.code = Errc::invalid_argument,
            .step = Step::map_process_data,
            .slave = slave,
            .detail = static_cast<std::uint32_t>(argument)};
}

Duration watchdog_unit(const SlaveTimes& times) {
    return std::chrono::nanoseconds(40) * (times.watchdog_divider.value_or(kDividerFor100us) + 2);
}

Error invalid_setting(const Slave& slave) {
    if (const Argument wrong = invalid_configuration(slave.config); wrong != Argument::unknown)
        return invalid_mapping(wrong, slave.number);
    if (const Argument wrong = invalid_sync_manager(slave); wrong != Argument::unknown)
        return invalid_mapping(wrong, slave.number);
    const auto commands = slave.config.startup();
    return commands.empty() ? Error{} : slave.config.setup->startup.part()->invalid(slave);
}

Error invalid_setting(const Network& network, const ProcessGroup& group) {
    const GroupConfiguration& config = group.config;
    if (config.cycles_in_flight < 1 || config.cycles_in_flight > GroupConfiguration::kMostCyclesInFlight)
        return invalid_mapping(Argument::cycles_in_flight);
    if (config.packing > Packing::bits) return invalid_mapping(Argument::packing);
    if (config.lost_inputs > LostInputs::zero) return invalid_mapping(Argument::lost_inputs);
    if (std::ranges::any_of(config.entries, [](const EntryHandle* entry) { return entry == nullptr; }))
        return invalid_mapping(Argument::entry_handle);
    const bool empty =
        std::ranges::none_of(network.slaves(), [&](const Slave& slave) { return slave.config.group == group.number; });
    if (!empty || config.al_status || config.dc_reference != 0) return Error{};
    Error error = invalid_mapping(Argument::empty_group);
    error.actual = group.number;
    return error;
}

}  // namespace margay
