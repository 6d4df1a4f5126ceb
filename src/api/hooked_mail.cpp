// The functions of HookedSlave for mailbox messages and AoE.
#include "api/hooked.hpp"
#include "api/mail.hpp"
#include "mailbox/raw_mail.hpp"

#include <margay/aoe.hpp>

namespace margay {
namespace {

Task<Result<std::size_t>> transfer(HookedSlave hooked, MailboxType type, Bytes message, MutableBytes answer) {
    const HookCall call(hooked);
    Network& network = HookAccess::network(hooked);
    RawMail request;
    request.slave = hooked.number();
    request.type = type;
    request.message = message;
    request.answer = answer;
    Result<> done = message.empty() ? invalid(Argument::mail_size, Step::mailbox_send, request.slave)
                                    : RequestAccess::operation(request).check(network, request);
    if (done) done = co_await transfer_raw(network.mailbox(hooked.slave()), request, startup_patience(hooked.slave()));
    co_await call.pause_after(done.error());
    co_return done ? Result<std::size_t>(request.bytes) : Result<std::size_t>(done.error());
}

}  // namespace

Task<Result<std::size_t>> HookedSlave::raw_mail(MailboxType type, std::span<const std::byte> message,
                                                std::span<std::byte> answer) const {
    return transfer(*this, type, message, answer);
}
Task<> HookedSlave::aoe_set_net_id(const AoeNetId& net_id) const {
    return set_in_hook(*this, &AoeSetNetId::net_id, net_id);
}

}  // namespace margay
