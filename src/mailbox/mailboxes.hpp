// The mailbox channels of all slaves: what they share.
#pragma once

#include "mailbox/channel.hpp"

#include <span>

namespace margay {

class Mailboxes {
  public:
    // `channels`: one a slave; `emergencies`: as many for each. Their memory outlives this.
    Mailboxes(Engine& engine, std::span<MailboxChannel> channels, std::span<Emergency> emergencies);
    Mailboxes(const Mailboxes&) = delete;
    Mailboxes& operator=(const Mailboxes&) = delete;
    ~Mailboxes() { close_all(); }

    // By position of the slave, 1 the first.
    [[nodiscard]] MailboxChannel& channel(std::size_t position) { return channels_[position - 1]; }
    [[nodiscard]] std::size_t count() const { return channels_.size(); }
    [[nodiscard]] Engine& engine() { return engine_; }
    [[nodiscard]] Arena& arena() { return engine_.arena(); }

    // Who is told of each emergency, when it is in its slave's ring.
    struct Listener {
        void (*emergency)(void* user, std::uint16_t slave, const Emergency& emergency) = nullptr;
        void* user = nullptr;
    };
    Listener listener;

    void close_all();
    void forget_all();

    // Looks every so often, with one datagram for all slaves, whether any has mail that nobody waits for. Zero: does
    // not.
    void watch(Duration every);

    // For channels: one has looked a few times in vain. When several have, one datagram for all takes the place of one
    // for each.
    [[nodiscard]] bool park(MailboxChannel& channel);
    // For channels: mail for another slave. False: there is no such slave.
    [[nodiscard]] bool route(MailboxChannel& from, const wire::MailboxMessage& mail);

  private:
    friend class MailboxChannel;
    class WatchGuard;

    Task<Result<>> watch_all();
    [[nodiscard]] bool hand_over_copy(MailboxChannel& to, MailboxChannel& from, const wire::MailboxMessage& mail);
    Task<Result<>> hand_over(MailboxChannel& to, MailboxChannel& from, wire::MailboxHeader header,
                             MutableBytes message);
    void ensure_watch();
    [[nodiscard]] std::size_t waiting() const;
    void somebody_has_mail(bool surely);
    void by_status_bits();

    Engine& engine_;
    std::span<MailboxChannel> channels_;
    Duration every_{0};
    std::size_t survey_ = 0;  // whose turn it is to be looked at
    TaskHandle watch_;
    Engine::Sleep::Timer nap_;
    std::uint8_t routing_ = 0;
    Crew tasks_;  // pumps, the watch, mail being routed
};

}  // namespace margay
