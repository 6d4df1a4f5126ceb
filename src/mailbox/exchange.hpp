// One message and what answers it, and the turn that a sequence of them takes: made by a protocol sequence on its own
// frame, awaited there.
//
//     MailSession session(channel, wire::MailboxType::coe, priority, give_up);
//     const Error refused = co_await session;
//     …
//     MailExchange exchange(channel, wire::MailboxType::coe, client, {.give_up = give_up});
//     const Error failed = co_await exchange;
//
// Either may be destroyed at any time: the channel cleans up behind it.
#pragma once

#include "link/engine.hpp"
#include "util/turns.hpp"
#include "wire/mailbox.hpp"

#include <margay/error.hpp>

#include <algorithm>

namespace margay {

class MailboxChannel;

// What a protocol does at one end of an exchange. Pure: no bus, no time; that makes it easy to test and to fuzz.
class MailClient {
  public:
    enum class Taken : std::uint8_t {
        no,    // it is not for this client
        more,  // it is, and more will come unasked
        all,   // it is, and the exchange is over
    };

    // Writes the next message behind the mailbox header and returns its length; 0: the mailbox is too small. Asked
    // again, and answered the same, when it is not sure that the message has arrived.
    virtual std::size_t compose(MutableBytes data) = 0;
    // Mail of the client's type has come.
    virtual Taken take(const wire::MailboxMessage& mail) = 0;

  protected:
    ~MailClient() = default;
};

// 0 (lowest) to 3, as in the mailbox header.
using MailPriority = std::uint8_t;

// Exchanges and sessions wait in turn.
using MailTurn = Turn;

// How often a sequence asks again when Errc::reply_lost ends its exchange.
inline constexpr unsigned kMostAskedAgain = 3;

// How long to wait: for the whole, the turn included, and for each answer of the slave.
struct MailPatience {
    Time give_up = kNever;
    Duration each = std::chrono::seconds(3);
    MailPriority priority = 0;
    [[nodiscard]] Time for_one(Time now) const { return std::min(give_up, later(now, each)); }
};

class MailExchange : public MailTurn {
  public:
    struct Options {
        MailPatience patience;
        // Replies to two exchanges of the same key cannot be told apart: the later one waits for what is still owed to
        // the earlier. 0: never.
        std::uint64_t key = 0;
        std::uint16_t address = 0;  // in the header; 0 from the master
        bool reply = true;          // false: over when the message has arrived
    };

    MailExchange(MailboxChannel& channel, wire::MailboxType type, MailClient& client, const Options& options)
        : channel_(channel), client_(client), options_(options), type_(type) {
        priority = options.patience.priority;
    }
    ~MailExchange();

    bool await_ready() const noexcept { return false; }
    bool await_suspend(std::coroutine_handle<> h) noexcept;
    // Code none: answered. The code, detail, expected and actual are for the protocol to complete.
    Error await_resume() noexcept;

  private:
    friend class MailboxChannel;
    enum class State : std::uint8_t { idle, queued, sent, over };

    MailboxChannel& channel_;
    MailClient& client_;
    Options options_;
    wire::MailboxType type_;
    State state_ = State::idle;
    Error error_;
    Engine::Sleep::Timer timer_;
};

// The right to use one protocol of one slave, until the end of the object's life.
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

  private:
    friend class MailboxChannel;

    MailboxChannel& channel_;
    Time give_up_;
    wire::MailboxType type_;
    bool granted_ = false;
    std::uint32_t epoch_ = 0;  // of the channel, when granted
    Error error_;
    Engine::Sleep::Timer timer_;
};

}  // namespace margay
