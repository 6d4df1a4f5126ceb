// Configurations and hooks that were set for a slave that does not exist.
#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/slave.hpp>

namespace margay {

// Whether the application has set `config` or `hooks` of this slave; `given`: their value before. `sms` are compared
// only if the application is their source, because otherwise the library fills them in.
static bool has_wishes(const Slave& slave, const SlaveConfiguration& given) {
    const SlaveConfiguration& config = slave.config;
    const bool flags = config.block_lrw != given.block_lrw || config.mailbox_status != given.mailbox_status ||
                       config.optional != given.optional || config.no_mailbox != given.no_mailbox ||
                       config.no_complete_access != given.no_complete_access || config.fixed_pdos != given.fixed_pdos ||
                       config.unchecked_pdos != given.unchecked_pdos;
    const bool sms =
        config.source == ConfigurationSource::application && given.source != ConfigurationSource::application;
    return flags || sms || config.setup != given.setup || config.group != given.group ||
           config.highest != given.highest || config.process_data_watchdog != given.process_data_watchdog ||
           slave.hooks.preop_to_safeop || slave.hooks.transition || slave.hooks.user != nullptr;
}

static bool has_wishes(const GroupConfiguration& config) {
    const GroupConfiguration none;
    const bool flags = config.overlapped || config.block_lrw || config.al_status || config.hold_inputs;
    const bool lists = !config.copies.empty() || !config.entries.empty() || config.shared != nullptr;
    return flags || lists || config.start.value != none.start.value || config.packing != none.packing ||
           config.dc_reference != none.dc_reference || config.reserve_bytes != none.reserve_bytes ||
           config.acyclic_bytes != none.acyclic_bytes || config.cycles_in_flight != none.cycles_in_flight ||
           config.lost_inputs != none.lost_inputs;
}

static void note_wishes_for_no_group(Context& ctx, Step step) {
    GroupConfiguration& config = ContextAccess::no_group(ctx).config;
    if (!has_wishes(config)) return;
    config = {};
    master_of(ctx)->network.note({.code = Errc::configuration_lost, .step = step, .detail = Error::kOfGroup});
}

static void note_wishes_of_last_scan(Network& network, Step step) {
    const SlaveConfiguration none;
    for (const Slave& slave : network.slaves()) {
        const bool listed = slave.wanted != nullptr && slave.wanted->config != nullptr;
        if (has_wishes(slave, listed ? *slave.wanted->config : none))
            network.note({.code = Errc::configuration_lost, .step = step, .slave = slave.number});
    }
}

void note_lost_wishes(Request& request) {
    const OperationDescription& wanted = RequestAccess::operation(request);
    if (wanted.operation != Operation::scan && wanted.operation != Operation::map) return;
    Context& ctx = *RequestAccess::context(request);
    const Step step = wanted.step;
    if (step == Step::count_slaves) note_wishes_of_last_scan(master_of(ctx)->network, step);
    note_wishes_for_no_group(ctx, step);
    Slave& nobody = ContextAccess::nobody(ctx);
    const bool sms = nobody.config.sm_count != 0 || nobody.config.source != ConfigurationSource::none;
    if (!sms && !has_wishes(nobody, {})) return;
    nobody = Slave{};
    master_of(ctx)->network.note({.code = Errc::configuration_lost, .step = step});
}

}  // namespace margay
