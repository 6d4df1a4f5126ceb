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

Result<std::uint16_t> config_init(Context& ctx) {
    ScanRequest request;
    return submit_and_wait(ctx, request, request.slaves);
}

ScanProgress scan_progress(Context& ctx) {
    ScanProgress progress;
    for (const Slave& slave : ctx.slaves()) {
        if (slave.ring_position == 0) continue;  // missing
        const bool failed = slave.error.code != Errc::none;
        const bool stays = slave.held && !slave.mailbox.present();
        ++progress.slaves;
        if (slave.seen || failed) ++progress.identified;
        if (failed || (slave.seen && (stays || slave.al.state >= AlState::preop))) ++progress.started;
    }
    return progress;
}

}  // namespace margay
