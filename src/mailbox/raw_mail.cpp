#include "mailbox/raw_mail.hpp"

#include "mailbox/coe_sdo.hpp"
#include "mailbox/mailboxes.hpp"

#include <algorithm>

namespace margay {
namespace {

bool answers(const RawMail& request, Bytes mail) {
    return request.is_answer == nullptr || request.is_answer(request, mail);
}

void keep(RawMail& request, Bytes mail) {
    request.bytes = mail.size();
    std::ranges::copy(mail.first(std::min(mail.size(), request.answer.size())), request.answer.begin());
}

// Keeps a mail of the answer. False: it is not the last mail of the answer.
bool keep_last(RawMail& request, Bytes mail) {
    keep(request, mail);
    return request.more_follows == nullptr || !request.more_follows(request, mail);
}

Error outcome(const RawMail& request, const MailboxChannel& channel) {
    if (request.bytes <= request.answer.size()) return {};
    Error error = channel.station().error(Errc::capacity, Step::mailbox_receive);
    error.expected = static_cast<std::uint32_t>(request.bytes);
    error.actual = static_cast<std::uint32_t>(request.answer.size());
    return error;
}

class RawMessage final : public MailClient {
  public:
    explicit RawMessage(RawMail& request) : request_(request) {}
    std::size_t compose(MutableBytes data) override {
        std::ranges::copy(request_.message.first(std::min(data.size(), request_.message.size())), data.begin());
        return request_.message.size() <= data.size() ? request_.message.size() : 0;
    }
    Taken accept(const wire::MailboxMessage& mail) override {
        if (!answers(request_, mail.data)) return Taken::no;
        return keep_last(request_, mail.data) ? Taken::all : Taken::more;
    }

  private:
    RawMail& request_;
};

// Ends the sleep of the sequence when mail has arrived.
class RawListener final : public MailListener {
  public:
    RawListener(MailboxChannel& channel, RawMail& request)
        : MailListener(request.type), channel_(channel), request_(request) {
        only_slave = channel.station().number;
        channel.mailboxes().listen_last(*this);
    }
    // Awaitable.
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> h) noexcept { channel_.engine().sleep(timer_, h, until); }
    void await_resume() const noexcept {}

    bool arrived = false;
    Time until = kNever;

  private:
    bool take(const UnaskedMail& mail) override {
        if (arrived || !answers(request_, mail.data)) return false;
        arrived = keep_last(request_, mail.data);
        if (arrived) channel_.engine().wake(timer_);
        return true;
    }

    MailboxChannel& channel_;
    RawMail& request_;
    Engine::Sleep::Timer timer_;
};

}  // namespace

Task<Result<>> transfer_raw(MailboxChannel& channel, RawMail& request, const MailPatience& patience) {
    const bool reply = !request.answer.empty();
    MailSession session(channel, request.type, patience.priority, patience.give_up);
    if (reply) {
        const Error refused = co_await session;
        if (refused.code != Errc::none) co_return channel.station().error(refused.code, Step::mailbox_send);
    }
    // Replies of CoE do not identify their message, and the message may continue a transfer of the caller.
    if (reply && request.type == wire::MailboxType::coe && channel.is_doubtful(mail_key::kAny))
        co_await required(settle_owed(channel, session, mail_key::kAny, patience, Step::mailbox_send));
    RawMessage message(request);
    MailExchange exchange(channel, request.type, message,
                          {.patience = patience,
                           .key = reply ? mail_key::kAny : 0,
                           .address = request.address,
                           .reply = reply,
                           .mails = request.more_follows != nullptr ? MailExchange::kManyMails : std::uint8_t{1},
                           .in_parts = request.more_follows != nullptr});
    const Error failed = co_await exchange;
    if (failed.code != Errc::none) {
        Error error = failed;
        error.slave = channel.station().number;
        if (error.step == Step::none) error.step = Step::mailbox_send;
        co_return error;
    }
    co_return outcome(request, channel);
}

Task<Result<>> await_raw(MailboxChannel& channel, RawMail& request, const MailPatience& patience) {
    constexpr Duration kLookEvery = std::chrono::milliseconds(1);
    RawListener listener(channel, request);
    const Time end = patience.for_one(channel.engine().now());
    const std::uint32_t epoch = channel.epoch();
    while (!listener.arrived) {
        const Time now = channel.engine().now();
        if (channel.epoch() != epoch) co_return channel.station().error(channel.cut_by(), Step::mailbox_receive);
        if (now >= end) co_return channel.station().error(Errc::timeout, Step::mailbox_receive);
        channel.look_once();
        listener.until = std::min(end, now + kLookEvery);
        co_await listener;
    }
    co_return outcome(request, channel);
}

}  // namespace margay
