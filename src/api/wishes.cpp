// Configurations and hooks that were set for a slave that does not exist.
#include "api/master.hpp"

#include <margay/slave.hpp>

namespace margay {

// The application has set `config` or `hooks` of this slave.
static bool has_wishes(const Slave& slave) {
    const SlaveConfiguration& config = slave.config;
    const SlaveHooks& hooks = slave.hooks;
    const bool flags = config.block_lrw || config.mailbox_status || config.optional || config.no_mailbox ||
                       config.no_complete_access || config.fixed_pdos;
    return flags || config.setup != nullptr || config.group != 0 || config.sm_count != 0 ||
           config.highest != AlState::op || config.process_data_watchdog ||
           config.source != ConfigurationSource::none || hooks.preop_to_safeop || hooks.transition;
}

// The same for a slave of the table, whose sizes the library has filled in. What expect() has given is not lost.
static bool has_wishes_of_its_own(const Slave& slave) {
    const SlaveConfiguration& config = slave.config;
    const SlaveConfiguration none;
    const SlaveConfiguration& given =
        slave.wanted != nullptr && slave.wanted->config != nullptr ? *slave.wanted->config : none;
    const bool flags = config.block_lrw != given.block_lrw || config.mailbox_status != given.mailbox_status ||
                       config.no_mailbox != given.no_mailbox || config.fixed_pdos != given.fixed_pdos;
    return flags || config.setup != given.setup || config.group != given.group || config.highest != given.highest ||
           config.process_data_watchdog != given.process_data_watchdog || slave.hooks.preop_to_safeop ||
           slave.hooks.transition;
}

static void note_wishes_of_last_scan(Network& network, Step step) {
    for (const Slave& slave : network.slaves())
        if (has_wishes_of_its_own(slave))
            network.note({.code = Errc::configuration_lost, .step = step, .slave = slave.number});
}

void note_lost_wishes(Context& ctx, Step step) {
    if (step == Step::count_slaves) note_wishes_of_last_scan(master_of(ctx)->network, step);
    Slave& nobody = ContextAccess::nobody(ctx);
    if (!has_wishes(nobody)) return;
    nobody = Slave{};
    master_of(ctx)->network.note({.code = Errc::configuration_lost, .step = step});
}

}  // namespace margay
