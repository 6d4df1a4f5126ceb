// Received mail: finds its exchange or its listener.
#include "mailbox/channel.hpp"
#include "mailbox/mailboxes.hpp"

#include <algorithm>

namespace margay {

void MailboxChannel::receive_mail(Bytes mailbox) {
    ++statistics_.received;
    const auto header = wire::load_mailbox_header(mailbox);
    counts_ = header.counter != 0;
    // Detects lost mail: the slave had new mail before it received the repeat request. Only the counters of two mails
    // show this.
    const bool missed = missed_;
    missed_ = false;
    const bool known = counts_ && in_counter_ != 0;
    const bool follows = header.counter == in_counter_ || header.counter == wire::next_mailbox_counter(in_counter_);
    const bool skips = missed && known && !follows;
    const bool may_skip = missed && !(known && follows);
    // Some slaves never change their counter. So an equal counter shows a repetition only if the slave has counted
    // before.
    const bool alike = has_counted_ && header.type == in_type_ && header.length == in_length_;
    const bool again = (repeated_ || alike) && counts_ && header.counter == in_counter_;
    repeated_ = false;
    if (again) {
        ++statistics_.duplicates;
        return;
    }
    has_counted_ = known && header.counter == wire::next_mailbox_counter(in_counter_);
    in_counter_ = header.counter;
    in_type_ = header.type;
    in_length_ = header.length;
    const auto mail = wire::load_mailbox_message(mailbox);
    if (!mail || mail->data.empty()) return malformed(header);
    if (may_skip) lose_parts();
    dispatch(*mail);
    // The lost mail may have been the reply that an exchange still waits for.
    if (skips && !awaiting_.empty() && lost_at_ == kNever) lost_at_ = now() + mail_timing::kResendAfter;
}

// Lost mail may have been a part of an answer of several mails. The exchanges of such answers end with reply_lost, so
// that the protocol sends its request again.
void MailboxChannel::lose_parts() {
    for (MailTurn* turn = awaiting_.front(); turn != nullptr;) {
        auto& exchange = static_cast<MailExchange&>(*turn);
        turn = awaiting_.after(*turn);
        if (!exchange.options_.in_parts || &exchange == unsure_) continue;
        owe_answer_to(exchange);
        finish(exchange, {.code = Errc::reply_lost, .step = Step::mailbox_receive, .slave = number_});
    }
}

void MailboxChannel::dispatch(const wire::MailboxMessage& mail) {
    // Some slaves write their own address where the standard requires the address of the master, which is 0. Any other
    // address is the address of a slave. Mail to a slave that does not exist is counted as unexpected; it is not
    // matched with a waiting exchange.
    const std::uint16_t to = mail.header.address;
    if (to != 0 && to != address_.value) {
        if (answers(mail, to) || answers_by_error(mail, to)) return;
        ++(mailboxes_->route(*this, mail) ? statistics_.routed : statistics_.unexpected);
        return;
    }
    if (mail.header.type == wire::MailboxType::error) return error_reply(mail.data);
    if (answers(mail, 0)) return;
    if (mailboxes_->offer({.slave = number_, .type = mail.header.type, .data = mail.data, .at = now()})) return;
    ++statistics_.unexpected;
    note_late(mail);
}

// A slave answers to the address in the header of the message. `to`: 0, or the address that an exchange must have
// named.
bool MailboxChannel::answers(const wire::MailboxMessage& mail, std::uint16_t to) {
    for (MailTurn* turn = awaiting_.front(); turn != nullptr; turn = awaiting_.after(*turn)) {
        auto& exchange = static_cast<MailExchange&>(*turn);
        if (!exchange.options_.reply) continue;  // this exchange waits until it is certain that its message has arrived
        if (exchange.type_ != mail.header.type || (to != 0 && exchange.options_.address != to)) continue;
        const MailClient::Taken taken = exchange.client_.accept(mail);
        if (taken == MailClient::Taken::no) continue;
        if (taken == MailClient::Taken::more) {
            prolong(exchange);
            return true;
        }
        if (taken == MailClient::Taken::broken)
            owe_answer_to(exchange);
        else
            note_answered(exchange);
        finish(exchange, {});
        return true;
    }
    return false;
}

// Mail that is longer than the mailbox, or empty, ends the oldest exchange of this type with an error.
void MailboxChannel::malformed(const wire::MailboxHeader& header) {
    ++statistics_.malformed;
    for (MailTurn* turn = awaiting_.front(); turn != nullptr; turn = awaiting_.after(*turn)) {
        auto& exchange = static_cast<MailExchange&>(*turn);
        if (exchange.type_ != header.type || !exchange.options_.reply) continue;
        Error error{.code = Errc::protocol, .step = Step::mailbox_receive, .slave = number_};
        error.expected = static_cast<std::uint32_t>(receive_room());
        error.actual = header.length;
        owe_in_doubt(exchange);  // the slave may still send a valid answer
        return finish(exchange, error);
    }
}

namespace {

Error error_of(std::uint16_t slave, Bytes data) {
    Error error{.code = Errc::mailbox_error, .step = Step::mailbox_receive, .slave = slave};
    if (data.size() >= wire::kMailboxErrorBytes)
        error.detail = static_cast<std::uint32_t>(wire::MailboxErrorLayout::detail::load(data));
    return error;
}

}  // namespace

// Whether the mail is an error reply to the address in the message of an exchange.
bool MailboxChannel::answers_by_error(const wire::MailboxMessage& mail, std::uint16_t to) {
    if (mail.header.type != wire::MailboxType::error) return false;
    for (MailTurn* turn = awaiting_.front(); turn != nullptr; turn = awaiting_.after(*turn)) {
        auto& exchange = static_cast<MailExchange&>(*turn);
        if (exchange.options_.address != to) continue;
        ++statistics_.errors;
        finish(exchange, error_of(number_, mail.data));
        return true;
    }
    return false;
}

// An error reply does not contain the message that it answers. If a message without reply was sent shortly before, the
// error most likely belongs to that message, because such a message has no other answer. The error may also be the late
// reply to an exchange that was given up. If no other answer comes, the error belongs to the oldest waiting exchange.
void MailboxChannel::error_reply(Bytes data) {
    ++statistics_.errors;
    const auto given_up = [&](const Owed& owed) { return is_current(owed, now()) && !owed.guessed; };
    const bool of_another =
        now() < std::exchange(unanswered_until_, Time::min()) || std::ranges::any_of(owed_, given_up);
    // Listeners receive the error of a message without reply.
    if (of_another || awaiting_.empty())
        (void)mailboxes_->offer({.slave = number_, .type = MailboxType::error, .data = data, .at = now()});
    if (awaiting_.empty()) return;
    auto& oldest = static_cast<MailExchange&>(*awaiting_.front());
    if (of_another) {
        oldest.error_ = error_of(number_, data);
        return;
    }
    // If a slave processes several protocols at the same time, the error may belong to another exchange, or to an
    // exchange that was given up.
    if (left_open_ || awaiting_.after(oldest) != nullptr) owe_in_doubt(oldest);
    finish(oldest, error_of(number_, data));
}

}  // namespace margay
