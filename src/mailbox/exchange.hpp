// MailExchange: one message and its reply. MailSession: the turn of a protocol sequence to use one protocol of a slave.
// A protocol sequence keeps both in its coroutine frame and awaits them.
//
//     MailSession session(channel, wire::MailboxType::coe, priority, give_up);
//     const Error refused = co_await session;
//     …
//     MailExchange exchange(channel, wire::MailboxType::coe, client, {.patience = {.give_up = give_up}});
//     const Error failed = co_await exchange;
//
// Both may be destroyed at any time: their destructors remove them from the channel.
#pragma once

#include "link/engine.hpp"
#include "util/turns.hpp"
#include "wire/mailbox.hpp"

#include <margay/error.hpp>

#include <algorithm>

namespace margay {

class MailboxChannel;

// The keys of exchanges, see MailExchange::Options: the upper half is the kind, and the lower half distinguishes
// exchanges of this kind.
namespace mail_key {
enum class Kind : std::uint8_t { none, sdo, sdo_information, tx_pdo, foe, soe, eoe };
[[nodiscard]] constexpr std::uint64_t of(Kind kind, std::uint32_t which = 0) {
    return static_cast<std::uint64_t>(kind) << 32 | which;
}
[[nodiscard]] constexpr std::uint64_t of(Kind kind, std::uint16_t index, std::uint8_t subindex) {
    return of(kind, std::uint32_t{index} << 8 | subindex);
}
[[nodiscard]] constexpr Kind kind_of(std::uint64_t key) { return static_cast<Kind>(key >> 32); }
// A reply to the exchange can be mistaken for a reply to any other exchange of its protocol.
inline constexpr std::uint64_t kAny = UINT64_MAX;
}  // namespace mail_key

// The part of the protocol in an exchange: composes the message and reads the replies. Independent of bus and time, so
// that it is easy to test and to fuzz.
class MailClient {
  public:
    enum class Taken : std::uint8_t {
        no,      // the mail is not for this client
        more,    // it is for this client, and more mail will follow without a request
        all,     // it is for this client, and the exchange has ended
        broken,  // it is for this client, which ends the exchange, although more mail will follow without a request
    };

    // Writes the message behind the mailbox header and returns its length; 0: the mailbox is too small. It is called
    // again, and must write the same octets again, when the message may not have arrived.
    virtual std::size_t compose(MutableBytes data) = 0;
    // Called for received mail of the client's type.
    virtual Taken accept(const wire::MailboxMessage& mail) = 0;

  protected:
    ~MailClient() = default;
};

// 0 (lowest) to 3, as in the mailbox header.
using MailPriority = std::uint8_t;

// Base of the objects that wait in a queue of the channel: exchanges and sessions.
using MailTurn = Turn;

// How often a sequence repeats its request when Errc::reply_lost ends its exchange.
inline constexpr unsigned kMostAskedAgain = 3;

// How long to wait: for the whole sequence including the wait for its turn (until give_up), and for each reply.
struct MailPatience {
    Time give_up = kNever;
    Duration each = std::chrono::seconds(3);
    MailPriority priority = 0;
    [[nodiscard]] Time for_one(Time now) const { return std::min(give_up, later(now, each)); }
};

class MailSession;

class MailExchange : public MailTurn {
  public:
    // The value of `mails` if it is not known how many mails a reply has.
    static constexpr std::uint8_t kManyMails = 255;

    struct Options {
        MailPatience patience;
        // Replies to two exchanges of the same protocol and key cannot be distinguished. The later exchange waits while
        // a reply to the earlier one may still arrive. 0: no restriction. See mail_key.
        std::uint64_t key = 0;
        std::uint16_t address = 0;  // station address in the mailbox header; 0: from the master
        bool reply = true;          // false: the exchange ends when the message has arrived
        std::uint8_t mails = 1;     // the number of mails in a reply
        bool in_parts = false;      // the reply may consist of several mails: if one of them is lost, Errc::reply_lost
        // A late reply does not look like the reply to the first message of the next sequence, so that sequence need
        // not wait as long as this exchange would have waited.
        bool distinct = false;
    };

    MailExchange(MailboxChannel& channel, wire::MailboxType type, MailClient& client, const Options& options)
        : channel_(channel), client_(client), options_(options), type_(type) {
        priority = options.patience.priority;
    }
    // An exchange of the protocol of a session. It ends with MailboxChannel::cut_by() if the channel was closed or
    // interrupted since the session was granted, because the slave may have forgotten the sequence.
    MailExchange(MailSession& session, MailClient& client, const Options& options);
    ~MailExchange();

    bool await_ready() const noexcept { return false; }
    bool await_suspend(std::coroutine_handle<> h) noexcept;
    // Code none: answered. The protocol completes the error (code, detail, expected and actual are set).
    Error await_resume() noexcept;

  private:
    friend class MailboxChannel;
    enum class State : std::uint8_t { idle, queued, sent, over };

    MailboxChannel& channel_;
    MailClient& client_;
    Options options_;
    const MailSession* session_ = nullptr;
    wire::MailboxType type_;
    State state_ = State::idle;
    Time wanted_until_ = kNever;  // the timeout of the reply
    Error error_;                 // before State::over: an error reply that may be the answer
    Engine::Sleep::Timer timer_;
};

// The right to use one protocol of one slave, until the object is destroyed.
class MailSession : public MailTurn {
  public:
    MailSession(MailboxChannel& channel, wire::MailboxType type, MailPriority wanted, Time give_up)
        : channel_(channel), give_up_(give_up), type_(type) {
        priority = wanted;
    }
    ~MailSession();

    bool await_ready() noexcept;
    void await_suspend(std::coroutine_handle<> h) noexcept;
    Error await_resume() noexcept;
    [[nodiscard]] wire::MailboxType type() const { return type_; }
    // False: the session was not granted, or the channel was closed or interrupted since.
    [[nodiscard]] bool holds() const;

  private:
    friend class MailboxChannel;
    friend class MailExchange;

    MailboxChannel& channel_;
    Time give_up_;
    wire::MailboxType type_;
    bool granted_ = false;
    std::uint32_t epoch_ = 0;  // of the channel, when granted
    Error error_;
    Engine::Sleep::Timer timer_;
};

}  // namespace margay
