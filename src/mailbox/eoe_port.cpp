// The sequence that exchanges the frames of an EoePort with its slave.
#include "mailbox/eoe.hpp"
#include "mailbox/eoe_relay.hpp"
#include "mailbox/mailboxes.hpp"

#include <algorithm>
#include <utility>

namespace margay {

namespace {

constexpr Duration kSoon = std::chrono::microseconds(100);
constexpr Duration kClosedLook = std::chrono::milliseconds(10);

// Decides when to look for mail: soon after a fragment came or went, then less and less often.
class RelayLooks final : public EoeRelayWatch {
  public:
    RelayLooks(MailboxChannel& channel, const EoePort& port)
        : channel_(channel), longest_(std::max(port.look_every, kSoon)) {}
    void look() {
        const Time now = channel_.engine().now();
        if (now < look_at_) return;
        channel_.look_once();
        look_at_ = now + pause_;
        pause_ = std::min(2 * pause_, longest_);
    }
    void look_soon() {
        pause_ = kSoon;
        const Time soon = channel_.engine().now() + kSoon;
        if (soon >= look_at_) return;
        look_at_ = soon;
        if (!asleep_) return;
        timer_.unlink();
        channel_.engine().sleep(timer_, timer_.handle, look_at_);
    }

    // Awaitable: resumes when it is time to look.
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> h) noexcept {
        asleep_ = true;
        channel_.engine().sleep(timer_, h, look_at_);
    }
    void await_resume() noexcept { asleep_ = false; }

  private:
    // The pump sends a message: the look shares its frame.
    void composing() override { look(); }
    void arrived(bool more) override {
        look_soon();
        if (more) channel_.expect_more();
    }

    MailboxChannel& channel_;
    Duration longest_;
    Duration pause_ = kSoon;
    Time look_at_ = Time::min();
    Engine::Sleep::Timer timer_;
    bool asleep_ = false;
};

}  // namespace

namespace {

// Whether the slave can exchange frames: not in BOOT, and not if a scan has found another slave without EoE.
bool carries_frames(const MailboxChannel& channel) {
    const Slave& slave = channel.slave();
    return channel.is_reachable() && slave.al.state != AlState::boot &&
           (slave.mailbox.protocols & mailbox_protocol::kEoE) != 0;
}

}  // namespace

Task<Result<>> eoe_relay(MailboxChannel& channel, EoePort& port) {
    const std::uint16_t number = port.slave;
    if (channel.mailboxes().is_heard(number, MailboxType::eoe)) {
        Error other{.code = Errc::busy, .step = Step::eoe_frames, .slave = number};
        other.detail = static_cast<std::uint32_t>(Operation::eoe_port);
        co_return other;
    }
    RelayLooks looks(channel, port);
    EoeRelay relay(number, port, looks);
    channel.mailboxes().listen(relay);
    Engine& engine = channel.engine();
    std::uint32_t epoch = channel.epoch();
    for (;;) {
        if (std::exchange(epoch, channel.epoch()) != channel.epoch()) relay.begin_again();
        if (!carries_frames(channel)) {
            relay.drop_all();
            co_await engine.sleep_for(kClosedLook);
            continue;
        }
        if (!relay.has_fragment()) {
            looks.look();
            co_await looks;
            continue;
        }
        const MailPatience patience{.each = port.send_patience, .priority = port.priority};
        MailExchange fragment(channel, MailboxType::eoe, relay, {.patience = patience, .reply = false});
        const Error failed = co_await fragment;
        relay.sent(failed.code == Errc::none);
        looks.look_soon();
    }
}

}  // namespace margay
