// The requests for EoE parameters.
#include "mailbox/eoe.hpp"

#include "api/hooked.hpp"
#include "api/mail.hpp"

namespace margay {

namespace {

using wire::eoe::Type;

EoeCall call_of(EoeSetIp& r) {
    return {.type = Type::set_ip_request, .step = Step::eoe_set_ip, .set_ip = &r.ip, .compact = r.packed};
}
EoeCall call_of(EoeGetIp& r) { return {.type = Type::get_ip_request, .step = Step::eoe_get_ip, .got_ip = &r.ip}; }
EoeCall call_of(EoeSetFilter& r) {
    return {.type = Type::set_filter_request, .step = Step::eoe_set_filter, .set_filter = &r.filter};
}
EoeCall call_of(EoeGetFilter& r) {
    return {.type = Type::get_filter_request, .step = Step::eoe_get_filter, .got_filter = &r.filter};
}

constexpr std::size_t bytes_of(const EoeSetIp&) { return wire::eoe::kIpBytes; }
constexpr std::size_t bytes_of(const EoeSetFilter&) { return wire::eoe::kFilterBytes; }
constexpr std::size_t bytes_of(const MailRequest&) { return 0; }

Error check_eoe(Network& network, const MailRequest& r, Step step, std::size_t bytes) {
    const Error where{.step = step, .slave = r.slave};
    const Error refused = check_mailbox(network, mailbox_protocol::kEoE, where);
    if (refused.code != Errc::none) return refused;
    return check_message(network, wire::eoe::kHeaderBytes + bytes, where);
}

template <class R, Step S>
Error check(Network& network, const R& r) {
    return check_eoe(network, r, S, bytes_of(r));
}

Error check_filter(Network& network, const EoeSetFilter& r) {
    const EoeFilter& filter = r.filter;
    if (filter.address_count > EoeFilter::kAddresses || filter.mask_count > EoeFilter::kMasks)
        return invalid(Argument::eoe_filter, Step::eoe_set_filter, r.slave);
    return check_eoe(network, r, Step::eoe_set_filter, bytes_of(r));
}

Task<Result<>> execute(Network& network, MailRequest& r, const EoeCall& call) {
    return eoe_call(channel_of(network, r), call, patience_of(r));
}
template <class R>
Task<Result<>> run(Network& network, R& r) {
    return execute(network, r, call_of(r));
}

template <class R, Step S>
constexpr OperationDescription describe_eoe() {
    return describe_mail<R, check<R, S>, run<R>>(Operation::eoe_parameters, S);
}

constexpr OperationDescription kSetIp = describe_eoe<EoeSetIp, Step::eoe_set_ip>();
constexpr OperationDescription kGetIp = describe_eoe<EoeGetIp, Step::eoe_get_ip>();
constexpr OperationDescription kSetFilter =
    describe_mail<EoeSetFilter, check_filter, run<EoeSetFilter>>(Operation::eoe_parameters, Step::eoe_set_filter);
constexpr OperationDescription kGetFilter = describe_eoe<EoeGetFilter, Step::eoe_get_filter>();

}  // namespace

EoeSetIp::EoeSetIp() : MailRequest(kSetIp) {}
EoeGetIp::EoeGetIp() : MailRequest(kGetIp) {}
EoeSetFilter::EoeSetFilter() : MailRequest(kSetFilter) {}
EoeGetFilter::EoeGetFilter() : MailRequest(kGetFilter) {}

Task<> HookedSlave::eoe_set_ip(const EoeIp& ip) const { return set_in_hook(*this, &EoeSetIp::ip, ip); }
Task<> HookedSlave::eoe_set_filter(const EoeFilter& filter) const {
    return set_in_hook(*this, &EoeSetFilter::filter, filter);
}

// ------------------------------------------------------------------ functions that wait

Result<> EOEset_ip(Context& ctx, std::uint16_t slave, const EoeIp& ip, Duration timeout) {
    EoeSetIp request;
    request.slave = slave;
    request.timeout = timeout;
    request.ip = ip;
    return submit_and_wait(ctx, request);
}

Result<EoeIp> EOEget_ip(Context& ctx, std::uint16_t slave, Duration timeout) {
    EoeGetIp request;
    request.slave = slave;
    request.timeout = timeout;
    return submit_and_wait(ctx, request, request.ip);
}

Result<> EOEset_filter(Context& ctx, std::uint16_t slave, const EoeFilter& filter, Duration timeout) {
    EoeSetFilter request;
    request.slave = slave;
    request.timeout = timeout;
    request.filter = filter;
    return submit_and_wait(ctx, request);
}

Result<EoeFilter> EOEget_filter(Context& ctx, std::uint16_t slave, Duration timeout) {
    EoeGetFilter request;
    request.slave = slave;
    request.timeout = timeout;
    return submit_and_wait(ctx, request, request.filter);
}

std::string_view eoe_result_text(EoeResult result) { return wire::eoe::to_text(result); }

}  // namespace margay
