// The mailbox channel of one slave (ETG.1000.4 "Mailbox", ETG.1000.6 "Mailbox"): sends messages in turn and dispatches
// received mail to the exchange or protocol that it belongs to.
//
// One coroutine, the pump, exists as long as there is something to do. It has at most one datagram in flight, so that
// messages keep their order. The pumps of many slaves work at the same time, and the datagrams that they send in the
// same poll() share frames.
//
// Lost frames. A message whose frame did not come back is sent again, with the same counter, only if the slave's
// mailbox is found empty and no reply has arrived for a while: a slave that already has the message drops the second
// copy. When the frame with a reply is lost on the way back, the channel sends the repeat request of SyncManager 1
// (activate octet, bit 1), which the slave acknowledges; a reply that arrives twice is recognised by its counter. A
// slave that acknowledges the repeat request, or does not support it, and leaves its mailbox empty does not have the
// reply any more. The exchange then ends with Errc::reply_lost, and the protocol sends its request again as a message
// with a new counter.
#pragma once

#include "mailbox/exchange.hpp"
#include "mailbox/late_answers.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/detail/writable_ring.hpp>
#include <margay/emergency.hpp>
#include <margay/slave.hpp>
#include <margay/statistics.hpp>

#include <array>
#include <functional>

namespace margay {

class Mailboxes;

// The times of all channels.
namespace mail_timing {
// Between looks for mail; doubled after each look in vain.
inline constexpr Duration kFirstPause = std::chrono::microseconds(100);
inline constexpr Duration kLongestPause = std::chrono::milliseconds(1);
// For a message that may not have arrived.
inline constexpr Duration kResendAfter = std::chrono::milliseconds(20);
inline constexpr Duration kRepeatPatience = std::chrono::milliseconds(100);
// The least waiting time for the reply to an exchange that was given up, from the time at which the slave has accepted
// the message that ends the operation.
inline constexpr Duration kOwedPatience = std::chrono::milliseconds(100);
// For the message that ends an operation early.
inline constexpr Duration kFinalPatience = std::chrono::seconds(1);
// The same for a slave that still works on the message before.
inline constexpr Duration kFencePatience = std::chrono::seconds(9);
}  // namespace mail_timing

class MailboxChannel;

// The functions for the exchanges of an interrupted channel. The first exchange passes them to Mailboxes, so that a
// program without exchanges does not contain them.
struct ExchangePart {
    // Called when the channel is interrupted: the slave still answers the messages that it has received.
    void (*interrupt)(MailboxChannel& channel);
    // Called when the channel is resumed: sends the slave the messages that end its transfers.
    void (*resume)(MailboxChannel& channel);
};

class MailboxChannel {
  public:
    MailboxChannel();
    MailboxChannel(const MailboxChannel&) = delete;
    MailboxChannel& operator=(const MailboxChannel&) = delete;

    // Call it when the slave's SyncManagers are configured with `info`. Their content is unknown, so the channel first
    // looks for mail from before.
    void open(Mailboxes& mailboxes, const Station& station, Slave& slave, const MailboxInfo& info);
    // Ends all exchanges and waiting sessions with Errc::mailbox_closed. Emergencies received so far remain readable.
    void close();
    // The same as close(), and deletes all knowledge about the slave, because another slave may be present from now on.
    void forget();
    [[nodiscard]] bool is_open() const { return open_; }
    // Whether the mailbox of the slave has worked since forget(). It may be closed now.
    [[nodiscard]] bool was_open() const { return was_open_; }
    // The slave does not answer any more (missing_slave), or another device may have its address (identity_unread):
    // ends all exchanges and waiting sessions with this error. The channel stays open, but refuses messages and looks
    // for no mail until resume().
    void interrupt(Errc reason);
    // Call it when the slave is present again and its identity was compared. Mail from before is fetched before the
    // first message is sent.
    void resume();
    // Whether the channel is open and not interrupted.
    [[nodiscard]] bool is_reachable() const { return open_ && !away_; }
    // Whether an operation is executing, or waits for its turn.
    [[nodiscard]] bool is_used() const {
        return busy_types_ != 0 || sending_ != nullptr || !queue_.empty() || !awaiting_.empty() || !tickets_.empty();
    }
    // A number that changes with each close() and interrupt().
    [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
    // The cause of the last change of epoch(), which is the error of a sequence that began before.
    [[nodiscard]] Errc cut_by() const { return cut_by_; }

    // Sends a message that ends an operation in the slave that was given up. The message is sent before all others, and
    // is repeated for a second if frames are lost. The channel keeps a copy of at most kFinalBytes octets. Without
    // memory for the sequence the message is lost.
    static constexpr std::size_t kFinalBytes = 16;
    // `ends`: the operations of end_operations() that the message ends.
    void send_final_message(wire::MailboxType type, Bytes data, std::uint8_t ends = 0);
    // Ends operations of one protocol in the slave that were given up; `which` has a bit for each operation. `how`
    // sends the final messages. If the slave is away, or does not accept these messages, they are sent when the slave
    // is present again.
    using EndOperations = void (*)(MailboxChannel& channel, std::uint8_t which);
    void end_operations(std::uint8_t which, EndOperations how);

    // Notes that a reply of this protocol and key may still arrive until the given time. Exchanges of the same key
    // wait.
    void owe_reply(wire::MailboxType type, std::uint64_t key, Time until);
    // Notes that a request of this key, first sent at `begun`, was sent more than once and is answered now. If the
    // slave has received both messages, it answers a second time, and needs the same time as for the first answer.
    void owe_second_reply(wire::MailboxType type, std::uint64_t key, Time begun) {
        owe_reply(type, key, now() + (now() - begun) + mail_timing::kOwedPatience);
    }
    // Whether a reply to an earlier CoE request may still arrive, and would be mistaken for the reply to a request of
    // this key. The doubt lasts until the slave has answered a later request, because a slave answers requests in their
    // order.
    [[nodiscard]] bool is_doubtful(std::uint64_t key) const;
    // The same for files: how many earlier requests may still be answered.
    [[nodiscard]] std::uint8_t late_files() const { return owed_[1].mails != 0 ? owed_[1].files : std::uint8_t{0}; }
    // Notes that the first packets of `files` files may still arrive at any time. The next file waits for them until
    // `until`.
    void owe_files(unsigned files, Time until);
    // EoE parameters and SoE: the answers that may still arrive, at any time.
    [[nodiscard]] LateAnswers& late_answers() { return late_; }
    // Call it when the slave has answered a question of EoE or SoE: the channel does not wait for earlier answers any
    // more.
    void end_wait(wire::MailboxType type, std::uint64_t key) {
        Owed& owed = owed_of(type);
        const bool alike = owed.key == key || type == wire::MailboxType::eoe;
        if (owed.type == type && alike && late_.count(type, owed.key) == 0) owed.mails = 0;
    }
    // Whether the slave has not accepted the message yet that ends an earlier CoE operation.
    [[nodiscard]] bool is_fenced() const { return owed_[0].fences != 0; }
    // Whether exactly one CoE reply is owed, and it has this key.
    [[nodiscard]] bool owes_only(std::uint64_t key) const {
        return owed_[0].mails == 1 && owed_[0].key == key && key != mail_key::kAny;
    }
    // The key of the next question of settle_owed(): an object that was in no request that was given up, and in no
    // unanswered question. Otherwise a late answer would be mistaken for the answer to this question.
    [[nodiscard]] std::uint64_t next_question();
    // Call it before the question is sent.
    void note_question(std::uint64_t key);
    // Call it when the owed replies have come.
    void forget_owed() { owed_[0].mails = 0; }
    // Call it when the slave has answered a later request.
    void end_doubt() { owed_[0].mails = owed_[0].questions = 0; }
    // Whether the mail can be a reply to an exchange of this key.
    [[nodiscard]] static bool can_answer(std::uint64_t key, const wire::MailboxMessage& mail);

    // Looks for mail until the mailbox is empty. A slave that does not answer gets 100 looks.
    void glance();
    // The same for regular looks. The channel does not look if it looks by itself already, or if a mapped bit reports
    // no mail. A slave that does not answer gets one look.
    void look_once();

    // For listeners, within take(): announces that the slave sends more mail at once. The channel fetches it without a
    // look.
    void expect_more() { full_ = true; }

    // Ends the use of a bit that lies in this memory.
    void forget_status_bit(Bytes memory) {
        const std::less<> before;
        const bool inside =
            !before(status_octet_, memory.data()) && before(status_octet_, memory.data() + memory.size());
        if (inside) status_octet_ = nullptr;
    }
    // The octet of the process image, and the bit in it, that report mail of this slave. nullptr: there is no such bit.
    void use_status_bit(const std::byte* octet, unsigned bit) {
        status_octet_ = octet;
        status_bit_ = static_cast<std::uint8_t>(bit & 7U);
    }

    [[nodiscard]] const Station station() const { return {*engine_, address_, number_}; }
    [[nodiscard]] Slave& slave() const { return *slave_; }
    [[nodiscard]] Engine& engine() const { return *engine_; }
    [[nodiscard]] Arena& arena() const { return engine_->arena(); }
    [[nodiscard]] Mailboxes& mailboxes() const { return *mailboxes_; }
    // Octets of data that fit into one message, mailbox header not counted.
    [[nodiscard]] std::size_t send_room() const { return room(info_.out_bytes); }
    [[nodiscard]] std::size_t receive_room() const { return room(info_.in_bytes); }
    [[nodiscard]] MailboxStatistics& statistics() { return statistics_; }
    [[nodiscard]] WritableRing<Emergency>& emergencies() { return emergencies_; }

    // Set when the slave has refused complete access.
    bool no_complete_access = false;
    // Whether complete access may be used: the slave has not refused it, and the application has not disabled it.
    [[nodiscard]] bool whole_objects() const { return !no_complete_access && !slave_->config.no_complete_access; }

  private:
    friend class MailExchange;
    friend class MailSession;
    friend class Mailboxes;
    class PumpGuard;
    class Doze;
    class OneOrTwo;

    enum class Action : std::uint8_t { stop, doze, send, look, look_out, fetch, ask_repeat };
    // State of the repeat request for a lost reply. wanted: the activate octet of SyncManager 1 must be read first;
    // ready: the octet is known; requested: the request was written.
    enum class Repeated : std::uint8_t { no, wanted, ready, requested };

    [[nodiscard]] static constexpr std::size_t room(std::size_t bytes) {
        return bytes > wire::kMailboxHeaderBytes ? bytes - wire::kMailboxHeaderBytes : 0;
    }

    // channel_turns.cpp: exchanges and sessions
    struct FinalMessage {
        wire::MailboxType type{};
        std::uint8_t bytes = 0;
        std::uint8_t ends = 0;  // of unfinished_
        std::array<std::byte, kFinalBytes> octets{};
    };
    // Replies that may still arrive, of one protocol or several: owed_of().
    struct Owed {
        std::uint64_t key = 0;
        Time until = Time::min();
        wire::MailboxType type{};    // error: several
        std::uint8_t mails = 0;      // how many mails may still arrive; 0: none is owed
        std::uint8_t fences = 0;     // final messages that the slave has not taken; until then, time does not count
        bool lasts = false;          // see is_doubtful()
        bool guessed = false;        // the exchange has ended by an error reply that may belong to another exchange
        std::uint8_t questions = 0;  // CoE: a bit for each object of kQuestions whose answer may still come
        // CoE: the subindex of 0x1000 in the last question, if the question is none of kQuestions.
        std::uint8_t spare = 1;
        std::uint8_t files = 0;  // FoE: how many of them may be first packets of files: see late_files()
    };
    class Fence;

    // channel_owed.cpp: late replies, and the messages that end operations early
    Task<Result<>> deliver(FinalMessage message);
    [[nodiscard]] Owed& owed_of(wire::MailboxType type) { return owed_[owed_place(type)]; }
    [[nodiscard]] static std::size_t owed_place(wire::MailboxType type);
    Owed& owe(wire::MailboxType type, std::uint64_t key, std::uint8_t mails, Time until);
    [[nodiscard]] bool must_wait(const MailExchange& exchange) const;
    [[nodiscard]] bool is_owed() const;
    [[nodiscard]] static bool is_current(const Owed& owed, Time now) {
        return owed.mails != 0 && (now < owed.until || owed.fences != 0);
    }
    // Whether a late reply to the exchange is excluded when the slave has answered a later request: see is_doubtful().
    [[nodiscard]] static bool is_in_order(const MailExchange& exchange) {
        const bool foe = exchange.type_ == wire::MailboxType::foe && !exchange.options_.distinct;
        return exchange.options_.key != 0 && (foe || exchange.type_ == wire::MailboxType::coe);
    }
    void make_last(Owed& owed, const MailExchange& exchange);
    void note_late(const wire::MailboxMessage& mail);
    void note_answered(const MailExchange& exchange);
    // Notes the owed replies when a sent exchange ends without its reply.
    void owe_answer_to(const MailExchange& exchange);
    void owe_in_doubt(const MailExchange& exchange);
    [[nodiscard]] static std::uint8_t question_bit(std::uint64_t key);

    void enqueue(MailExchange& exchange);
    void forget(MailExchange& exchange);
    void prolong(MailExchange& exchange);
    void finish(MailExchange& exchange, const Error& error);
    [[nodiscard]] Error overdue(const MailExchange& exchange) const;
    [[nodiscard]] bool try_enter(MailSession& session);
    void wait_turn(MailSession& session);
    void leave(MailSession& session);
    void end_exchanges(Errc why);
    void owe_all_answers();
    void end_transfers();
    static const ExchangePart kExchanges;

    // channel.cpp: the pump
    Task<Result<>> pump();
    void ensure_pump();
    void kick();
    [[nodiscard]] Action next_action();
    [[nodiscard]] Action next_look();
    [[nodiscard]] bool pick_message();
    [[nodiscard]] bool expecting() const;
    [[nodiscard]] bool looks_beside() const;
    [[nodiscard]] bool bit_is_trusted() const;
    [[nodiscard]] bool bit_is_set() const {
        return ((std::to_integer<unsigned>(*status_octet_) >> status_bit_) & 1U) != 0;
    }
    [[nodiscard]] Time doze_until() const;
    [[nodiscard]] bool compose(MutableBytes buffer);
    void sent(Reply reply);
    void left(MailExchange& exchange);
    void message_refused(Errc why);
    void looked(Reply reply, Bytes octets);
    void looked_out(Reply reply, std::byte status);
    void fetched(Reply reply, Bytes mailbox);
    void nothing_there();
    void reply_is_lost();
    void look_soon();

    // channel_dispatch.cpp: received mail
    void receive_mail(Bytes mailbox);
    void dispatch(const wire::MailboxMessage& mail);
    [[nodiscard]] bool answers(const wire::MailboxMessage& mail, std::uint16_t to);
    void malformed(const wire::MailboxHeader& header);
    void lose_parts();
    [[nodiscard]] bool answers_by_error(const wire::MailboxMessage& mail, std::uint16_t to);
    void error_reply(Bytes data);
    [[nodiscard]] Time now() const { return engine_->now(); }

    static constexpr std::uint8_t kMostStale = 16;         // a slave that always has mail must not prevent sending
    static constexpr std::uint8_t kMostSilentLooks = 100;  // one millisecond each
    static constexpr std::size_t kOwedPlaces = 3;          // CoE, FoE, and all other protocols

    // A context has a channel for each slave, so the members are in the order of their sizes.
    bool open_ : 1 = false;
    bool was_open_ : 1 = false;
    bool away_ : 1 = false;  // interrupted
    bool dozing_ : 1 = false;
    bool resend_ : 1 = false;
    bool left_open_ : 1 = false;  // since open(), a message was sent that the slave may still refuse by an error reply,
                                  // although no exchange waits for it
    bool glance_ : 1 = false;
    bool full_ : 1 = false;                  // there is mail, as far as is known
    bool watched_by_mailboxes_ : 1 = false;  // Mailboxes looks for mail in place of this channel
    bool has_counted_ : 1 = false;           // the last mail had the counter that follows that of the mail before it
    bool counts_ : 1 = true;                 // false: the slave sends mail with counter 0
    bool repeated_ : 1 = false;              // the next mail may repeat the one received before
    bool missed_ : 1 = false;                // a frame with mail may have been lost, and no mail has come since
    std::uint8_t status_bit_ : 3 = 0;

    // Sending.
    std::uint8_t out_counter_ = 0;  // of the last message that was sent
    std::uint8_t trial_counter_ = 0;
    Errc cut_by_ = Errc::mailbox_closed;
    Errc last_failure_ = Errc::none;  // the reason why messages cannot be sent or mail cannot be fetched

    // Receiving.
    // How many messages from before open() may still be fetched before the first message is sent; 0: sending may begin.
    std::uint8_t stale_ = 0;
    std::uint8_t silent_looks_ = 0;  // consecutive looks that the slave has not answered
    std::uint8_t in_counter_ = 0;
    std::uint16_t in_length_ = 0;  // of the last mail, as in_counter_
    wire::MailboxType in_type_{};  // the same
    Repeated repeat_ = Repeated::no;
    std::uint8_t activate_ = 0;
    std::uint8_t unfinished_ = 0;  // a bit for each operation that the slave does not know to have ended
    std::uint16_t busy_types_ = 0;

    StationAddress address_;
    std::uint16_t number_ = 0;
    MailboxInfo info_;
    std::uint16_t looks_ = 0;  // consecutive looks without mail
    LateAnswers late_;
    std::uint32_t epoch_ = 0;
    Engine* engine_ = nullptr;
    Mailboxes* mailboxes_ = nullptr;
    Slave* slave_ = nullptr;
    const std::byte* status_octet_ = nullptr;
    EndOperations end_unfinished_ = nullptr;

    List<MailTurn> queue_;     // exchanges whose message is not sent yet
    List<MailTurn> awaiting_;  // exchanges whose message was sent, in the order of sending
    List<MailTurn> tickets_;   // sessions that wait for their turn
    MailExchange* sending_ = nullptr;
    MailExchange* unsure_ = nullptr;  // its message was sent, but the frame was lost

    // Sending.
    Time resend_at_ = kNever;
    Time unsure_until_ = kNever;
    Time send_at_ = Time::min();  // not before this time: the mailbox was full

    // Receiving.
    Time look_at_ = Time::min();
    Duration pause_{0};
    Time repeat_until_ = kNever;
    // A reply that was asked for by a repeat request is lost when it has not arrived until then.
    Time lost_at_ = kNever;
    std::array<Owed, kOwedPlaces> owed_;
    Time late_until_ = Time::min();  // until this time, the channel looks for replies to exchanges that were given up
    // A message without reply was sent: until then an error reply most likely belongs to it, and later it may.
    Time unanswered_until_ = Time::min();
    Time fetched_at_ = Time::min();
    Time real_look_at_ = Time::min();

    TaskHandle pump_;
    Engine::Sleep::Timer doze_;
    MailboxStatistics statistics_;
    WritableRing<Emergency> emergencies_;
};

}  // namespace margay
