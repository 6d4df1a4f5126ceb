#include "mailbox/voe.hpp"

#include "mailbox/mailboxes.hpp"
#include "wire/voe.hpp"

#include <algorithm>

namespace margay {

namespace voe = wire::voe;

namespace {

class VoeText final : public MailClient {
  public:
    VoeText(VoeHeader header, Bytes data) : header_(header), data_(data) {}
    std::size_t compose(MutableBytes data) override {
        if (data.size() < voe::kHeaderBytes + data_.size()) return 0;
        voe::Layout::vendor_id::store(data, header_.vendor_id);
        voe::Layout::vendor_type::store(data, header_.vendor_type);
        std::ranges::copy(data_, data.begin() + voe::kHeaderBytes);
        return voe::kHeaderBytes + data_.size();
    }
    Taken accept(const wire::MailboxMessage&) override { return Taken::no; }

  private:
    VoeHeader header_;
    Bytes data_;
};

}  // namespace

Task<Result<>> voe_send(MailboxChannel& channel, VoeHeader header, Bytes data, MailPatience patience) {
    VoeText text(header, data);
    MailExchange exchange(channel, wire::MailboxType::voe, text, {.patience = patience, .reply = false});
    const Error failed = co_await exchange;
    if (failed.code == Errc::none) co_return Nothing{};
    Error error = failed;
    error.slave = channel.station().number;
    error.step = Step::voe_send;
    co_return error;
}

Task<Result<>> voe_receive(Mailboxes& mailboxes, VoeReceive& request, Time end, VoeSlaves slaves) {
    constexpr Duration kLookEvery = std::chrono::milliseconds(1);
    Engine& engine = mailboxes.engine();
    const std::uint16_t slave = request.inbox->only_slave;
    std::uint16_t looked = 0;
    for (;;) {
        const auto message = request.inbox->take(request.data);
        if (message) {
            request.message = *message;
            if (message->bytes <= request.data.size()) co_return Nothing{};
            Error error{.code = Errc::capacity, .step = Step::voe_receive, .slave = message->slave};
            error.expected = static_cast<std::uint32_t>(message->bytes);
            error.actual = static_cast<std::uint32_t>(request.data.size());
            co_return error;
        }
        if (!mailboxes.hears(*request.inbox))
            co_return Error{.code = Errc::mailbox_closed, .step = Step::voe_receive, .slave = slave};
        if (engine.now() >= end) co_return Error{.code = Errc::timeout, .step = Step::voe_receive, .slave = slave};
        looked = slave != 0 ? slave : slaves.next(slaves.user, looked);
        if (looked != 0 && looked <= mailboxes.count()) mailboxes.channel(looked).look_once();
        co_await engine.sleep_until(std::min(end, engine.now() + kLookEvery));
    }
}

}  // namespace margay
