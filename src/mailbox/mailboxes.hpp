// All mailbox channels of a master and their common tasks: looking for mail by one datagram for all slaves, and mail
// between slaves.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/mail_listener.hpp>

#include <span>

namespace margay {

class Mailboxes;
class MailboxChannel;
struct SoeFeature;

struct RoutingFeature {
    bool (*route)(Mailboxes& mailboxes, MailboxChannel& from, const wire::MailboxMessage& mail);
    static bool forward(Mailboxes& mailboxes, MailboxChannel& from, const wire::MailboxMessage& mail);
};

class Mailboxes {
  public:
    // `channels`: one for each slave; `emergencies`: divided equally among them. Their memory outlives this object.
    Mailboxes(Engine& engine, std::span<MailboxChannel> channels, std::span<Emergency> emergencies);
    Mailboxes(const Mailboxes&) = delete;
    Mailboxes& operator=(const Mailboxes&) = delete;
    ~Mailboxes();

    // `number` of the slave; 1 is the first slave.
    [[nodiscard]] MailboxChannel& channel(std::size_t number) { return channels_[number - 1]; }
    [[nodiscard]] std::size_t count() const { return channels_.size(); }
    [[nodiscard]] Engine& engine() { return engine_; }
    [[nodiscard]] Arena& arena() { return engine_.arena(); }

    // Mail that no exchange takes is offered to the listeners of its slave and type, in the order of listen().
    void listen(MailListener& listener);
    // The same as listen(), but the library calls this listener after all listeners of the application, also after
    // listeners that are added later.
    void listen_last(MailListener& listener);
    void unlisten(MailListener& listener);
    // Whether a listener for only this slave accepts mail of the type.
    [[nodiscard]] bool is_heard(std::uint16_t slave, MailboxType type);
    [[nodiscard]] bool hears(const MailListener& listener) const { return listener.mailboxes_ == this; }
    // False: no listener accepts the mail.
    [[nodiscard]] bool offer(const UnaskedMail& mail);
    // Looks regularly for the listeners that want it, from now on (listener_watch.cpp). False: no memory for the task.
    [[nodiscard]] bool watch_for_listeners();

    // Features that the context has, see <margay/features.hpp>.
    const SoeFeature* soe = nullptr;
    const RoutingFeature* routing = nullptr;
    const ExchangePart* exchanges = nullptr;  // given by the first exchange

    void close_all();
    void forget_all();

    // Looks for mail that no exchange waits for, every `every`, with one datagram for all slaves. Zero: off.
    void watch(Duration every);

    // For channels: called after some looks without mail. When several channels look, one datagram for all replaces
    // their own datagrams. Returns whether the channel is parked, so that it need not look itself.
    [[nodiscard]] bool park(MailboxChannel& channel);
    // For channels: forwards mail to another slave. False: there is no such slave, or the context does not forward.
    [[nodiscard]] bool route(MailboxChannel& from, const wire::MailboxMessage& mail);

  private:
    friend struct RoutingFeature;
    [[nodiscard]] bool forward_mail(MailboxChannel& from, const wire::MailboxMessage& mail);
    friend class MailboxChannel;
    class WatchGuard;

    Task<Result<>> watch_all();
    Task<Result<>> look_for_listeners();
    void look_for(const MailListener& listener);
    [[nodiscard]] bool start_forward(MailboxChannel& to, MailboxChannel& from, const wire::MailboxMessage& mail);
    Task<Result<>> forward(MailboxChannel& to, MailboxChannel& from, wire::MailboxHeader header, MutableBytes message);
    [[nodiscard]] bool offer_to(List<MailListener>& listeners, const UnaskedMail& mail);
    void ensure_watch();
    [[nodiscard]] std::size_t waiting() const;
    void wake_channels(bool surely);
    void by_status_bits();

    Engine& engine_;
    std::span<MailboxChannel> channels_;
    Duration every_{0};
    std::size_t survey_ = 0;  // the next channel to look at
    TaskHandle watch_;
    Engine::Sleep::Timer nap_;
    List<MailListener> listeners_;
    List<MailListener> new_listeners_;  // listeners that were added since the last mail
    List<MailListener> last_listeners_;
    MailListener* next_listener_ = nullptr;  // the listener that offer() asks next
    List<MailListener>* asked_ = nullptr;    // the list of next_listener_
    TaskHandle listening_;                   // look_for_listeners()
    std::uint8_t routing_ = 0;
    Crew tasks_;  // pumps, the watch, mail being forwarded
};

}  // namespace margay
