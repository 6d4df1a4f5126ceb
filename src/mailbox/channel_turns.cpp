// Exchanges and sessions: waiting in turn, timeout, and giving up.
#include "mailbox/channel.hpp"
#include "mailbox/mailboxes.hpp"

#include <algorithm>

namespace margay {
namespace {

// The error message of FoE without text, with the error code "not defined".
constexpr std::array<std::byte, 6> kEndOfTransfer{std::byte{5}, {}, {}, std::byte{0x80}};

constexpr std::uint16_t bit_of(wire::MailboxType type) {
    return static_cast<std::uint16_t>(1U << static_cast<unsigned>(type));
}

}  // namespace

// ------------------------------------------------------------------ exchanges

MailExchange::MailExchange(MailSession& session, MailClient& client, const Options& options)
    : MailExchange(session.channel_, session.type_, client, options) {
    session_ = &session;
}

MailExchange::~MailExchange() {
    if (state_ == State::queued || state_ == State::sent) channel_.forget(*this);
}

bool MailExchange::await_suspend(std::coroutine_handle<> h) noexcept {
    const bool over = session_ != nullptr && !session_->holds();
    if (over || !channel_.is_reachable()) {
        state_ = State::over;
        error_.code = over || channel_.is_open() ? channel_.cut_by() : Errc::wrong_state;
        return false;
    }
    state_ = State::queued;
    wanted_until_ = options_.patience.for_one(channel_.engine().now());
    channel_.engine().sleep(timer_, h, wanted_until_);
    channel_.enqueue(*this);
    return true;
}

Error MailExchange::await_resume() noexcept {
    if (state_ != State::over) {  // timed out
        if (error_.code == Errc::none) error_ = channel_.overdue(*this);
        channel_.forget(*this);
        state_ = State::over;
    }
    return error_;
}

void MailboxChannel::enqueue(MailExchange& exchange) {
    // The reply to an exchange that was given up may have come after the last look, and may still be in the mailbox.
    // Packets of a file do not need this look, because their numbers distinguish them.
    const auto& options = exchange.options_;
    if (options.key != 0 && !options.distinct && owed_of(exchange.type_).mails != 0) {
        glance_ = true;
        stale_ = kMostStale;
        look_soon();
    }
    queue_.push_back(exchange);
    mailboxes_->exchanges = &kExchanges;
    ensure_pump();
    kick();
}

// A part of the reply has arrived: the timeout for the next part starts now.
void MailboxChannel::prolong(MailExchange& exchange) {
    exchange.error_ = {};
    exchange.timer_.unlink();
    exchange.wanted_until_ = exchange.options_.patience.for_one(now());
    engine_->sleep(exchange.timer_, exchange.timer_.handle, exchange.wanted_until_);
}

void MailboxChannel::finish(MailExchange& exchange, const Error& error) {
    exchange.unlink();
    if (exchange.state_ == MailExchange::State::sent) lost_at_ = kNever;
    exchange.state_ = MailExchange::State::over;
    exchange.error_ = error;
    if (sending_ == &exchange) sending_ = nullptr;
    if (unsure_ == &exchange) unsure_ = nullptr;
    engine_->wake(exchange.timer_);
}

// Gives up the exchange. If its message was sent, the slave still processes it.
void MailboxChannel::forget(MailExchange& exchange) {
    exchange.unlink();
    const bool out = exchange.state_ == MailExchange::State::sent || sending_ == &exchange;
    if (sending_ == &exchange) sending_ = nullptr;
    if (unsure_ == &exchange) unsure_ = nullptr;
    if (awaiting_.empty()) lost_at_ = kNever;
    if (out) owe_answer_to(exchange);
    kick();
}

// The error of an exchange that has timed out.
Error MailboxChannel::overdue(const MailExchange& exchange) const {
    const bool left = exchange.state_ == MailExchange::State::sent;
    return {.code = last_failure_ == Errc::none ? Errc::timeout : last_failure_,
            .step = left ? Step::mailbox_receive : Step::mailbox_send,
            .slave = number_,
            .expected = last_failure_ == Errc::working_counter};
}

// ------------------------------------------------------------------ sessions

MailSession::~MailSession() {
    if (granted_) channel_.leave(*this);
}

bool MailSession::holds() const { return granted_ && epoch_ == channel_.epoch(); }

bool MailSession::await_ready() noexcept {
    if (!channel_.is_reachable()) {
        error_.code = channel_.is_open() ? channel_.cut_by() : Errc::wrong_state;
        return true;
    }
    return channel_.try_enter(*this);
}

void MailSession::await_suspend(std::coroutine_handle<> h) noexcept {
    channel_.engine().sleep(timer_, h, give_up_);
    channel_.wait_turn(*this);
}

Error MailSession::await_resume() noexcept {
    unlink();
    if (!granted_ && error_.code == Errc::none) error_.code = Errc::timeout;
    return granted_ ? Error{} : error_;
}

bool MailboxChannel::try_enter(MailSession& session) {
    if ((busy_types_ & bit_of(session.type_)) != 0) return false;
    busy_types_ = static_cast<std::uint16_t>(busy_types_ | bit_of(session.type_));
    session.granted_ = true;
    session.epoch_ = epoch_;
    return true;
}

void MailboxChannel::wait_turn(MailSession& session) { tickets_.push_back(session); }

void MailboxChannel::leave(MailSession& session) {
    const bool holds = session.holds();
    session.granted_ = false;
    if (!holds) return;
    busy_types_ = static_cast<std::uint16_t>(busy_types_ & ~bit_of(session.type_));
    const auto same = [&](const MailTurn& turn) {
        return static_cast<const MailSession&>(turn).type_ == session.type_;
    };
    MailTurn* next = next_turn(tickets_, same);
    if (next == nullptr) return;
    take_turn(tickets_, *next, same);
    auto& granted = static_cast<MailSession&>(*next);
    (void)try_enter(granted);
    engine_->wake(granted.timer_);
}

// ------------------------------------------------------------------ open and close

MailboxChannel::MailboxChannel() = default;

void MailboxChannel::open(Mailboxes& mailboxes, const Station& station, Slave& slave, const MailboxInfo& info) {
    close();
    mailboxes_ = &mailboxes;
    engine_ = &station.engine;
    slave_ = &slave;
    address_ = station.address;
    number_ = station.number;
    info_ = info;
    open_ = info.out_bytes > wire::kMailboxHeaderBytes && info.in_bytes > wire::kMailboxHeaderBytes;
    was_open_ |= open_;
    counts_ = true;
    has_counted_ = false;
    in_counter_ = out_counter_ = 0;
    silent_looks_ = 0;
    left_open_ = false;
    unfinished_ = 0;
    // Mail from before, for example to another master, is fetched before the first message is sent.
    glance_ = true;
    stale_ = kMostStale;
}

void MailboxChannel::forget() {
    close();
    was_open_ = false;
    statistics_ = {};
    emergencies_.clear();
    no_complete_access = false;
    status_octet_ = nullptr;
}

void MailboxChannel::close() {
    if (engine_ == nullptr) return;
    open_ = away_ = false;
    end_exchanges(Errc::mailbox_closed);
    late_ = {};
}

void MailboxChannel::interrupt(Errc reason) {
    if (!is_reachable()) return;
    // The slave may have received the message on the wire, so the next message needs another counter.
    if (sending_ != nullptr) out_counter_ = trial_counter_;
    if (mailboxes_->exchanges != nullptr) mailboxes_->exchanges->interrupt(*this);
    auto still = owed_;
    for (Owed& owed : still) {
        if (!is_current(owed, now()) && !owed.lasts) owed = {};
        owed.fences = 0;  // the messages that end operations are lost
    }
    away_ = true;
    end_exchanges(reason);
    owed_ = still;
}

void MailboxChannel::resume() {
    if (!open_ || !away_) return;
    away_ = false;
    silent_looks_ = 0;
    glance_ = true;
    stale_ = kMostStale;
    late_until_ = now() + mail_timing::kOwedPatience;
    for (Owed& owed : owed_)
        if (owed.mails != 0) owed.until = std::max(owed.until, late_until_);
    if (mailboxes_->exchanges != nullptr) mailboxes_->exchanges->resume(*this);
    if (unfinished_ != 0) end_unfinished_(*this, unfinished_);
}

// The slave still answers the messages that it has received, perhaps long after it is back.
void MailboxChannel::owe_all_answers() {
    for (MailTurn* turn = awaiting_.front(); turn != nullptr; turn = awaiting_.after(*turn))
        owe_answer_to(static_cast<MailExchange&>(*turn));
    if (sending_ != nullptr && sending_->state_ == MailExchange::State::queued) owe_answer_to(*sending_);
}

// Ends the file transfer in the slave. A slave that processes one message at a time accepts this message only after it
// has answered the earlier message.
void MailboxChannel::end_transfers() {
    if (owed_[1].mails != 0) send_final_message(wire::MailboxType::foe, kEndOfTransfer);
}

constinit const ExchangePart MailboxChannel::kExchanges{
    .interrupt = [](MailboxChannel& channel) { channel.owe_all_answers(); },
    .resume = [](MailboxChannel& channel) { channel.end_transfers(); }};

void MailboxChannel::end_exchanges(Errc why) {
    ++epoch_;
    cut_by_ = why;
    pump_.end();
    Error ended{.code = why, .step = Step::mailbox_receive, .slave = number_};
    while (MailTurn* turn = awaiting_.front()) finish(static_cast<MailExchange&>(*turn), ended);
    ended.step = Step::mailbox_send;
    while (MailTurn* turn = queue_.front()) finish(static_cast<MailExchange&>(*turn), ended);
    while (MailTurn* turn = tickets_.pop_front()) {
        auto& session = static_cast<MailSession&>(*turn);
        session.error_ = ended;
        engine_->wake(session.timer_);
    }
    busy_types_ = 0;
    stale_ = 0;
    sending_ = unsure_ = nullptr;
    resend_ = glance_ = full_ = watched_by_mailboxes_ = repeated_ = missed_ = false;
    resend_at_ = lost_at_ = kNever;
    send_at_ = look_at_ = late_until_ = fetched_at_ = real_look_at_ = Time::min();
    owed_ = {};
    repeat_ = Repeated::no;
    last_failure_ = Errc::none;
}

void MailboxChannel::glance() {
    if (!is_reachable()) return;
    glance_ = true;
    look_at_ = now();
    watched_by_mailboxes_ = false;
    silent_looks_ = 0;
    ensure_pump();
    kick();
}

}  // namespace margay
