// Requests: operations that run while the application continues to poll. A request lives in the memory of the caller.
// submit() starts it, and it is busy until poll() has finished it. After that the same request can be submitted again.
//
//     margay::SdoUpload request;                       // lives in the caller's memory
//     request.slave = 3;
//     …
//     margay::submit(ctx, request);                    // from any thread
//     …                                                // the owner of the context polls
//     if (request.state() == margay::RequestState::success) …
//
// Threads. One thread owns a context: the thread of init(), until another thread calls take_ownership(). The owner
// polls, sends and receives process data, and may make all calls. Every other thread may submit requests of every kind,
// read their state, cancel them, and call the functions that wait: these submit a request and sleep until the owner has
// finished the request.
//
// Order. Of the requests that have not begun, the request with the highest priority begins first. Some operations
// exclude each other: a scan, a mapping and a search for lost slaves need the whole segment; a change of state, an
// access to the SII and a reconfiguration need their slave. Such a request waits until the other operation is over. A
// request that waits for the whole segment holds back younger requests for a part of the segment, independent of their
// priority. Otherwise it might never begin. A scan is refused while a supervision is busy (Errc::busy; detail: the
// Operation that prevents the scan).
#pragma once

#include <margay/al_state.hpp>
#include <margay/borrowed.hpp>
#include <margay/error.hpp>
#include <margay/result.hpp>
#include <margay/task.hpp>
#include <margay/time.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// `unused`: never submitted. `success` and `error`: the request is over.
enum class RequestState : std::uint8_t { unused, busy, success, error };

class Context;
struct OperationDescription;

// The base of all requests. A busy request must not be moved, changed or submitted again.
class Request {
  public:
    // How long the request may take in total, from the poll() that accepts the request, including the time before the
    // request begins. Then the request ends with Errc::timeout. Zero: no limit, unless the request says otherwise.
    Duration timeout{0};
    std::uint8_t priority = 0;  // 0 to 3, 3 is the highest; submit() refuses more, and a negative timeout

    Request(const Request&) = delete;
    Request& operator=(const Request&) = delete;

    // From any thread. When the request is not busy, the caller can read its results and its error, and can change the
    // request.
    [[nodiscard]] RequestState state() const { return plain(state_.load(std::memory_order_acquire)); }
    [[nodiscard]] bool busy() const { return state() == RequestState::busy; }
    // The error of the request; code none unless state() is error.
    [[nodiscard]] const Error& error() const { return error_; }

    // From any thread: ends the request with Errc::canceled, if it is busy. Datagrams on the wire are ignored when they
    // come back, the context stays usable, and no other request is affected. The request is over when cancel() returns,
    // with three exceptions. When another thread than the owner calls cancel(), or a callback or hook of the library,
    // the request stays busy until the next poll() of the owner. An access to the SII EEPROM that has begun stays busy
    // until it has reached a place where it may end, at most 16 words later, and has given the EEPROM back to the
    // slave.
    void cancel();

  protected:
    explicit Request(const OperationDescription& operation) : operation_(&operation) {}
    // Cancels a busy request; in a thread that is not the owner, waits until the owner has ended the request. (When the
    // thread of the owner has ended, call take_ownership() before.) Not allowed in a callback or hook of the library
    // while the request is busy: that ends the program.
    ~Request();

  private:
    friend struct RequestAccess;
    // The values of RequestState, and bits for these conditions: submit() prepares the request; the owner has accepted
    // it; a thread sleeps until it is not busy. 32 bits, because Osal::sleep_while() needs them.
    static constexpr std::uint32_t kPreparing = 0x80;
    static constexpr std::uint32_t kAccepted = 0x100;
    static constexpr std::uint32_t kAwaited = 0x200;
    static constexpr RequestState plain(std::uint32_t state) { return static_cast<RequestState>(state & 0x7F); }

    const OperationDescription* operation_;
    Context* ctx_ = nullptr;
    Request* next_ = nullptr;   // in one of two lists: waiting to begin, or running
    std::uint32_t ticket_ = 0;  // the order of submission
    TaskReference sequence_;    // exists after the request has begun
    Time deadline_ = kNever;
    std::atomic<std::uint32_t> state_{0};
    std::atomic<bool> cancel_asked_{false};
    Errc why_ = Errc::canceled;  // the error of the request when its sequence is destroyed
    std::uint8_t passed_ = 0;    // how many younger requests have begun before this one
    Error error_;
};

// A request to one slave.
class SlaveRequest : public Request {
  public:
    std::uint16_t slave = 0;  // the first slave is 1

  protected:
    using Request::Request;
};

// A request to the mailbox of a slave. `timeout` zero: no limit for the whole request, and 3 s for each answer of the
// slave. The request is refused with missing_slave while the slave is known to be absent; with identity_unread after
// the slave was away, until its identity is compared (by readstate() or a SuperviseRequest); and with wrong_state while
// the slave is in INIT. Without a supervision call readstate() first after a pause of more than a second. A
// busy request ends with missing_slave when the slave is seen to be lost, with identity_unread when so many frames did
// not come back that another device may be there, and with mailbox_closed when the slave is in INIT or starts again.
using MailRequest = SlaveRequest;

// Finds all slaves, reads their identity and SII, and brings them to PREOP. See config_init().
struct ScanRequest : Request {
    ScanRequest();
    // Result: the number of slaves in the table, missing ones of the list of expect() included; also set if the request
    // ends with the error of a slave.
    std::uint16_t slaves = 0;
};

// Reads `data.size()` octets (an even number) of the SII EEPROM, beginning at word address `word`. `data` is the
// caller's memory. Words beyond the size that the EEPROM declares (Slave::sii_bytes; 0: unknown, not checked) are
// refused with invalid_argument: error().word() is the first word that does not exist.
struct SiiReadRequest : SlaveRequest {
    SiiReadRequest();
    std::uint32_t word = 0;
    // Access words beyond the declared size, for an EEPROM whose size word is wrong. What a slave answers beyond the
    // real end is not specified: mostly 0xFF, or the content from word 0 on again.
    bool beyond_end = false;
    std::span<std::byte> data;
};

// Writes an even number of octets to the SII EEPROM and reads back each word: first the words from 0x08 on in rising
// order, then the configuration area (words 0x00 to 0x07), of which only the words that differ are written. On an
// error, error().word() is the word that failed. Changed words of the configuration area get their old values again;
// the words from 0x08 to the failed word keep the new values. Words beyond the end are refused as by SiiReadRequest;
// then nothing was written. `timeout` and cancel() end the write between two words, never in the configuration area;
// only the destruction of the busy request, or of its context, can cut it there. A write of the words 0 to 6 does not
// change their checksum in word 7: see sii_checksum().
struct SiiWriteRequest : SlaveRequest {
    SiiWriteRequest();
    std::uint32_t word = 0;
    bool beyond_end = false;  // as in SiiReadRequest
    Borrowed<std::byte> data;
};

// Brings one slave to a state. BOOT: the slave goes to INIT first, its process data is cleared, and it gets the
// mailboxes of BOOT (Errc::unsupported if its SII describes none); from BOOT to PREOP it goes through INIT. Then the
// process data must be configured again: reconfigure_slave(), or the supervision; a slave whose revision has changed
// (Errc::remapping_needed), or whose process data has another size now (pdo_size), needs config_map(). `timeout` zero:
// the time that the standard allows for the transition. A hook that executes when the time is over is ended a quarter
// of a second later. While a supervision is busy, a slave that is lost is refused with missing_slave. A slave that
// enters every state by itself (device emulation) is refused with other_state if the way up would leave out the
// commands and hooks of a state between.
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

// Waits for a state of one slave, or of all (0). `timeout` zero: reads the states once. See statecheck().
struct StateCheckRequest : SlaveRequest {
    StateCheckRequest();
    AlState wanted = AlState::none;
    AlStatus reached;  // result
};

// Finds the process data of the slaves of a group, assigns each slave its part of `image`, and brings the slaves to
// SAFEOP. See config_map().
struct MapRequest : Request {
    MapRequest();
    std::uint8_t group = 0;
    std::span<std::byte> image;
    // Gives the memory of the image in place of `image`, when its size is known. poll() calls the function: it
    // must neither wait nor call the library. Fewer octets: image_too_large. nullptr: `image` is used. Where the group
    // is mapped again (see remapping_needed of config_map()), poll() calls it again, and the earlier memory is not used
    // any more.
    std::span<std::byte> (*memory)(std::size_t bytes, void* user) = nullptr;
    void* memory_user = nullptr;
    std::size_t bytes = 0;  // result: how many octets of the image are used, also if some slave is not mapped
};

// Starts a request. Callable from any thread, without a lock, and from the cycle. The request begins in the next poll()
// of the owner. Errors: busy (the request is busy already), wrong_state before init(), capacity (64 requests of other
// threads wait for that poll() already). In the thread of the owner, submit() also returns an error of the parameters
// of the request; in another thread the request ends with this error (error()). A request that submit() has refused is
// not busy.
Result<> submit(Context& ctx, Request& request);

// Waits until a submitted request is not busy any more, and returns its error if it has one. The owner polls while it
// waits: its cycle stops for that time. Other threads sleep. Further errors: wrong_state (the request was never
// submitted), waiting_forbidden, in_callback (called from a callback or hook of the library), not_polled (in another
// thread: the owner has not polled for 3 s and has not accepted the request; the request is withdrawn). Before an owner
// stops polling for good, or destroys the context, it must make sure that no other thread is inside a call of the
// context.
Result<> wait(Context& ctx, Request& request);

// Whether the owner may call functions that wait; after init() it may. A program whose owner runs a cycle forbids
// waiting when the cycle has begun: then each of these calls, except run_cycle(), fails in the thread of the owner with
// Errc::waiting_forbidden, and no call can stop the cycle by mistake. Other threads may wait at any time. Errors:
// not_owner, wrong_state before init().
Result<> allow_waiting(Context& ctx, bool allowed);

// Makes the calling thread the owner of the context. The former owner must not be inside a call of this context, and
// the change must be synchronized: the former owner's last call ends before the new owner makes this call. An owner
// hands over before its thread ends: a system may give the identity of an ended thread to a new one, which is then
// taken for the owner. Errors: wrong_state before init().
Result<> take_ownership(Context& ctx);

}  // namespace margay
