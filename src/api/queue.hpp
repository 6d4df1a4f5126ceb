// Requests from any thread: submitted without a lock, begun by poll() in the order of their priority.
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
    static std::coroutine_handle<>& sequence(Request& r) { return r.sequence_; }
    static std::atomic<bool>& cancel_asked(Request& r) { return r.cancel_asked_; }
    static std::atomic<std::uint32_t>& state(Request& r) { return r.state_; }

    static Errc& why(Request& r) { return r.why_; }
    static std::uint32_t& ticket(Request& r) { return r.ticket_; }

    // Makes the request busy; false when it is busy already. Of several threads one succeeds.
    [[nodiscard]] static bool claim(Request& r, Context& ctx);
    // The owner has the request from now on.
    static void take(Request& r) { r.state_.fetch_or(Request::kTaken, std::memory_order_acq_rel); }
    [[nodiscard]] static bool taken(const Request& r) {
        return (r.state_.load(std::memory_order_acquire) & Request::kTaken) != 0;
    }
    // Ends the request and wakes the threads that sleep until then. The request may be gone afterwards.
    static void end(Request& r, const Error& error, Osal& osal);
    // Sleeps until the request is over, or until `until`. For a thread that does not own the context.
    static void sleep(Request& r, Osal& osal, Time until);
};

// Where other threads put their requests: each into a place that is free. A thread can take its request out again as
// long as the owner has not, and no thread ever waits for another one.
struct RequestQueue {
    static constexpr std::size_t kPlaces = 64;

    std::array<std::atomic<Request*>, kPlaces> submitted{};
    std::atomic<std::uint32_t> tickets{0};
    std::atomic<bool> any_submitted{false};
    std::atomic<bool> cancel_asked{false};
    Request* waiting = nullptr;  // to begin; oldest first
    Request* running = nullptr;
};

// Queues a request that has been claimed. False: there is no free place.
[[nodiscard]] bool enqueue(Master& master, Request& request);

// Takes back a request that another thread has submitted. From any thread; false when the owner has taken it already.
[[nodiscard]] bool withdraw_submitted(RequestQueue& queue, Request& request);

// For poll(): begins what waits as far as there is room and nothing is in the way, ends what is to be cancelled and
// what has waited for too long. Returns when it wants to be called again.
Time serve_queue(Master& master, Time now);

// When the context goes away: ends what has not begun.
void cancel_queued(Master& master);

}  // namespace margay
