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

// The question whose answer no late one looks like: another read. fragment: there is none.
eoe::Type question_beside(MailboxChannel& channel, eoe::Type request) {
    for (const eoe::Type read : {eoe::Type::get_ip_request, eoe::Type::get_filter_request})
        if (read != request && channel.late_answers(wire::MailboxType::eoe, key_of_call(read)) == 0) return read;
    return eoe::Type::fragment;
}

Task<Result<>> settle_parameters(MailboxChannel& channel, MailSession& session, eoe::Type request,
                                 MailPatience patience) {
    const EoeCall call{.type = question_beside(channel, request)};
    if (call.type == eoe::Type::fragment) co_return Nothing{};
    EoeClient question(call);
    co_return co_await required(
        settle_late_answers(channel, session, key_of_call(request), question, key_of_call(call.type), patience));
}

}  // namespace

// The answers name no request, only its type.
Task<Result<>> eoe_call(MailboxChannel& channel, EoeCall call, MailPatience patience) {
    constexpr auto kType = wire::MailboxType::eoe;
    MailSession session(channel, kType, patience.priority, patience.give_up);
    Error failed = co_await session;
    EoeClient client(call);
    const std::uint64_t key = key_of_call(call.type);
    const Time begun = channel.engine().now();
    const bool granted = failed.code == Errc::none;
    if (granted && channel.late_answers(kType, key) != 0)
        co_await completion(settle_parameters(channel, session, call.type, patience));
    OrderedAsks asks(channel.late_answers(kType, key));
    for (bool again = granted; again; again = asks.again(failed.code, channel.late_answers(kType, key))) {
        client.restart();
        MailExchange exchange(session, client, {.patience = patience, .key = key});
        failed = co_await exchange;
    }
    if (asks.has_repeated()) channel.owe_second_reply(kType, key, begun);
    if (failed.code == Errc::none) failed = client.error();
    if (failed.code == Errc::none) co_return Nothing{};
    failed.slave = channel.station().number;
    failed.step = call.step;
    co_return failed;
}

}  // namespace margay
