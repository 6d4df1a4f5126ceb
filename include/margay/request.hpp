// Requests: operations that run while the application goes on polling. A request lives in the memory of the caller, is
// given to submit(), and is busy until poll() has brought it to its end. A request can be used again afterwards.
//
//     margay::SdoUpload request;                       // lives in the caller's memory
//     request.slave = 3;
//     …
//     margay::submit(ctx, request);                    // from any thread
//     …                                                // the owner of the context polls
//     if (request.state() == margay::RequestState::success) …
//
// Threads. One thread owns a context: the thread of init(), until another thread calls take_ownership(). The owner
// polls, sends and receives process data, and may call everything. Every other thread may submit requests of every
// kind, look at them, cancel them, and call the functions that wait: these submit a request and sleep until the owner
// has brought the request to its end.
//
// Order. Of the requests that wait to begin, the request of the highest priority begins first. Some operations exclude
// each other: a scan, a mapping and a search for lost slaves need the whole segment; a change of state, an access to
// the SII and a reconfiguration need their slave. Such a request waits until the other one is over. A scan is refused
// while a supervision is busy (Errc::busy; detail: the Operation that is in the way).
#pragma once

#include <margay/al_state.hpp>
#include <margay/error.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <atomic>
#include <coroutine>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

enum class RequestState : std::uint8_t { unused, busy, success, error };

class Context;
struct OperationDescription;

class Request {
  public:
    // How long the whole may take, from the poll() that takes the request on, waiting for its turn included; then the
    // request ends with Errc::timeout. Zero: no limit, but where the request says otherwise.
    Duration timeout{0};
    std::uint8_t priority = 0;  // 0 to 3; submit() refuses more, and a negative timeout: invalid_argument

    Request(const Request&) = delete;
    Request& operator=(const Request&) = delete;

    // From any thread: once the request is not busy, its results and its error can be read and it can be changed.
    [[nodiscard]] RequestState state() const { return plain(state_.load(std::memory_order_acquire)); }
    [[nodiscard]] bool busy() const { return state() == RequestState::busy; }
    // What went wrong; code none unless state() is error.
    [[nodiscard]] const Error& error() const { return error_; }

    // From any thread: ends the request with Errc::canceled, if it is busy. What is under way on the bus is forgotten,
    // the context stays usable, and no other request is touched. The request is over when cancel() returns, with two
    // exceptions. Called by another thread than the owner, or by a callback or hook of the library, it takes effect in
    // the next poll() of the owner: until then the request stays busy.
    void cancel();

  protected:
    explicit Request(const OperationDescription& operation) : operation_(&operation) {}
    // Cancels a request that is busy, and waits for the end of it in a thread that is not the owner. Not allowed in a
    // callback or hook of the library while the request is busy: that ends the program.
    ~Request();

  private:
    friend struct RequestAccess;
    // As RequestState; besides: submit() is at it, the owner has taken it, some thread sleeps until it is not busy. 32
    // bits: what Osal::sleep_while() wants.
    static constexpr std::uint32_t kPreparing = 0x80;
    static constexpr std::uint32_t kTaken = 0x100;
    static constexpr std::uint32_t kAwaited = 0x200;
    static constexpr RequestState plain(std::uint32_t state) { return static_cast<RequestState>(state & 0x7F); }

    const OperationDescription* operation_;
    Context* ctx_ = nullptr;
    Request* next_ = nullptr;           // in one list: waiting to begin, or running
    std::uint32_t ticket_ = 0;          // the order of submission
    std::coroutine_handle<> sequence_;  // once it has begun
    Time deadline_ = kNever;
    std::atomic<std::uint32_t> state_{0};
    std::atomic<bool> cancel_asked_{false};
    Errc why_ = Errc::canceled;  // its sequence is destroyed, if it is
    std::uint8_t passed_ = 0;    // how often a younger request has begun before this one
    Error error_;
};

// A request to one slave.
class SlaveRequest : public Request {
  public:
    std::uint16_t slave = 0;  // 1 the first

  protected:
    using Request::Request;
};

// A request to the mailbox of a slave. `timeout` zero: no limit for the whole, and 3 s for each answer of the slave.
using MailRequest = SlaveRequest;

// Finds all slaves, reads what they are and brings them to PREOP. See config_init().
struct ScanRequest : Request {
    ScanRequest();
    std::uint16_t slaves = 0;  // result: how many there are, also when some slave is not as it should be
};

// Reads `data.size()` octets (an even number) of the SII EEPROM from word address `word` on.
struct SiiReadRequest : SlaveRequest {
    SiiReadRequest();
    std::uint32_t word = 0;
    std::span<std::byte> data;
};

// Writes an even number of octets to the SII EEPROM, each word read back: first words 0x08 and up in rising order, then
// the configuration area (words 0x00 to 0x07), of which only the words that differ are written. On an error,
// error().index is the word that failed. Words of the area that were written get their old values again; words from
// 0x08 up to the failed one keep the new values.
struct SiiWriteRequest : SlaveRequest {
    SiiWriteRequest();
    std::uint32_t word = 0;
    std::span<const std::byte> data;
};

// Brings one slave to a state. `timeout` zero: the time that the standard gives to the change.
struct StateRequest : SlaveRequest {
    StateRequest();
    AlState wanted = AlState::none;
};

// Reads the states of all slaves. See readstate().
struct ReadStateRequest : Request {
    ReadStateRequest();
    AlStatus lowest;  // result
};

// Requests a state of one slave, or of all (0), and does not wait for it. See writestate().
struct WriteStateRequest : SlaveRequest {
    WriteStateRequest();
    AlState wanted = AlState::none;
};

// Waits for a state of one slave, or of all (0). `timeout` zero: looks once. See statecheck().
struct StateCheckRequest : SlaveRequest {
    StateCheckRequest();
    AlState wanted = AlState::none;
    AlStatus reached;  // result
};

// Finds out what process data the slaves of a group have, lays it into `image`, and brings the slaves to SAFEOP. See
// config_map().
struct MapRequest : Request {
    MapRequest();
    std::uint8_t group = 0;
    std::span<std::byte> image;
    std::size_t bytes = 0;  // result: how many octets of it are used, also when some slave is not mapped
};

// Starts a request; from any thread, without a lock, and callable from the cycle. The request begins with the next
// poll() of the owner. Errc::busy when the request is busy already, Errc::wrong_state before init(), Errc::capacity
// when 64 requests of other threads wait for that poll() already. The owner is told at once what is wrong with the
// parameters of the request; of a request of another thread that is its error(). A request that is refused is not busy.
Result<> submit(Context& ctx, Request& request);

// Waits until a request that was submitted is not busy any more, and returns its error if it has one. The owner polls
// meanwhile: its cycle stands still. Other threads sleep. Errors besides those of the request: not_polled (another
// thread: the owner has not polled for 3 s, so that the request was not even taken; it is withdrawn),
// waiting_forbidden, in_callback (from a callback or hook of the library). An owner that stops polling for good, or
// destroys the context, first sees to it that no other thread is in a call of the context.
Result<> wait(Context& ctx, Request& request);

// Whether the owner may call functions that wait, as it may after init(). A program whose owner runs a cycle forbids it
// once the cycle has begun: then each of these calls fails in the thread of the owner with Errc::waiting_forbidden, and
// none can stop the cycle by mistake. Other threads may wait at any time. Errors: not_owner, wrong_state before init().
Result<> allow_waiting(Context& ctx, bool allowed);

// The calling thread owns the context from now on. The former owner must not be in a call of this context, and both
// threads must know of the change: one thread ends its last call before the other one makes this call.
Result<> take_ownership(Context& ctx);

}  // namespace margay
