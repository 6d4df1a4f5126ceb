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

void note_lost_wishes(Context& ctx, Step step) {
    Slave& nobody = ContextAccess::nobody(ctx);
    if (!has_wishes(nobody)) return;
    nobody = Slave{};
    master_of(ctx)->network.note({.code = Errc::configuration_lost, .step = step});
}

}  // namespace margay
