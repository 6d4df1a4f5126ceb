// A scripted slave that answers slowly, and in order.
#pragma once

#include "mailbox/foe_bus.hpp"

#include <functional>
#include <optional>

namespace margay {

using wire::MailboxType;

// A download of a value of 16 bits.
struct Write : SdoDownload {
    explicit Write(unsigned v, std::uint16_t object = 0x2000, Duration most = Duration{0})
        : octets{static_cast<std::byte>(v), std::byte{0}} {
        slave = 1;
        index = object;
        data = octets;
        timeout = most;
    }
    std::array<std::byte, 2> octets;
};

// A slave that answers in order, each message after its own time. With `queues` it reads all messages at once,
// otherwise it reads a message when it has answered the previous message.
class SlowSlave {
  public:
    explicit SlowSlave(MailboxBus& bus, std::uint16_t mailbox_bytes = 64)
        : bus_(bus), slave_(bus.add_scripted(mailbox_bytes)) {
        slave_.on_mail = [this](const Mail& mail) {
            // A message with the counter of the previous message is a repetition of that message.
            const auto counter = wire::load_mailbox_header(mail).counter;
            if (counter != 0 && counter == counter_) return;
            counter_ = counter;
            in_.push_back(mail);
            slave_.takes = queues;
        };
    }
    struct Answer {
        Duration after{0};
        std::vector<Mail> mails;
        std::optional<MailboxType> type{};  // none: the type of the message
    };
    bool queues = false;
    std::function<Answer(MailboxType, const Mail&)> answers;

    void step() {
        const Time now = bus_.osal.now();
        if (!working_ && !in_.empty()) {
            type_ = wire::load_mailbox_header(in_.front()).type;
            working_ = answers(type_, in_.front());
            in_.pop_front();
            ready_ = now + working_->after;
        }
        if (working_ && now >= ready_) {
            for (const Mail& mail : working_->mails) slave_.reply(mail, working_->type.value_or(type_));
            working_.reset();
        } else if (!working_) {
            slave_.takes = true;
        }
        bus_.step();
    }
    void run(const Request& request) {
        const Time end = bus_.osal.now() + 60s;
        while (request.busy() && bus_.osal.now() < end) step();
        EXPECT_FALSE(request.busy());
    }
    void idle(Duration time) {
        for (const Time end = bus_.osal.now() + time; bus_.osal.now() < end;) step();
    }
    // Sends mail that no request has asked for.
    void say(const Mail& data, MailboxType type) { slave_.reply(data, type); }
    [[nodiscard]] ScriptedSlave& script() { return slave_; }
    [[nodiscard]] const std::vector<Mail>& received() const { return slave_.received; }

  private:
    MailboxBus& bus_;
    ScriptedSlave& slave_;
    std::deque<Mail> in_;
    std::optional<Answer> working_;
    MailboxType type_{};
    Time ready_{};
    std::uint8_t counter_ = 0;
};

}  // namespace margay
