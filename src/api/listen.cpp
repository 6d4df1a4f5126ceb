// Listeners for mail that no request waits for.
#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {

Result<> listen(Context& ctx, MailListener& listener) {
    constexpr Step kListenStep = Step::mailbox_receive;
    if (const Error refused = check_owner(ctx, kListenStep); refused.code != Errc::none) return refused;
    Mailboxes& mailboxes = master_of(ctx)->network.mailboxes;
    if (listener.listening()) return Error{.code = Errc::busy, .step = kListenStep, .slave = listener.only_slave};
    if (listener.only_slave > mailboxes.count())
        return Error{.code = Errc::unknown_slave,
                     .step = kListenStep,
                     .slave = listener.only_slave,
                     .expected = master_of(ctx)->network.count,
                     .actual = static_cast<std::uint32_t>(mailboxes.count())};
    if (listener.look_every < Duration{0}) return invalid(Argument::look_every, kListenStep, listener.only_slave);
    const auto type = static_cast<unsigned>(listener.type());
    if (type > 15) return invalid(Argument::mail_type, kListenStep, listener.only_slave);
    mailboxes.listen(listener);
    if (listener.look_every == Duration{0} || mailboxes.watch_for_listeners()) return Result<>();
    mailboxes.unlisten(listener);
    return Error{.code = Errc::capacity, .step = kListenStep, .slave = listener.only_slave, .detail = Error::kTasks};
}

Result<> unlisten(Context& ctx, MailListener& listener) {
    if (const Error refused = check_owner(ctx, Step::mailbox_receive); refused.code != Errc::none) return refused;
    Mailboxes& mailboxes = master_of(ctx)->network.mailboxes;
    if (mailboxes.hears(listener)) mailboxes.unlisten(listener);  // another context has another owner
    return Result<>();
}

}  // namespace margay
