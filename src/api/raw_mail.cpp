// The request for a mailbox message of any protocol.
#include "mailbox/raw_mail.hpp"

#include "api/mail.hpp"

namespace margay {

static Error check(Network& network, const RawMail& r) {
    const Error where{.step = Step::mailbox_send, .slave = r.slave};
    const Error refused = check_mailbox(network, where);
    if (refused.code != Errc::none) return refused;
    const auto type = static_cast<unsigned>(r.type);
    if (type == 0 || type > 15) return invalid(Argument::mail_type, where.step, r.slave);
    if (r.message.empty() && r.answer.empty()) return invalid(Argument::mail_size, where.step, r.slave);
    return check_message(network, r.message.size(), where);
}

static Task<Result<>> run(Network& network, RawMail& r) {
    r.bytes = 0;
    MailboxChannel& channel = channel_of(network, r);
    const MailPatience patience = patience_of(r);
    if (r.message.empty()) co_return co_await required(await_raw(channel, r, patience));
    co_return co_await required(transfer_raw(channel, r, patience));
}

static constexpr OperationDescription kRaw =
    describe_mail<RawMail, check, run>(Operation::raw_mail, Step::mailbox_send);
RawMail::RawMail() : SlaveRequest(kRaw) {}

Result<std::size_t> raw_mail(Context& ctx, std::uint16_t slave, MailboxType type, std::span<const std::byte> message,
                             std::span<std::byte> answer, Duration timeout) {
    RawMail request;
    request.slave = slave;
    request.timeout = timeout;
    request.type = type;
    request.message = message;
    request.answer = answer;
    return submit_and_wait(ctx, request, request.bytes);
}

}  // namespace margay
