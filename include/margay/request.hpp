// Requests: operations that run while the application goes on polling. A request lives in the caller's memory, is given
// to submit(), and is busy until poll() has brought it to its end. It may be used again afterwards. Destroying a busy
// request cancels it: what is under way on the bus is forgotten, the context stays usable.
#pragma once

#include <margay/al_state.hpp>
#include <margay/error.hpp>
#include <margay/time.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

enum class RequestState : std::uint8_t { unused, busy, success, error };

class Request {
  public:
    Request() = default;
    Request(const Request&) = delete;
    Request& operator=(const Request&) = delete;
    ~Request() { cancel(); }

    // From any thread: once it is not busy, its results and its error are there to be read.
    [[nodiscard]] RequestState state() const { return state_.load(std::memory_order_acquire); }
    [[nodiscard]] bool busy() const { return state() == RequestState::busy; }
    // What went wrong; code none unless state() is error.
    [[nodiscard]] const Error& error() const { return error_; }
    // Ends it now. A request that was busy becomes an error with Errc::canceled.
    void cancel();

  private:
    friend struct RequestAccess;
    void* coroutine_ = nullptr;
    std::atomic<RequestState> state_{RequestState::unused};
    Error error_;
};

class Context;

// A request to the mailbox of a slave. Any thread may submit it, look at state() and, once it is not busy, use its
// results and change it. cancel() and the destructor of a busy one are for the thread that polls; others call
// ask_cancel() and wait until it is not busy any more.
class MailRequest : public Request {
  public:
    std::uint16_t slave = 0;
    // For the whole: waiting for its turn and all messages. Zero: no limit for the whole, and 3 s for each answer of
    // the slave.
    Duration timeout{0};
    std::uint8_t priority = 0;  // 0 to 3; of requests that wait the highest goes first

    MailRequest() = default;
    ~MailRequest() { cancel(); }
    void cancel();
    // From any thread: has the next poll() cancel it, if it is still busy then.
    void ask_cancel();

  private:
    friend struct QueueAccess;
    // False: there is no room for it now.
    using Start = bool (*)(Context& ctx, MailRequest& request);
    Context* ctx_ = nullptr;
    Start start_ = nullptr;
    MailRequest* next_ = nullptr;  // in one of the lists: submitted, waiting to begin, running
    Time deadline_ = kNever;
    std::uint8_t passed_ = 0;
    std::atomic<bool> cancel_asked_{false};
};

// Finds all slaves, reads what they are and brings them to PREOP. See config_init().
struct ScanRequest : Request {
    std::uint16_t slaves = 0;  // result: how many were found
};

// Reads `data.size()` octets (an even number) of the SII EEPROM from word address `word` on.
struct SiiReadRequest : Request {
    std::uint16_t slave = 0;
    std::uint32_t word = 0;
    std::span<std::byte> data;
};

// Writes an even number of octets to the SII EEPROM, each word read back. On an error error().index is the first word
// that is not sure to hold what was asked for; the words before it do.
struct SiiWriteRequest : Request {
    std::uint16_t slave = 0;
    std::uint32_t word = 0;
    std::span<const std::byte> data;
};

// Brings one slave to a state. The timeout is the standard's default when it is 0.
struct StateRequest : Request {
    std::uint16_t slave = 0;
    AlState state = AlState::none;
    Duration timeout{0};
};

// Reads the states of all slaves. See readstate().
struct ReadStateRequest : Request {
    AlStatus lowest;  // result
};

// Requests a state of one slave, or of all (0), and does not wait for it. See writestate().
struct WriteStateRequest : Request {
    std::uint16_t slave = 0;
    AlState wanted = AlState::none;
};

// Waits for a state of one slave, or of all (0). See statecheck().
struct StateCheckRequest : Request {
    std::uint16_t slave = 0;
    AlState wanted = AlState::none;
    Duration timeout{0};
    AlStatus reached;  // result
};

// Finds out what process data the slaves of a group have, lays it into `image`, and brings the slaves to SAFEOP. See
// config_map(), which also calls the slaves' hooks; this does not.
struct MapRequest : Request {
    std::uint8_t group = 0;
    std::span<std::byte> image;
    std::size_t bytes = 0;  // result: how many octets of it are used
};

}  // namespace margay
