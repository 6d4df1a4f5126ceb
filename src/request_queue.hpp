// Requests that come from any thread: queued without a lock, begun by poll().
#pragma once

#include "osal/osal.hpp"
#include "requests.hpp"

namespace margay {

struct QueueAccess {
    static void prepare(MailRequest& r, Context& ctx, MailRequest::Start start) {
        r.ctx_ = &ctx;
        r.start_ = start;
        r.passed_ = 0;
        r.cancel_asked_.store(false, std::memory_order_relaxed);
    }
    static MailRequest*& next(MailRequest& r) { return r.next_; }
    static Time& deadline(MailRequest& r) { return r.deadline_; }
    static std::uint8_t& passed(MailRequest& r) { return r.passed_; }
    [[nodiscard]] static bool start(MailRequest& r) { return r.start_(*r.ctx_, r); }
    [[nodiscard]] static bool cancel_asked(const MailRequest& r) {
        return r.cancel_asked_.load(std::memory_order_acquire);
    }
};

// Queues a request whose state is busy already.
void enqueue(Context& ctx, MailRequest& request, bool (*start)(Context& ctx, MailRequest& request));

// For poll(): begins what was queued, and cancels what shall be. What there is no room for waits; the highest priority
// goes first.
void start_queued(Context& ctx, Time now);

// Time in milliseconds, nearly, and without a division: steps of 2^20 ns.
[[nodiscard]] inline std::uint32_t ticks(Time time) {
    return static_cast<std::uint32_t>(time.time_since_epoch().count() >> 20);
}

// When the context goes away: ends those that have not begun.
void cancel_queued(Network& network);

// For send_processdata(): this thread runs the cycle. One thread writes, others read.
inline void note_cycle(RequestQueue& queue, Osal& osal, Time now) {
    const std::uint32_t tick = ticks(now) + 1;
    const std::uint32_t before = queue.cycle_ms.load(std::memory_order_relaxed);
    if (tick == before) return;
    queue.cycle_ms.store(tick, std::memory_order_relaxed);
    queue.cycle_gap_ms.store(before == 0 ? 0 : tick - before, std::memory_order_relaxed);
    queue.cycle_thread.store(osal.calling_thread(), std::memory_order_relaxed);
}

// Whether some thread has sent process data so lately that it will again.
[[nodiscard]] bool cycle_runs(Context& ctx);
// Whether that is this thread.
[[nodiscard]] bool is_cycle_thread(Context& ctx);

// Has the request in the list of those that run, as long as its sequence lives.
class RunningGuard {
  public:
    RunningGuard(RequestQueue& queue, MailRequest& request) : queue_(queue), request_(request) {
        QueueAccess::next(request) = queue.running;
        queue.running = &request;
    }
    RunningGuard(const RunningGuard&) = delete;
    RunningGuard& operator=(const RunningGuard&) = delete;
    ~RunningGuard() {
        MailRequest** at = &queue_.running;
        while (*at != nullptr && *at != &request_) at = &QueueAccess::next(**at);
        if (*at != nullptr) *at = QueueAccess::next(request_);
    }

  private:
    RequestQueue& queue_;
    MailRequest& request_;
};

template <class R>
Task<Result<>> drive_queued(Network& network, R& request) {
    RequestGuard guard(request);
    RunningGuard running(network.queue, request);
    auto result = co_await run(network, request);
    guard.done(result.error());
    co_return Result<>();
}

template <class R>
bool begin_queued(Context& ctx, R& request) {
    Network& network = *ContextAccess::network(ctx);
    const Error refused = check(network, request);
    if (refused.code != Errc::none) {
        RequestAccess::end(request, refused);
        return true;
    }
    Task<Result<>> task = drive_queued(network, request);
    if (!task) return false;
    RequestAccess::begin(request, task.address());
    (void)network.requests.start(
        std::move(task));  // takes what it needs of the arena before it waits for the first time
    return true;
}

template <class R>
Result<> submit_queued(Context& ctx, R& request) {
    if (const Error refused = check_init(ctx); refused.code != Errc::none) return refused;
    if (!RequestAccess::claim(request)) return Error{.code = Errc::busy, .slave = request.slave};
    enqueue(ctx, request, [](Context& c, MailRequest& r) { return begin_queued(c, static_cast<R&>(r)); });
    return Result<>();
}

}  // namespace margay
