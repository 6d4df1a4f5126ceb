// The mailbox channel of one slave (ETG.1000.4 "Mailbox", ETG.1000.6 "Mailbox"): what is to be sent leaves in turn,
// what comes goes to whom it is for.
//
// One coroutine, the pump, works as long as there is something to do. It never has more than one datagram under way, so
// that messages keep their order; the pumps of many slaves run beside each other, and what they send in the same poll()
// shares frames.
//
// Lost frames. A message whose frame did not come back is sent again, under the same counter, only if the slave's
// mailbox is found empty and nothing has come back for a while: a slave that has it drops the second one. A reply whose
// frame was lost on its way back is asked for by the repeat request of SyncManager 1 (activate octet, bit 1), which the
// slave acknowledges; one that comes twice is known by its counter. A slave that acknowledges the repeat request, or
// does not know it, and leaves its mailbox empty does not have the reply any more: the exchange ends with
// Errc::reply_lost, and the protocol asks again, by a message of a new counter.
#pragma once

#include "mailbox/exchange.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/emergency.hpp>
#include <margay/slave.hpp>
#include <margay/statistics.hpp>

#include <array>

namespace margay {

class Mailboxes;

class MailboxChannel {
  public:
    struct Timing {
        Duration first_pause = std::chrono::microseconds(100);  // between looks for mail; doubles
        Duration longest_pause = std::chrono::milliseconds(1);
        Duration resend_after = std::chrono::milliseconds(20);  // a message that may not have arrived
        Duration repeat_patience = std::chrono::milliseconds(100);
        Duration owed_patience = std::chrono::milliseconds(100);  // for the reply to an exchange that was given up
    };

    MailboxChannel() = default;
    MailboxChannel(const MailboxChannel&) = delete;
    MailboxChannel& operator=(const MailboxChannel&) = delete;

    // The slave's SyncManagers have been set up for `info`: nothing is known of what they hold, so it is looked at
    // first.
    void open(Mailboxes& mailboxes, const Station& station, Slave& slave, const MailboxInfo& info);
    // Ends all that waits with Errc::mailbox_closed. What the slave has reported can still be read.
    void close();
    // Another slave may be there from now on.
    void forget();
    [[nodiscard]] bool is_open() const { return open_; }

    // Sends the message when its turn comes, without anybody waiting for it: the abort of a transfer that was given up.
    // One at a time, the first is kept.
    void farewell(wire::MailboxType type, Bytes data);

    // There may be mail: looks once.
    void glance();

    // The octet of the process image, and the bit in it, that say whether there is mail; nullptr: none do.
    void use_status_bit(const std::byte* octet, unsigned bit) {
        status_octet_ = octet;
        status_bit_ = static_cast<std::uint8_t>(bit);
    }

    [[nodiscard]] const Station station() const { return {*engine_, address_, position_}; }
    [[nodiscard]] Slave& slave() const { return *slave_; }
    [[nodiscard]] Engine& engine() const { return *engine_; }
    [[nodiscard]] Arena& arena() const { return engine_->arena(); }
    [[nodiscard]] Mailboxes& mailboxes() const { return *mailboxes_; }
    // Octets of data, header not counted, that fit into one message.
    [[nodiscard]] std::size_t send_room() const { return room(info_.out_bytes); }
    [[nodiscard]] std::size_t receive_room() const { return room(info_.in_bytes); }
    [[nodiscard]] MailboxStatistics& statistics() { return statistics_; }
    [[nodiscard]] EmergencyRing& emergencies() { return emergencies_; }

    // Found out while the slave is used: it has refused complete access.
    bool no_complete_access = false;
    // By that, or because the application says so.
    [[nodiscard]] bool whole_objects() const { return !no_complete_access && !slave_->config.no_complete_access; }
    Timing timing;

  private:
    friend class MailExchange;
    friend class MailSession;
    friend class Mailboxes;
    class PumpGuard;
    class Doze;

    enum class Action : std::uint8_t { stop, doze, send, look, look_out, fetch, ask_repeat };
    // Of a reply that was lost: it must be asked for, it can be (the SyncManager's activate octet is known), it was.
    enum class Repeated : std::uint8_t { no, wanted, ready, requested };

    [[nodiscard]] static constexpr std::size_t room(std::size_t bytes) {
        return bytes > wire::kMailboxHeaderBytes ? bytes - wire::kMailboxHeaderBytes : 0;
    }

    // channel_turns.cpp: exchanges and sessions
    void enqueue(MailExchange& exchange);
    void forget(MailExchange& exchange);
    void prolong(MailExchange& exchange);
    void finish(MailExchange& exchange, const Error& error);
    [[nodiscard]] Error overdue(const MailExchange& exchange) const;
    [[nodiscard]] bool try_enter(MailSession& session);
    void wait_turn(MailSession& session);
    void leave(MailSession& session);

    // channel.cpp: the pump
    Task<Result<>> pump();
    void ensure_pump();
    void kick();
    [[nodiscard]] Action next_action();
    [[nodiscard]] Action next_look();
    [[nodiscard]] bool pick_message();
    [[nodiscard]] bool expecting() const;
    [[nodiscard]] bool bit_is_trusted() const;
    [[nodiscard]] Time doze_until() const;
    [[nodiscard]] bool compose(MutableBytes buffer);
    void sent(Reply reply);
    void left(MailExchange& exchange);
    void said_farewell(Reply reply);
    void not_taken(Errc why);
    void looked(Reply reply, Bytes octets);
    void looked_out(Reply reply, std::byte status);
    void fetched(Reply reply, Bytes mailbox);
    void nothing_there();
    void reply_is_lost();
    void look_soon();

    // channel_dispatch.cpp: what came
    void take_in(Bytes mailbox);
    void dispatch(const wire::MailboxMessage& mail);
    void malformed(const wire::MailboxHeader& header);
    void error_reply(Bytes data);
    [[nodiscard]] Time now() const { return engine_->now(); }

    Engine* engine_ = nullptr;
    Mailboxes* mailboxes_ = nullptr;
    Slave* slave_ = nullptr;
    StationAddress address_;
    std::uint16_t position_ = 0;
    MailboxInfo info_;
    bool open_ = false;
    std::uint32_t epoch_ = 0;

    List<MailTurn> queue_;     // exchanges to be sent
    List<MailTurn> awaiting_;  // exchanges to be answered, in the order they were sent
    List<MailTurn> tickets_;   // sessions that wait for their turn
    std::uint16_t busy_types_ = 0;

    // What is being sent.
    MailExchange* sending_ = nullptr;
    bool sending_farewell_ = false;
    MailExchange* unsure_ = nullptr;  // sent, but its frame was lost
    bool resend_ = false;
    Time resend_at_ = kNever;
    Time unsure_until_ = kNever;
    Time send_at_ = Time::min();    // not before: the mailbox was full
    std::uint8_t out_counter_ = 0;  // of the last message that left
    std::uint8_t trial_counter_ = 0;
    Errc trouble_ = Errc::none;  // what keeps messages from leaving, or mail from coming
    std::array<std::byte, 16> farewell_{};
    std::uint8_t farewell_bytes_ = 0;
    wire::MailboxType farewell_type_{};
    Time farewell_until_ = Time::min();

    // What comes.
    bool glance_ = false;
    bool full_ = false;    // there is mail, as far as is known
    bool parked_ = false;  // the watch over all slaves looks for us
    Time look_at_ = Time::min();
    Duration pause_{0};
    std::uint8_t silent_looks_ = 0;  // in a row that the slave has not answered
    static constexpr std::uint8_t kMostSilentLooks = 100;  // of a millisecond each
    unsigned looks_ = 0;  // in vain, one behind the other
    std::uint8_t in_counter_ = 0;
    bool counts_ = true;  // the slave has not been seen without a counter
    Repeated repeat_ = Repeated::no;
    bool repeated_ = false;  // the next mail may be one that we had already
    std::uint8_t activate_ = 0;
    Time repeat_until_ = kNever;
    Time lost_at_ = kNever;  // what was asked for by a repeat request, and has not come until then, is lost
    std::uint64_t owed_key_ = 0;
    Time owed_until_ = Time::min();
    Time unanswered_until_ = Time::min();  // a message that wants no reply has left; its error may still come
    const std::byte* status_octet_ = nullptr;
    std::uint8_t status_bit_ = 0;
    Time fetched_at_ = Time::min();
    Time real_look_at_ = Time::min();

    TaskHandle pump_;
    bool dozing_ = false;
    Engine::Sleep::Timer doze_;
    MailboxStatistics statistics_;
    EmergencyRing emergencies_;
};

}  // namespace margay
