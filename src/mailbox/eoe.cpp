#include "mailbox/eoe.hpp"

#include "mailbox/mail_order.hpp"

#include <algorithm>

namespace margay {

namespace eoe = wire::eoe;

std::size_t EoeClient::compose(MutableBytes data) {
    const std::size_t most = call_.set_ip != nullptr       ? eoe::kIpBytes
                             : call_.set_filter != nullptr ? eoe::kFilterBytes
                                                           : call_.parameters.size();
    if (data.size() < eoe::kHeaderBytes + most) return 0;
    eoe::store_header(data, call_.type, EoeResult::success);
    const auto parameters = data.subspan(eoe::kHeaderBytes);
    if (call_.set_ip != nullptr) return eoe::kHeaderBytes + eoe::store_ip(parameters, *call_.set_ip, call_.compact);
    if (call_.set_filter != nullptr) eoe::store_filter(parameters, *call_.set_filter);
    std::ranges::copy(call_.parameters, parameters.begin());
    return eoe::kHeaderBytes + most;
}

MailClient::Taken EoeClient::accept(const wire::MailboxMessage& mail) {
    if (mail.data.size() < eoe::kHeaderBytes) return Taken::no;
    const auto type = static_cast<unsigned>(eoe::load_header(mail.data).type);
    if (type != static_cast<unsigned>(call_.type) + 1) return Taken::no;
    const EoeResult result = eoe::Layout::result::load(mail.data);
    if (result != EoeResult::success)
        error_ = {.code = Errc::eoe_error, .detail = static_cast<std::uint32_t>(result)};
    else if (!take(mail.data.subspan(eoe::kHeaderBytes)))
        error_ = {.code = Errc::protocol};
    return Taken::all;
}

// False: octets are missing.
bool EoeClient::take(Bytes parameters) {
    if (call_.got_ip != nullptr) {
        const auto ip = eoe::load_ip(parameters);
        if (!ip) return false;
        *call_.got_ip = *ip;
    }
    if (call_.got_filter != nullptr) {
        const auto filter = eoe::load_filter(parameters);
        if (!filter) return false;
        *call_.got_filter = *filter;
    }
    return true;
}

namespace {

std::uint64_t key_of_call(eoe::Type request) {
    return mail_key::of(mail_key::Kind::eoe, static_cast<std::uint32_t>(request));
}

// Settles late answers. The question is one of the reads of parameters.
Task<Result<>> settle_parameters(MailboxChannel& channel, MailSession& session, eoe::Type request,
                                 MailPatience patience) {
    const std::uint64_t key = key_of_call(request);
    const auto number = channel.late_answers().next_question(wire::MailboxType::eoe, key);
    const EoeCall call{.type = LateAnswers::message_of(number.value_or(0))};
    EoeClient question(call);
    co_return co_await required(settle_late_answers(channel, session, key, question, number, patience));
}

}  // namespace

// An answer contains only the type of its request.
Task<Result<>> eoe_call(MailboxChannel& channel, EoeCall call, MailPatience patience) {
    constexpr auto kType = wire::MailboxType::eoe;
    MailSession session(channel, kType, patience.priority, patience.give_up);
    Error failed = co_await session;
    EoeClient client(call);
    const std::uint64_t key = key_of_call(call.type);
    const Time begun = channel.engine().now();
    const bool granted = failed.code == Errc::none;
    LateAnswers& late = channel.late_answers();
    Result<> settled = Nothing{};
    if (granted && (late.count(kType, key) != 0 || late.is_open(kType, key)))
        settled = co_await settle_parameters(channel, session, call.type, patience);
    if (!settled) failed = settled.error();
    const bool in_doubt = late.count(kType, key) != 0;
    OrderedAsks asks(late.count(kType, key));
    for (bool again = granted && settled; again; again = asks.again(failed.code, late.count(kType, key))) {
        client.restart();
        MailExchange exchange(session, client, {.patience = patience, .key = key});
        failed = co_await exchange;
    }
    if (asks.has_repeated()) channel.owe_second_reply(kType, key, begun);
    if (failed.code == Errc::none && !in_doubt && !asks.has_repeated()) late.end();
    if (failed.code == Errc::none) failed = client.error();
    if (failed.code == Errc::none) co_return Nothing{};
    failed.slave = channel.station().number;
    failed.step = call.step;
    co_return failed;
}

}  // namespace margay
