#include "attach/rescan.hpp"

#include "api/operation.hpp"
#include "api/supervision.hpp"
#include "network/scan.hpp"
#include "network/wanted.hpp"

#include <algorithm>

namespace margay::attach {
namespace {

// The time is long, because a hook or a slow EEPROM of one slave may use the segment for seconds.
constexpr Duration kPatience = std::chrono::seconds(60);

bool exchanges_nothing(const Network& network) {
    return !network.supervised && std::ranges::none_of(network.process.groups, [](const ProcessGroup& group) {
        return group.mapped || group.mapping;
    });
}

bool is_missing(const Network& network, const Slave& slave) {
    const bool known = slave.seen || slave.wanted != nullptr;
    return known && slave.al.state == AlState::none && !may_be_missing(network, slave);
}

RescanFacts rescan_facts(Network& network, bool whole) {
    const auto count = [](auto some, auto which) {
        return static_cast<std::uint16_t>(std::ranges::count_if(some, which));
    };
    const auto answers = [](const Slave& slave) { return slave.al.state != AlState::none; };
    const auto strange = [](const RingPlace& place) { return place.slave == 0; };
    return {.whole = whole,
            .slaves = count(network.slaves(), answers),
            .missing = count(network.slaves(), [&](const Slave& slave) { return is_missing(network, slave); }),
            .unused = count(network.seen_ring(), strange)};
}

Error check(Network&, const RescanRequest&) { return {}; }

Task<Result<>> run(Network& network, RescanRequest& request) {
    const bool whole = request.whole && exchanges_nothing(network);
    request.too_early = !whole && network.count == 0;
    if (request.too_early) co_return Nothing{};
    if (whole) {
        const auto count = co_await scan(network);
        note_of_segment(network, count.error());
        // An error of one slave is not an error of the rescan: the table of slaves shows it.
        if (!count && count.error().slave == 0) co_return count.error();
    } else {
        co_await required(recover(network, request.search));
    }
    request.facts = rescan_facts(network, whole);
    co_return Nothing{};
}

constexpr OperationDescription kRescan =
    describe_operation<RescanRequest, check, run>(margay::Operation::recover, Step::recover, Needs::segment);

}  // namespace

RescanRequest::RescanRequest() : Request(kRescan) {}

RescanJob::RescanJob(AttachScan allowed) {
    request_.whole = allowed == AttachScan::whole;
    request_.timeout = kPatience;
}

Octets RescanJob::answer() { return octets_of(request_.facts); }

std::string RescanJob::refusal() {
    return request_.too_early ? "the application has not scanned its segment yet" : std::string();
}

}  // namespace margay::attach
