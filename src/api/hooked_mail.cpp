// The functions of HookedSlave for mailbox messages and AoE.
#include "api/mail.hpp"
#include "mailbox/aoe.hpp"
#include "mailbox/raw_mail.hpp"
#include "network/hooks.hpp"
#include "network/pdos.hpp"

namespace margay {
namespace {

// The same as the request does, within the sequence of the hook.
template <class R>
Error check_in_hook(Network& network, R& request) {
    return RequestAccess::operation(request).check(network, request);
}

Task<Result<std::size_t>> transfer(HookedSlave hooked, MailboxType type, Bytes message, MutableBytes answer) {
    Network& network = HookAccess::network(hooked);
    RawMail request;
    request.slave = hooked.number();
    request.type = type;
    request.message = message;
    request.answer = answer;
    Error refused = check_in_hook(network, request);
    if (message.empty()) refused = invalid(Argument::mail_size, Step::mailbox_send, request.slave);
    if (refused.code != Errc::none) {
        auto later = co_await refuse_in_hook(hooked, refused);
        co_return later.error();
    }
    const MailPatience patience = startup_patience(hooked.slave());
    MailboxChannel& channel = network.mailbox(hooked.slave());
    co_await required(transfer_raw(channel, request, patience));
    co_return request.bytes;
}

Task<> set_net_id(HookedSlave hooked, AoeNetId net_id) {
    Network& network = HookAccess::network(hooked);
    AoeSetNetId request;
    request.slave = hooked.number();
    request.net_id = net_id;
    request.timeout = startup_patience(hooked.slave()).each;
    const Error refused = check_in_hook(network, request);
    if (refused.code != Errc::none) co_return co_await required(refuse_in_hook(hooked, refused));
    auto done = co_await RequestAccess::operation(request).sequence(network, request);
    co_return done;
}

}  // namespace

Task<Result<std::size_t>> HookedSlave::raw_mail(MailboxType type, std::span<const std::byte> message,
                                                std::span<std::byte> answer) const {
    return transfer(*this, type, message, answer);
}
Task<> HookedSlave::aoe_set_net_id(const AoeNetId& net_id) const { return set_net_id(*this, net_id); }

}  // namespace margay
