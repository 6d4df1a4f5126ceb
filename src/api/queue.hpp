// The queue of requests: any thread submits without a lock, and poll() begins the requests in the order of priority.
#pragma once

#include <margay/request.hpp>

#include <array>
#include <atomic>

namespace margay {

class Osal;
struct Master;

struct RequestAccess {
    static const OperationDescription& operation(const Request& r) { return *r.operation_; }
    static Request*& next(Request& r) { return r.next_; }
    static Time& deadline(Request& r) { return r.deadline_; }
    static std::uint8_t& passed(Request& r) { return r.passed_; }
    static Context*& context(Request& r) { return r.ctx_; }
    static TaskReference& sequence(Request& r) { return r.sequence_; }
    static std::atomic<bool>& cancel_asked(Request& r) { return r.cancel_asked_; }
    static std::atomic<std::uint32_t>& state(Request& r) { return r.state_; }

    static Errc& why(Request& r) { return r.why_; }
    static std::uint32_t& ticket(Request& r) { return r.ticket_; }

    // Makes the request busy; false if it is busy already. If several threads call claim(), it succeeds in one of them.
    [[nodiscard]] static bool claim(Request& r, Context& ctx);
    // Marks the request as accepted by the owner.
    static void accept(Request& r) { r.state_.fetch_or(Request::kAccepted, std::memory_order_acq_rel); }
    [[nodiscard]] static bool accepted(const Request& r) {
        return (r.state_.load(std::memory_order_acquire) & Request::kAccepted) != 0;
    }
    // Ends the request and wakes the threads that sleep until its end. The request may be destroyed by then: do not use
    // it afterwards.
    static void end(Request& r, const Error& error, Osal& osal);
    // Sleeps until the request is over, or until `until`. For threads that do not own the context.
    static void sleep(Request& r, Osal& osal, Time until);
};

// Requests of other threads: each thread puts its request into a free slot of `submitted`. A thread can remove its
// request again as long as the owner has not accepted it, and no thread ever waits for another thread.
struct RequestQueue {
    static constexpr std::size_t kPlaces = 64;

    std::array<std::atomic<Request*>, kPlaces> submitted{};
    std::atomic<std::uint32_t> tickets{1};  // 0: a request that was never in a queue
    std::atomic<bool> any_submitted{false};
    std::atomic<bool> cancel_asked{false};
    Request* waiting = nullptr;  // accepted, not begun; oldest first
    Request* running = nullptr;
    Time turn_at = kNever;           // when the supervision gets its turn although a request waits for the segment
    Duration turn_after{0};          // the time between the last turn and the next one
    std::size_t too_full_bytes = 0;  // a request could not begin while this much of the arena was in use
};

// Queues a request after claim(). False: there is no free slot.
[[nodiscard]] bool enqueue(Master& master, Request& request);

// Removes a request that another thread has submitted. From any thread; false if the owner has accepted the request
// already.
[[nodiscard]] bool withdraw_submitted(RequestQueue& queue, Request& request);

// For poll(): begins waiting requests if there is memory and no other operation prevents them, and ends requests that
// are cancelled or whose timeout is over. Returns the time of the next necessary call.
Time serve_queue(Master& master, Time now);

// Whether a waiting request can begin now: serve_queue() is to be called again at once.
[[nodiscard]] bool begins_at_once(Master& master);

// For the end of the context: ends the requests that have not begun.
void cancel_queued(Master& master);

}  // namespace margay
