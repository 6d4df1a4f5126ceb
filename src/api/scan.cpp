// Scanning the segment.
#include "network/scan.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {

// A scan begins anew with all slaves: not while a supervision looks after them.
static Error check(Network& network, const ScanRequest&) {
    if (!network.supervised) return {};
    return {.code = Errc::busy, .step = Step::count_slaves, .detail = static_cast<std::uint32_t>(Operation::supervise)};
}

static Task<Result<>> run(Network& network, ScanRequest& request) {
    auto count = co_await scan(network);
    request.slaves = count ? *count : network.count;  // some slave is not as wanted
    co_return count ? Result<>() : Result<>(count.error());
}

static constexpr OperationDescription kScan =
    describe_operation<ScanRequest, check, run>(Operation::scan, Step::count_slaves, Needs::segment);
ScanRequest::ScanRequest() : Request(kScan) {}

Result<std::uint16_t> config_init(Context& ctx) {
    ScanRequest request;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    return request.slaves;
}

}  // namespace margay
