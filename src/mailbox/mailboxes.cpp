#include "mailbox/mailboxes.hpp"

#include <margay/features.hpp>

#include "mailbox/arena_buffer.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint16_t kInStatus = wire::reg::sync_manager(1).address + wire::SyncManagerLayout::status::offset;
constexpr std::size_t kWorthSharing = 3;   // number of waiting channels from which on one datagram looks for all
constexpr std::size_t kSurveyAtOnce = 16;  // channels that look for unasked mail at the same time
constexpr Duration kTick = std::chrono::milliseconds(1);
constexpr std::uint8_t kMostRouted = 32;  // messages between slaves that are being forwarded
constexpr Duration kRoutePatience = std::chrono::seconds(1);

// A message that another slave has composed.
class Forwarded final : public MailClient {
  public:
    explicit Forwarded(Bytes message) : message_(message) {}
    std::size_t compose(MutableBytes data) override {
        const std::size_t bytes = std::min(message_.size(), data.size());
        std::copy_n(message_.begin(), bytes, data.begin());
        return bytes;
    }
    Taken accept(const wire::MailboxMessage&) override { return Taken::no; }

  private:
    Bytes message_;
};

}  // namespace

Mailboxes::Mailboxes(Engine& engine, std::span<MailboxChannel> channels, std::span<Emergency> emergencies)
    : engine_(engine), channels_(channels) {
    const std::size_t each = channels.empty() ? 0 : emergencies.size() / channels.size();
    for (std::size_t n = 0; n < channels.size(); ++n)
        channels[n].emergencies().use(emergencies.subspan(n * each, each));
}

Mailboxes::~Mailboxes() {
    close_all();
    listeners_.take_back(new_listeners_);
    listeners_.take_back(last_listeners_);
    next_listener_ = nullptr;
    while (MailListener* listener = listeners_.front()) unlisten(*listener);
}

void Mailboxes::close_all() {
    watch_.end();
    for (MailboxChannel& channel : channels_) channel.close();
}

void Mailboxes::forget_all() {
    for (MailboxChannel& channel : channels_) channel.forget();
}

// ------------------------------------------------------------------ listeners

MailListener::~MailListener() {
    if (mailboxes_ != nullptr) mailboxes_->unlisten(*this);
}

void Mailboxes::listen(MailListener& listener) {
    listener.mailboxes_ = this;
    listener.look_at_ = Time::min();
    new_listeners_.push_back(listener);
}

void Mailboxes::listen_last(MailListener& listener) {
    listener.mailboxes_ = this;
    last_listeners_.push_back(listener);
}

void Mailboxes::unlisten(MailListener& listener) {
    if (next_listener_ == &listener) next_listener_ = asked_->after(listener);
    listener.mailboxes_ = nullptr;
    listener.unlink();
}

bool Mailboxes::is_heard(std::uint16_t slave, MailboxType type) {
    for (List<MailListener>* const list : {&listeners_, &new_listeners_})
        for (MailListener* one = list->front(); one != nullptr; one = list->after(*one))
            if (one->type_ == type && one->only_slave == slave) return true;
    return false;
}

// While a listener is called, it may remove any listener. A listener that is added meanwhile gets only later mail:
// otherwise listeners that move themselves to the end of the list would be called without end.
bool Mailboxes::offer(const UnaskedMail& mail) {
    listeners_.take_back(new_listeners_);
    return offer_to(listeners_, mail) || offer_to(last_listeners_, mail);
}

bool Mailboxes::offer_to(List<MailListener>& listeners, const UnaskedMail& mail) {
    asked_ = &listeners;
    for (MailListener* listener = listeners.front(); listener != nullptr; listener = next_listener_) {
        next_listener_ = listeners.after(*listener);
        const bool right =
            listener->type_ == mail.type && (listener->only_slave == 0 || listener->only_slave == mail.slave);
        if (right && listener->take(mail)) return true;
    }
    return false;
}

// ------------------------------------------------------------------ one datagram for all slaves

class Mailboxes::WatchGuard {
  public:
    explicit WatchGuard(Mailboxes& mailboxes) : mailboxes_(mailboxes) {}
    WatchGuard(const WatchGuard&) = delete;
    WatchGuard& operator=(const WatchGuard&) = delete;
    ~WatchGuard() { mailboxes_.watch_.release(); }

  private:
    Mailboxes& mailboxes_;
};

void Mailboxes::watch(Duration every) {
    every_ = std::max(every, Duration{0});
    if (every_ != Duration{0}) ensure_watch();
}

void Mailboxes::ensure_watch() {
    if (watch_) return;
    const TaskReference task = watch_all();
    if (!task) return;
    watch_.take(task);
    (void)tasks_.start(task);
}

std::size_t Mailboxes::waiting() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(channels_, [](const MailboxChannel& c) { return c.watched_by_mailboxes_; }));
}

bool Mailboxes::park(MailboxChannel& channel) {
    const auto looks = [](const MailboxChannel& c) { return c.pump_ && c.expecting(); };
    if (waiting() == 0 && static_cast<std::size_t>(std::ranges::count_if(channels_, looks)) < kWorthSharing)
        return false;
    channel.watched_by_mailboxes_ = true;  // set before the watch starts: the watch ends when no channel is parked
    ensure_watch();
    channel.watched_by_mailboxes_ = static_cast<bool>(watch_);
    return channel.watched_by_mailboxes_;
}

Task<Result<>> Mailboxes::watch_all() {
    WatchGuard guard(*this);
    while (waiting() > 0 || every_ != Duration{0}) {
        const Duration pause = waiting() > 0 ? kTick : every_;
        co_await engine_.sleep_for(pause);
        by_status_bits();
        std::array<std::byte, 1> status{};
        Datagram look(engine_.link(), wire::Command::BRD, wire::DatagramAddress(std::uint16_t{0}, kInStatus),
                      MutableBytes(status));
        auto reply = co_await look;
        const bool any = (std::to_integer<unsigned>(status[0]) & wire::sm_status::kMailboxFull) != 0;
        if (!reply.ok() || any) wake_channels(any);
    }
    co_return Nothing{};
}

// Parked channels now look themselves. A few of the other channels look, in turn.
void Mailboxes::wake_channels(bool surely) {
    for (MailboxChannel& channel : channels_)
        if (channel.watched_by_mailboxes_) {
            channel.watched_by_mailboxes_ = false;
            channel.look_at_ = engine_.now();
            channel.kick();
        }
    if (!surely || every_ == Duration{0}) return;
    std::size_t at_once = kSurveyAtOnce;
    for (std::size_t n = 0; n < channels_.size() && at_once > 0; ++n) {
        MailboxChannel& channel = channels_[survey_];
        survey_ = (survey_ + 1) % channels_.size();
        if (!channel.is_reachable() || channel.pump_) continue;
        channel.glance();
        --at_once;
    }
}

void Mailboxes::by_status_bits() {
    for (MailboxChannel& channel : channels_) {
        if (!channel.is_reachable() || channel.pump_ || channel.status_octet_ == nullptr) continue;
        if (channel.bit_is_set()) channel.glance();
    }
}

// ------------------------------------------------------------------ mail between slaves

bool Mailboxes::route(MailboxChannel& from, const wire::MailboxMessage& mail) {
    return routing != nullptr && routing->route(*this, from, mail);
}

const RoutingFeature kRoutingFeature{.route = RoutingFeature::forward};

bool RoutingFeature::forward(Mailboxes& mailboxes, MailboxChannel& from, const wire::MailboxMessage& mail) {
    return mailboxes.forward_mail(from, mail);
}

bool Mailboxes::forward_mail(MailboxChannel& from, const wire::MailboxMessage& mail) {
    const auto is_addressed = [&](const MailboxChannel& c) {
        return c.is_reachable() && c.address_.value == mail.header.address;
    };
    const auto to = std::ranges::find_if(channels_, is_addressed);
    if (to == channels_.end()) return false;
    if (routing_ >= kMostRouted || mail.data.size() > to->send_room() || !start_forward(*to, from, mail))
        ++from.statistics().undeliverable;
    return true;
}

// `mail` is in the buffer of the channel that has fetched it. The task that forwards it gets its own copy.
bool Mailboxes::start_forward(MailboxChannel& to, MailboxChannel& from, const wire::MailboxMessage& mail) {
    ArenaBuffer copy(arena());
    if (!copy.reserve(mail.data.size())) return false;
    const MutableBytes message = copy.bytes().first(mail.data.size());
    std::ranges::copy(mail.data, message.begin());
    const TaskReference task = forward(to, from, mail.header, message);
    if (!task) return false;
    copy.release();
    (void)tasks_.start(task);
    return true;
}

// A message that the master forwards contains the address of its sender (ETG.1000.4 "Mailbox header"). The task owns
// the memory of `data`, which is from the arena.
Task<Result<>> Mailboxes::forward(MailboxChannel& to, MailboxChannel& from, wire::MailboxHeader header,
                                  MutableBytes data) {
    struct Count {
        std::uint8_t& n;
        explicit Count(std::uint8_t& count) : n(count) { ++n; }
        Count(const Count&) = delete;
        Count& operator=(const Count&) = delete;
        ~Count() { --n; }
    };
    Count count(routing_);
    const ArenaBuffer owned(arena(), data);
    Forwarded message(data);
    MailExchange exchange(to, header.type, message,
                          {.patience = {.give_up = engine_.now() + kRoutePatience, .priority = header.priority},
                           .address = from.station().address.value,
                           .reply = false});
    const Error failed = co_await exchange;
    if (failed.code != Errc::none) ++from.statistics().undeliverable;
    co_return Nothing{};
}

}  // namespace margay
