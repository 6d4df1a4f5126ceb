// Requests for PDOs by mailbox.
#include "api/mail.hpp"
#include "mailbox/coe_mail_pdo.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
static Error check(Network& network, const MailPdoSend& r) {
    return check_coe(network, r.slave, Step::mailbox_send, r.number, 0);
}
static Error check(Network& network, const MailPdoFetch& r) {
    return check_coe(network, r.slave, Step::mailbox_receive, r.number, 0);
}

static Task<Result<>> run(Network& network, MailPdoSend& request) {
    co_return co_await required(
        send_rx_pdo(channel_of(network, request), request.number, request.data, patience_of(request)));
}

static Task<Result<>> run(Network& network, MailPdoFetch& request) {
    auto read = co_await fetch_tx_pdo(channel_of(network, request), request.number, request.data, patience_of(request));
    request.bytes = read ? *read : std::size_t{0};
    co_return read ? Result<>() : Result<>(read.error());
}

static constexpr OperationDescription kSend =
    describe_mail<MailPdoSend, check, run>(Operation::mail_pdo, Step::mailbox_send);
MailPdoSend::MailPdoSend() : SlaveRequest(kSend) {}

static constexpr OperationDescription kFetch =
    describe_mail<MailPdoFetch, check, run>(Operation::mail_pdo, Step::mailbox_receive);
MailPdoFetch::MailPdoFetch() : SlaveRequest(kFetch) {}

}  // namespace margay
