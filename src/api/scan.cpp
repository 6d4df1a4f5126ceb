// The request that scans the segment.
#include "network/scan.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {

// A scan discards all slaves, so it is refused while a supervision uses them.
static Error check(Network& network, const ScanRequest&) {
    if (!network.supervised) return {};
    return {.code = Errc::busy, .step = Step::count_slaves, .detail = static_cast<std::uint32_t>(Operation::supervise)};
}

static Task<Result<>> run(Network& network, ScanRequest& request) {
    auto count = co_await scan(network);
    note_of_segment(network, count.error());
    request.slaves = network.count;  // the result is set also if some slave is not as expected
    co_return count ? Result<>() : Result<>(count.error());
}

static constexpr OperationDescription kScan =
    describe_operation<ScanRequest, check, run>(Operation::scan, Step::count_slaves, Needs::segment);
ScanRequest::ScanRequest() : Request(kScan) {}

// The application has set `config` or `hooks` of this slave.
static bool has_wishes(const Slave& slave) {
    const SlaveConfiguration& config = slave.config;
    const SlaveHooks& hooks = slave.hooks;
    const bool flags = config.block_lrw || config.mailbox_status || config.optional || config.no_mailbox ||
                       config.no_complete_access || config.fixed_pdos;
    return flags || config.setup != nullptr || config.group != 0 || config.sm_count != 0 ||
           config.highest != AlState::op || config.process_data_watchdog ||
           config.source != ConfigurationSource::none || hooks.preop_to_safeop || hooks.transition ||
           hooks.mailbox_pdo != nullptr || hooks.mailbox_pdo_wanted != nullptr || hooks.soe_notification != nullptr;
}

void note_lost_wishes(Context& ctx, Step step) {
    Slave& nobody = ContextAccess::nobody(ctx);
    if (check_owner(ctx, step).code != Errc::none || !has_wishes(nobody)) return;
    nobody = Slave{};
    master_of(ctx)->network.note({.code = Errc::configuration_lost, .step = step});
}

Result<std::uint16_t> config_init(Context& ctx) {
    note_lost_wishes(ctx, Step::count_slaves);
    ScanRequest request;
    return submit_and_wait(ctx, request, request.slaves);
}

}  // namespace margay
