// The requests for VoE messages.
#include "mailbox/voe.hpp"

#include "api/mail.hpp"
#include "wire/voe.hpp"

namespace margay {

static Error check(Network& network, const VoeSend& r) {
    const Error where{.step = Step::voe_send, .slave = r.slave};
    const Error refused = check_mailbox(network, mailbox_protocol::kVoE, where);
    if (refused.code != Errc::none) return refused;
    return check_message(network, wire::voe::kHeaderBytes + r.data.size(), where);
}

static Error check(Network& network, const VoeReceive& r) {
    if (r.inbox != nullptr && network.mailboxes.hears(*r.inbox)) return {};
    return invalid(Argument::mail_listener, Step::voe_receive);
}

static Task<Result<>> run(Network& network, VoeSend& r) {
    return voe_send(channel_of(network, r), r.header, r.data, patience_of(r));
}

static std::uint16_t next_with_voe(const void* user, std::uint16_t slave) {
    const auto slaves = static_cast<const Network*>(user)->slaves();
    for (std::size_t n = 0; n < slaves.size(); ++n) {
        const Slave& one = slaves[(slave + n) % slaves.size()];
        if ((one.mailbox.protocols & mailbox_protocol::kVoE) != 0) return one.number;
    }
    return 0;
}

static Task<Result<>> run(Network& network, VoeReceive& r) {
    r.message = {};
    return voe_receive(network.mailboxes, r, RequestAccess::deadline(r), {.next = next_with_voe, .user = &network});
}

static constexpr OperationDescription kSend = describe_mail<VoeSend, check, run>(Operation::voe_send, Step::voe_send);
VoeSend::VoeSend() : SlaveRequest(kSend) {}

static constexpr OperationDescription kReceive =
    describe_mail<VoeReceive, check, run>(Operation::voe_receive, Step::voe_receive);
VoeReceive::VoeReceive() : Request(kReceive) {}

Result<> VOEsend(Context& ctx, std::uint16_t slave, const VoeHeader& header, std::span<const std::byte> data,
                 Duration timeout) {
    VoeSend request;
    request.slave = slave;
    request.timeout = timeout;
    request.header = header;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<VoeMessage> VOEreceive(Context& ctx, VoeInbox& inbox, std::span<std::byte> into, Duration timeout) {
    VoeReceive request;
    request.timeout = timeout;
    request.inbox = &inbox;
    request.data = into;
    return submit_and_wait(ctx, request, request.message);
}

}  // namespace margay
