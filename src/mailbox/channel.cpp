// The pump of a channel: selects the next action, and processes its result.
#include "mailbox/channel.hpp"

#include "mailbox/arena_buffer.hpp"
#include "mailbox/mailboxes.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
using Layout = wire::SyncManagerLayout;

constexpr std::uint16_t kOutStatus = reg::sync_manager(0).address + Layout::status::offset;
constexpr std::uint16_t kInStatus = reg::sync_manager(1).address + Layout::status::offset;
constexpr std::uint16_t kInActivate = reg::sync_manager(1).address + Layout::activate::offset;
constexpr std::size_t kLookBytes = 3;  // status, activate, PDI control

constexpr Duration kCycleIsAlive = std::chrono::milliseconds(10);
constexpr Duration kRealLook =
    // Interval of looks at the ESC while a bit of the image, or Mailboxes, reports no mail.
    std::chrono::milliseconds(20);
constexpr unsigned kLooksBeforeParking = 4;

// Rounds the time up to a multiple of `grid`: channels with the same pause then look at the same time, and their
// datagrams share frames.
Time on_grid(Time time, Duration grid) {
    Duration rest = time.time_since_epoch();
    if constexpr (sizeof(void*) >= sizeof(std::int64_t)) {
        rest %= grid;
    } else {  // without a division of 64 bits, see Link::in_steps()
        Duration part = grid;
        while (part <= rest - part) part += part;
        for (; part >= grid; part = Duration(part.count() >> 1))
            if (part <= rest) rest -= part;
    }
    return rest == Duration{0} ? time : time + (grid - rest);
}

// The error of a failed reading. A working counter above 1 means that two slaves answer at the same address.
Errc failure_of(Reply reply) {
    if (!reply.ok()) return reply.errc;
    return reply.wkc == 0 ? Errc::working_counter : Errc::unstable;
}

bool has(std::byte octet, std::uint8_t bit) { return (std::to_integer<unsigned>(octet) & bit) != 0; }

}  // namespace

class MailboxChannel::PumpGuard {
  public:
    explicit PumpGuard(MailboxChannel& channel) : channel_(channel) {}
    PumpGuard(const PumpGuard&) = delete;
    PumpGuard& operator=(const PumpGuard&) = delete;
    ~PumpGuard() {
        channel_.pump_.release();
        channel_.dozing_ = false;
        channel_.watched_by_mailboxes_ = false;  // the watch continues as long as any channel is parked
        channel_.doze_.unlink();
    }

  private:
    MailboxChannel& channel_;
};

// Awaitable: resumes at the given time, or when kick() is called.
class MailboxChannel::Doze {
  public:
    Doze(MailboxChannel& channel, Time until) : channel_(channel), until_(until) {}
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> h) const noexcept {
        channel_.dozing_ = true;
        channel_.engine_->sleep(channel_.doze_, h, until_);
    }
    void await_resume() const noexcept { channel_.dozing_ = false; }

  private:
    MailboxChannel& channel_;
    Time until_;
};

// Awaitable: the datagram of one action, and a look in the same frame as a message. All actions share this awaitable,
// because each datagram in the pump would cost code, and memory of its coroutine frame.
class MailboxChannel::OneOrTwo : public DatagramWait {
  public:
    OneOrTwo(MailboxChannel& channel, Action action, MutableBytes memory)
        : channel_(channel),
          action_(action),
          looks_(action == Action::send && channel.looks_beside()),
          memory_(memory),
          datagram_(datagram_of(action)),
          look_(datagram_of(Action::look)) {}
    bool await_suspend(std::coroutine_handle<> h) noexcept {
        return submit(h, std::span(datagrams_).first(looks_ ? 2 : 1));
    }
    void await_resume() const noexcept {}
    // Processes the replies.
    void finish();

  private:
    [[nodiscard]] Datagram datagram_of(Action action);

    MailboxChannel& channel_;
    Action action_;
    bool looks_;
    std::array<std::byte, kLookBytes> octets_{};
    MutableBytes memory_;
    Datagram datagram_;
    Datagram look_;
    std::array<Datagram*, 2> datagrams_{&datagram_, &look_};
};

Datagram MailboxChannel::OneOrTwo::datagram_of(Action action) {
    using enum wire::Command;
    Link& link = channel_.engine_->link();
    const StationAddress to = channel_.address_;
    const MailboxInfo& info = channel_.info_;
    switch (action) {
        case Action::send: return {link, FPWR, {to, info.out_start}, Bytes(memory_).first(info.out_bytes), Repeat::no};
        case Action::fetch: return {link, FPRD, {to, info.in_start}, memory_.first(info.in_bytes), Repeat::no};
        case Action::look_out: return {link, FPRD, {to, kOutStatus}, MutableBytes(octets_).first(1)};
        case Action::ask_repeat:
            octets_[0] = std::byte{channel_.activate_};
            return {link, FPWR, {to, kInActivate}, Bytes(octets_).first(1)};
        default: return {link, FPRD, {to, kInStatus}, MutableBytes(octets_)};
    }
}

void MailboxChannel::OneOrTwo::finish() {
    const Reply reply = datagram_.reply();
    switch (action_) {
        case Action::send:
            channel_.sent(reply);
            if (looks_ && look_.reply().ok()) channel_.looked(look_.reply(), octets_);
            return;
        case Action::fetch: return channel_.fetched(reply, Bytes(memory_).first(channel_.info_.in_bytes));
        case Action::look_out: return channel_.looked_out(reply, octets_[0]);
        case Action::ask_repeat:
            channel_.repeat_ = Repeated::requested;
            channel_.repeat_until_ = channel_.now() + mail_timing::kRepeatPatience;
            ++channel_.statistics_.repeats;
            return channel_.look_soon();
        default: return channel_.looked(reply, octets_);
    }
}

void MailboxChannel::ensure_pump() {
    if (pump_) return;
    const TaskReference task = pump();
    if (task) {
        pump_.take(task);
        (void)mailboxes_->tasks_.start(task);
        return;
    }
    const Error full{.code = Errc::capacity, .step = Step::mailbox_send, .slave = number_};
    while (MailTurn* turn = queue_.front()) finish(static_cast<MailExchange&>(*turn), full);
}

void MailboxChannel::kick() {
    if (dozing_) engine_->wake(doze_);
}

Task<Result<>> MailboxChannel::pump() {
    PumpGuard guard(*this);
    ArenaBuffer memory(arena());
    for (Action action = next_action(); action != Action::stop; action = next_action()) {
        const bool carries = action == Action::send || action == Action::fetch;
        const bool starves = carries && !memory.reserve(std::max(info_.out_bytes, info_.in_bytes));
        if (starves) last_failure_ = Errc::capacity;
        if (starves || action == Action::doze) {
            co_await Doze(*this, starves ? now() + mail_timing::kLongestPause : doze_until());
        } else if (action != Action::send || compose(memory.bytes())) {
            OneOrTwo exchange(*this, action, memory.bytes());
            co_await exchange;
            exchange.finish();
        }
    }
    co_return Nothing{};
}

// ------------------------------------------------------------------ next action

MailboxChannel::Action MailboxChannel::next_action() {
    const Time t = now();
    // If no exchange waits, the looks at a slave that does not answer end after some time. A pending look is kept for
    // later.
    const bool nobody_waits = queue_.empty() && awaiting_.empty();
    if (nobody_waits && silent_looks_ >= kMostSilentLooks) return Action::stop;
    if (repeat_ == Repeated::ready) return Action::ask_repeat;
    if (full_ && repeat_ == Repeated::no) return Action::fetch;
    if (unsure_ != nullptr && resend_) {
        sending_ = unsure_;
        return Action::send;
    }
    if (unsure_ != nullptr && t >= resend_at_) return Action::look_out;
    if (stale_ == 0 && unsure_ == nullptr && repeat_ == Repeated::no && t >= send_at_ && pick_message())
        return Action::send;
    if (expecting()) return next_look();
    return queue_.empty() ? Action::stop : Action::doze;
}

bool MailboxChannel::pick_message() {
    const auto allowed = [&](const MailTurn& turn) { return !must_wait(static_cast<const MailExchange&>(turn)); };
    MailTurn* next = next_turn(queue_, allowed);
    sending_ = static_cast<MailExchange*>(next);
    return next != nullptr;
}

bool MailboxChannel::expecting() const {
    const bool held_up = now() < send_at_ && !queue_.empty();  // the slave may have to send its own mail first
    // A late reply that no exchange waits for is fetched before the next message.
    const bool late = now() < late_until_ || (is_owed() && !queue_.empty());
    return glance_ || held_up || !awaiting_.empty() || repeat_ != Repeated::no || late;
}

// Whether the channel looks for mail in the frame of a message, for mail that no exchange waits for. Otherwise
// consecutive messages would prevent looks, or every second datagram would be a look.
bool MailboxChannel::looks_beside() const {
    return glance_ && awaiting_.empty() && repeat_ == Repeated::no && now() >= look_at_;
}

bool MailboxChannel::bit_is_trusted() const {
    const Time cycle = engine_->link().last_cycle();
    return status_octet_ != nullptr && !glance_ && repeat_ == Repeated::no && now() < real_look_at_ &&
           cycle != Time::min() && now() - cycle < kCycleIsAlive;
}

MailboxChannel::Action MailboxChannel::next_look() {
    if (now() < look_at_) return Action::doze;
    if (!bit_is_trusted()) return Action::look;
    // The bit shows the state in the last cycle. So it may still report mail that was fetched after that cycle.
    if (engine_->link().last_cycle() <= fetched_at_ || !bit_is_set()) {
        look_at_ = now() + mail_timing::kFirstPause;
        return Action::doze;
    }
    full_ = true;
    return Action::fetch;
}

Time MailboxChannel::doze_until() const {
    Time until = kNever;
    const auto also = [&](Time time) {
        if (time > now()) until = std::min(until, time);
    };
    if (expecting()) until = look_at_;
    if (unsure_ != nullptr) also(resend_at_);
    if (!queue_.empty()) also(send_at_);
    also(late_until_);
    for (const Owed& owed : owed_)
        if (owed.mails != 0) also(owed.until);
    return until;
}

void MailboxChannel::look_soon() {
    look_at_ = now();
    pause_ = mail_timing::kFirstPause;
    looks_ = 0;
    watched_by_mailboxes_ = false;
}

// ------------------------------------------------------------------ sending

// False when the mailbox is too small for the message.
bool MailboxChannel::compose(MutableBytes buffer) {
    const auto mailbox = buffer.first(info_.out_bytes);
    const auto data = mailbox.subspan(wire::kMailboxHeaderBytes);
    std::fill(mailbox.begin(), mailbox.end(), std::byte{0});
    wire::MailboxHeader header;
    header.length = static_cast<std::uint16_t>(sending_->client_.compose(data));
    header.type = sending_->type_;
    header.priority = sending_->options_.patience.priority;
    header.address = sending_->options_.address;
    if (header.length == 0) {
        finish(*sending_, {.code = Errc::unsupported, .step = Step::mailbox_send, .slave = number_});
        return false;
    }
    trial_counter_ = resend_ ? out_counter_ : wire::next_mailbox_counter(out_counter_);
    header.counter = trial_counter_;
    wire::store_mailbox_header(mailbox, header);
    return true;
}

// Call it when the slave has received the message.
void MailboxChannel::left(MailExchange& exchange) {
    const bool first = exchange.state_ == MailExchange::State::queued;
    if (!exchange.options_.reply) {
        unanswered_until_ = now() + mail_timing::kOwedPatience;
        left_open_ = true;
        return finish(exchange, {});
    }
    if (first) {
        take_turn(queue_, exchange, [](const MailTurn&) { return true; });
        awaiting_.push_back(exchange);
        prolong(exchange);  // the exchange may have waited for a late reply before
    }
    exchange.state_ = MailExchange::State::sent;
    look_soon();
}

void MailboxChannel::message_refused(Errc why) {
    last_failure_ = why;
    pause_ = std::clamp(pause_ * 2, mail_timing::kFirstPause, mail_timing::kLongestPause);
    send_at_ = now() + pause_;
    look_at_ = std::min(look_at_, now());
}

void MailboxChannel::sent(Reply reply) {
    MailExchange* const exchange = std::exchange(sending_, nullptr);
    const bool again = resend_;
    resend_ = false;
    if (reply.ok() && reply.wkc == 1) {
        out_counter_ = trial_counter_;
        ++(again ? statistics_.resent : statistics_.sent);
        last_failure_ = Errc::none;
        unsure_ = nullptr;
        if (exchange != nullptr) left(*exchange);
    } else if (reply.errc == Errc::no_frame) {
        // It is not known whether the message has arrived. The mailbox of the slave or its reply will show this.
        out_counter_ = trial_counter_;
        last_failure_ = Errc::no_frame;
        if (exchange == nullptr) return;
        unsure_ = exchange;
        resend_at_ = now();
        unsure_until_ = now() + mail_timing::kResendAfter;
        if (exchange->state_ != MailExchange::State::queued) return;
        exchange->unlink();
        awaiting_.push_back(*exchange);
        exchange->state_ = MailExchange::State::sent;
        look_soon();
    } else {
        message_refused(reply.ok() ? Errc::mailbox_full : reply.errc);
        if (again) resend_at_ = send_at_;
    }
}

void MailboxChannel::looked_out(Reply reply, std::byte status) {
    if (unsure_ == nullptr) return;
    if (!reply.ok() || reply.wkc != 1) {
        last_failure_ = failure_of(reply);
        resend_at_ = now() + mail_timing::kLongestPause;
    } else if (has(status, wire::sm_status::kMailboxFull)) {
        // The mailbox may still contain the previous message, which the slave has not read yet.
        unsure_until_ = now() + mail_timing::kResendAfter;
        resend_at_ = now() + mail_timing::kLongestPause;
    } else if (now() >= unsure_until_) {
        resend_ = true;
    } else {
        resend_at_ = unsure_until_;
    }
}

// ------------------------------------------------------------------ receiving

void MailboxChannel::looked(Reply reply, Bytes octets) {
    real_look_at_ = now() + kRealLook;
    if (!reply.ok() || reply.wkc != 1) {
        last_failure_ = failure_of(reply);
        look_at_ = now() + mail_timing::kLongestPause;
        if (silent_looks_ < kMostSilentLooks) ++silent_looks_;
        return;
    }
    silent_looks_ = 0;
    if (last_failure_ != Errc::mailbox_full) last_failure_ = Errc::none;
    const bool full = has(octets[0], wire::sm_status::kMailboxFull);
    if (repeat_ == Repeated::wanted) {
        // If a slave does not count its mail, a repeated reply cannot be distinguished from the previous reply. The
        // repeat is requested only if the mailbox is empty.
        const bool ask = counts_ || !full;
        repeat_ = ask ? Repeated::ready : Repeated::no;
        activate_ = static_cast<std::uint8_t>(std::to_integer<unsigned>(octets[1]) ^ wire::sm_activate::kRepeatRequest);
        full_ = full && !ask;
        return;
    }
    if (repeat_ == Repeated::requested) {
        const bool acknowledged = has(octets[2], wire::sm_pdi_control::kRepeatAcknowledge) ==
                                  ((activate_ & wire::sm_activate::kRepeatRequest) != 0);
        if (!acknowledged && now() < repeat_until_) return nothing_there();
        repeat_ = Repeated::no;
        repeated_ = acknowledged;
        lost_at_ = full ? kNever : now() + mail_timing::kResendAfter;
        // Mail that the slave has prepared meanwhile comes first.
        if (is_owed()) {
            glance_ = true;
            stale_ = kMostStale;
        }
    }
    full_ = full;
    if (full_) return;
    if (now() >= lost_at_) reply_is_lost();
    nothing_there();
}

// The lost mail may have been other mail than these replies, and the replies may still arrive. So new exchanges of the
// same key wait for a while.
void MailboxChannel::reply_is_lost() {
    lost_at_ = kNever;
    const Error lost{.code = Errc::reply_lost, .step = Step::mailbox_receive, .slave = number_};
    for (MailTurn* turn = awaiting_.front(); turn != nullptr;) {
        auto& exchange = static_cast<MailExchange&>(*turn);
        turn = awaiting_.after(*turn);
        if (&exchange == unsure_) continue;  // the message may not have arrived, and will be sent again
        late_until_ = now() + mail_timing::kOwedPatience;
        Owed& owed = owe(exchange.type_, exchange.options_.key, exchange.options_.mails, late_until_);
        make_last(owed, exchange);
        finish(exchange, lost);
    }
}

void MailboxChannel::nothing_there() {
    full_ = false;
    if (repeat_ == Repeated::no) {
        glance_ = false;
        stale_ = 0;
    }
    pause_ = std::clamp(pause_, mail_timing::kFirstPause, mail_timing::kLongestPause);
    look_at_ = on_grid(now() + pause_, pause_);
    pause_ = std::min(pause_ * 2, mail_timing::kLongestPause);
    if (++looks_ >= kLooksBeforeParking && repeat_ == Repeated::no && mailboxes_->park(*this))
        look_at_ = now() + kRealLook;
}

void MailboxChannel::fetched(Reply reply, Bytes mailbox) {
    full_ = false;
    fetched_at_ = now();
    if (reply.errc == Errc::no_frame) {
        repeat_ = Repeated::wanted;
        missed_ = true;
        look_soon();
    } else if (!reply.ok()) {
        last_failure_ = reply.errc;
        look_at_ = now() + mail_timing::kLongestPause;
    } else if (reply.wkc != 1) {
        nothing_there();
    } else {
        look_soon();
        if (stale_ > 0) --stale_;
        receive_mail(mailbox);
    }
}

}  // namespace margay
