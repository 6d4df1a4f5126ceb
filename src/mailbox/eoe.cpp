#include "mailbox/eoe.hpp"

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

Task<Result<>> eoe_call(MailboxChannel& channel, EoeCall call, MailPatience patience) {
    MailSession session(channel, wire::MailboxType::eoe, patience.priority, patience.give_up);
    Error failed = co_await session;
    EoeClient client(call);
    const auto key = mail_key::of(mail_key::Kind::eoe, static_cast<std::uint32_t>(call.type));
    const Time begun = channel.engine().now();
    if (failed.code == Errc::none) failed.code = Errc::reply_lost;
    unsigned times = 0;
    for (; failed.code == Errc::reply_lost && times <= kMostAskedAgain; ++times) {
        MailExchange exchange(session, client, {.patience = patience, .key = key});
        failed = co_await exchange;
    }
    if (times > 1) channel.owe_second_reply(wire::MailboxType::eoe, key, begun);
    if (failed.code == Errc::none) failed = client.error();
    if (failed.code == Errc::none) co_return Nothing{};
    failed.slave = channel.station().number;
    failed.step = call.step;
    co_return failed;
}

}  // namespace margay
