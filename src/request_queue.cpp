#include "request_queue.hpp"

#include "osal/osal.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint32_t kCycleAliveMs = 10;
constexpr std::uint32_t kSlowestCycleMs = 1000;

std::uint32_t milliseconds(Time time) {
    return static_cast<std::uint32_t>(std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count());
}

// Takes all that was submitted, oldest first.
QueuedRequest* take_submitted(RequestQueue& queue) {
    QueuedRequest* newest = queue.submitted.exchange(nullptr, std::memory_order_acquire);
    QueuedRequest* oldest = nullptr;
    while (newest != nullptr) {
        QueuedRequest* const before = std::exchange(QueueAccess::next(*newest), oldest);
        oldest = std::exchange(newest, before);
    }
    return oldest;
}

void push(RequestQueue& queue, QueuedRequest& request) {
    QueuedRequest* head = queue.submitted.load(std::memory_order_relaxed);
    do {
        QueueAccess::next(request) = head;
    } while (!queue.submitted.compare_exchange_weak(head, &request, std::memory_order_release, std::memory_order_relaxed));
}

void cancel_asked(RequestQueue& queue) {
    if (!queue.cancel_asked.exchange(false, std::memory_order_acquire)) return;
    for (QueuedRequest* request = queue.running; request != nullptr;) {
        QueuedRequest* const next = QueueAccess::next(*request);
        if (QueueAccess::cancel_asked(*request)) request->cancel();
        request = next;
    }
}

}  // namespace

void enqueue(Context& ctx, QueuedRequest& request, void (*start)(Context& ctx, QueuedRequest& request)) {
    QueueAccess::prepare(request, ctx, start);
    RequestQueue& queue = ContextAccess::network(ctx)->queue;
    push(queue, request);
    Osal& osal = *ContextAccess::osal(ctx);
    if (queue.cycle_thread.load(std::memory_order_relaxed) != osal.calling_thread()) osal.wake();
}

void start_queued(Context& ctx) {
    RequestQueue& queue = ContextAccess::network(ctx)->queue;
    if (queue.submitted.load(std::memory_order_relaxed) != nullptr) {
        for (QueuedRequest* request = take_submitted(queue); request != nullptr;) {
            QueuedRequest* const next = QueueAccess::next(*request);  // beginning it may end it
            QueueAccess::start(*request);
            request = next;
        }
    }
    cancel_asked(queue);
}

// One that has not begun yet is picked out of the queue, the others go back in their order.
void QueuedRequest::cancel() {
    if (RequestAccess::started(*this)) return Request::cancel();
    if (!busy()) return;
    RequestQueue& queue = ContextAccess::network(*ctx_)->queue;
    for (QueuedRequest* request = take_submitted(queue); request != nullptr;) {
        QueuedRequest* const next = request->next_;
        if (request != this) push(queue, *request);
        request = next;
    }
    RequestAccess::end(*this, {.code = Errc::canceled});
}

void QueuedRequest::ask_cancel() {
    if (!busy()) return;
    cancel_asked_.store(true, std::memory_order_release);
    ContextAccess::network(*ctx_)->queue.cancel_asked.store(true, std::memory_order_release);
    ContextAccess::osal(*ctx_)->wake();
}

void note_cycle(Context& ctx) {
    RequestQueue& queue = ContextAccess::network(ctx)->queue;
    Osal& osal = *ContextAccess::osal(ctx);
    const std::uint32_t now = milliseconds(osal.now()) + 1;
    const std::uint32_t before = queue.cycle_ms.exchange(now, std::memory_order_relaxed);
    queue.cycle_gap_ms.store(before == 0 ? 0 : now - before, std::memory_order_relaxed);
    queue.cycle_thread.store(osal.calling_thread(), std::memory_order_relaxed);
}

bool cycle_runs(Context& ctx) {
    const RequestQueue& queue = ContextAccess::network(ctx)->queue;
    const std::uint32_t last = queue.cycle_ms.load(std::memory_order_relaxed);
    const std::uint32_t gap = std::min(queue.cycle_gap_ms.load(std::memory_order_relaxed), kSlowestCycleMs);
    const std::uint32_t now = milliseconds(ContextAccess::osal(ctx)->now()) + 1;
    return last != 0 && now - last <= std::max(kCycleAliveMs, 2 * gap);
}

bool is_cycle_thread(Context& ctx) {
    return ContextAccess::network(ctx)->queue.cycle_thread.load(std::memory_order_relaxed) == ContextAccess::osal(ctx)->calling_thread();
}

}  // namespace margay
