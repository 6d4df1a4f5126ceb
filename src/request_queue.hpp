// Requests that come from any thread: queued without a lock, begun by poll().
#pragma once

#include "requests.hpp"

namespace margay {

struct QueueAccess {
    static void prepare(QueuedRequest& r, Context& ctx, QueuedRequest::Start start) {
        r.ctx_ = &ctx;
        r.start_ = start;
        r.cancel_asked_.store(false, std::memory_order_relaxed);
    }
    static QueuedRequest*& next(QueuedRequest& r) { return r.next_; }
    static void start(QueuedRequest& r) { r.start_(*r.ctx_, r); }
    static bool cancel_asked(const QueuedRequest& r) { return r.cancel_asked_.load(std::memory_order_acquire); }
};

// Queues a request whose state is busy already.
void enqueue(Context& ctx, QueuedRequest& request, void (*start)(Context& ctx, QueuedRequest& request));

// For poll(): begins what was queued, in the order in which it came, and cancels what shall be.
void start_queued(Context& ctx);

// For send_processdata(): this thread runs the cycle.
void note_cycle(Context& ctx);

// Whether some thread has sent process data so lately that it will again.
[[nodiscard]] bool cycle_runs(Context& ctx);
// Whether that is this thread.
[[nodiscard]] bool is_cycle_thread(Context& ctx);

// The sequence of a queued request; takes it off the list of those that run.
class RunningGuard {
  public:
    RunningGuard(RequestQueue& queue, QueuedRequest& request) : queue_(queue), request_(request) {
        QueueAccess::next(request) = queue.running;
        queue.running = &request;
    }
    RunningGuard(const RunningGuard&) = delete;
    RunningGuard& operator=(const RunningGuard&) = delete;
    ~RunningGuard() {
        QueuedRequest** at = &queue_.running;
        while (*at != nullptr && *at != &request_) at = &QueueAccess::next(**at);
        if (*at != nullptr) *at = QueueAccess::next(request_);
    }

  private:
    RequestQueue& queue_;
    QueuedRequest& request_;
};

template <class R>
Task<Result<>> drive_queued(Network& network, R& request) {
    RequestGuard guard(request);
    RunningGuard running(network.queue, request);
    co_await network.engine.next_poll();
    auto result = co_await run(network, request);
    guard.done(result.error());
    co_return Result<>();
}

template <class R>
void begin_queued(Context& ctx, R& request) {
    Network& network = *ContextAccess::network(ctx);
    const Error refused = check(network, request);
    if (refused.code != Errc::none) return RequestAccess::end(request, refused);
    Task<Result<>> task = drive_queued(network, request);
    if (!task) return RequestAccess::end(request, {.code = Errc::capacity, .slave = request.slave});
    RequestAccess::begin(request, task.address());
    (void)network.requests.start(std::move(task));
}

template <class R>
Result<> submit_queued(Context& ctx, R& request) {
    if (const Error refused = check_init(ctx); refused.code != Errc::none) return refused;
    if (!RequestAccess::claim(request)) return Error{.code = Errc::busy, .slave = request.slave};
    enqueue(ctx, request, [](Context& c, QueuedRequest& r) { begin_queued(c, static_cast<R&>(r)); });
    return Result<>();
}

}  // namespace margay
