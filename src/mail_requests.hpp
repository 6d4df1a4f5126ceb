// What the requests to mailboxes have in common, whatever their protocol.
#pragma once

#include "mailbox/exchange.hpp"
#include "request_queue.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {

[[nodiscard]] inline MailPatience patience_of(MailRequest& request) {
    MailPatience patience{.give_up = QueueAccess::deadline(request),
                          .priority = std::min<std::uint8_t>(request.priority, 3)};
    if (request.timeout > Duration{0}) patience.each = request.timeout;
    return patience;
}

[[nodiscard]] inline MailboxChannel& channel_of(Network& network, const MailRequest& request) {
    return network.mailboxes.channel(request.slave);
}

// Whether the slave that `where` names can be asked by this protocol; otherwise `where` with the reason.
[[nodiscard]] inline Error check_mailbox(Network& network, std::uint16_t protocol, Error where) {
    const Error refused = check_slave(network, where.slave, where.step);
    where.code = refused.code;
    where.expected = refused.expected;
    if (refused.code != Errc::none) return where;
    const Slave& slave = network.slave(where.slave);
    if (!slave.mailbox.present() || (slave.mailbox.protocols & protocol) == 0)
        where.code = Errc::unsupported;
    else if (!network.mailbox(slave).is_open())
        where.code = Errc::wrong_state;  // never reached PREOP
    return where.code == Errc::none ? Error{} : where;
}

// As submit_and_wait(), but the thread of a cycle must not: it gets Errc::cycle_running.
template <class R>
Result<> do_and_wait(Context& ctx, R& request, Step step, std::uint16_t index, std::uint8_t subindex) {
    if (ContextAccess::osal(ctx) == nullptr) return Error{.code = Errc::wrong_state, .step = step};
    if (cycle_runs(ctx) && is_cycle_thread(ctx))
        return Error{
            .code = Errc::cycle_running, .step = step, .slave = request.slave, .index = index, .subindex = subindex};
    return submit_and_wait(ctx, request);
}

}  // namespace margay
