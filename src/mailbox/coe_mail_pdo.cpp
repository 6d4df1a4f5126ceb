#include "mailbox/coe_mail_pdo.hpp"

#include "mailbox/coe_sdo.hpp"

#include <margay/coe.hpp>

#include <algorithm>

namespace margay {

namespace coe = wire::coe;

namespace {

class RxPdo final : public MailClient {
  public:
    RxPdo(std::uint16_t number, Bytes data) : number_(number), data_(data) {}
    std::size_t compose(MutableBytes data) override {
        coe::store_header(data, {number_, coe::Service::rx_pdo});
        std::ranges::copy(data_, data.begin() + coe::kHeaderBytes);
        return coe::kHeaderBytes + data_.size();
    }
    Taken accept(const wire::MailboxMessage&) override { return Taken::no; }

  private:
    std::uint16_t number_;
    Bytes data_;
};

class TxPdo final : public MailClient {
  public:
    TxPdo(std::uint16_t number, MutableBytes into) : number_(number), into_(into) {}
    std::size_t compose(MutableBytes data) override {
        coe::store_header(data, {number_, coe::Service::tx_pdo_remote_request});
        return coe::kHeaderBytes;
    }
    Taken accept(const wire::MailboxMessage& mail) override {
        if (mail.data.size() < coe::kHeaderBytes) return Taken::no;
        const auto header = coe::load_header(mail.data);
        if (header.service != coe::Service::tx_pdo || header.number != number_) return Taken::no;
        const auto pdo = mail.data.subspan(coe::kHeaderBytes);
        bytes = pdo.size();
        std::ranges::copy(pdo.first(std::min(pdo.size(), into_.size())), into_.begin());
        return Taken::all;
    }
    std::size_t bytes = 0;

  private:
    std::uint16_t number_;
    MutableBytes into_;
};

Error pdo_error(Error error, MailboxChannel& channel, std::uint16_t number) {
    error.slave = channel.station().number;
    error.index = number;
    return error;
}

}  // namespace

// The error of a message that is longer than the mailbox. The mailbox may even be shorter than a CoE header.
static Error too_long(MailboxChannel& channel, std::uint16_t number, std::size_t bytes) {
    Error error = channel.station().error(Errc::capacity, Step::mailbox_send, number);
    error.expected = static_cast<std::uint32_t>(bytes);
    error.actual = static_cast<std::uint32_t>(channel.send_room());
    return error;
}

Task<Result<>> send_rx_pdo(MailboxChannel& channel, std::uint16_t number, Bytes data, const MailPatience& patience) {
    const std::size_t bytes = coe::kHeaderBytes + data.size();
    if (bytes > channel.send_room()) co_return too_long(channel, number, bytes);
    RxPdo pdo(number, data);
    MailExchange exchange(channel, wire::MailboxType::coe, pdo, {.patience = patience, .reply = false});
    const Error failed = co_await exchange;
    if (failed.code != Errc::none) co_return pdo_error(failed, channel, number);
    co_return Nothing{};
}

Task<Result<std::size_t>> fetch_tx_pdo(MailboxChannel& channel, std::uint16_t number, MutableBytes into,
                                       const MailPatience& patience) {
    if (coe::kHeaderBytes > channel.send_room()) co_return too_long(channel, number, coe::kHeaderBytes);
    MailSession session(channel, wire::MailboxType::coe, patience.priority, patience.give_up);
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return pdo_error(refused, channel, number);
    TxPdo pdo(number, into);
    Error failed{.code = Errc::reply_lost};
    for (unsigned n = 0; failed.code == Errc::reply_lost && n <= kMostAskedAgain; ++n) {
        const auto key = mail_key::of(mail_key::Kind::tx_pdo, number);
        if (channel.is_doubtful(key)) {
            auto settled = co_await settle_owed(channel, session, key, patience, Step::none);
            if (!settled) co_return pdo_error(settled.error(), channel, number);
        }
        MailExchange exchange(session, pdo, {.patience = patience, .key = key});
        failed = co_await exchange;
    }
    if (failed.code != Errc::none) co_return pdo_error(failed, channel, number);
    if (pdo.bytes <= into.size()) co_return pdo.bytes;
    Error error = channel.station().error(Errc::capacity, Step::mailbox_receive, number);
    error.expected = static_cast<std::uint32_t>(pdo.bytes);
    error.actual = static_cast<std::uint32_t>(into.size());
    co_return error;
}

// ------------------------------------------------------------------ PDOs that no request asked for

bool MailPdoListener::tell(const UnaskedMail& mail) {
    if (mail.data.size() < coe::kHeaderBytes) return false;
    const auto header = coe::load_header(mail.data);
    if (header.service == coe::Service::tx_pdo)
        received(mail.slave, header.number, mail.data.subspan(coe::kHeaderBytes));
    else if (header.service == coe::Service::rx_pdo_remote_request)
        wanted(mail.slave, header.number);
    else
        return false;
    return true;
}

}  // namespace margay
