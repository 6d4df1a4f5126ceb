#include "request_queue.hpp"

#include "osal/osal.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint32_t kCycleAliveMs = 10;
constexpr std::uint32_t kSlowestCycleMs = 1000;

// What a request needs to get on once it has begun, and the pump of its slave.
constexpr std::size_t kHeadroomBytes = 1024 * sizeof(void*);

void append(MailRequest*& list, MailRequest& request) {
    MailRequest** at = &list;
    while (*at != nullptr) at = &QueueAccess::next(**at);
    *at = &request;
    QueueAccess::next(request) = nullptr;
}

// Moves what was submitted, oldest first, behind what waits.
void take_submitted(RequestQueue& queue, Time now) {
    MailRequest* newest = queue.submitted.exchange(nullptr, std::memory_order_acquire);
    MailRequest* oldest = nullptr;
    while (newest != nullptr) {
        MailRequest* const before = std::exchange(QueueAccess::next(*newest), oldest);
        oldest = std::exchange(newest, before);
    }
    while (oldest != nullptr) {
        MailRequest& request = *std::exchange(oldest, QueueAccess::next(*oldest));
        QueueAccess::deadline(request) = request.timeout > Duration{0} ? now + request.timeout : kNever;
        append(queue.waiting, request);
    }
}

bool remove(MailRequest*& list, MailRequest& request) {
    for (MailRequest** at = &list; *at != nullptr; at = &QueueAccess::next(**at))
        if (*at == &request) {
            *at = QueueAccess::next(request);
            return true;
        }
    return false;
}

// The highest priority, of equals the oldest; but one that was passed over often.
MailRequest* next_of(MailRequest* list) {
    constexpr std::uint8_t kMostPassed = 8;
    MailRequest* best = nullptr;
    for (MailRequest* r = list; r != nullptr; r = QueueAccess::next(*r)) {
        if (QueueAccess::passed(*r) >= kMostPassed) return r;
        if (best == nullptr || r->priority > best->priority) best = r;
    }
    return best;
}

// Those whose time is over before they could begin, and those that shall not go on.
template <class Ends>
void end_some(MailRequest*& list, Errc code, Ends ends) {
    for (MailRequest* request = list; request != nullptr;) {
        MailRequest* const next = QueueAccess::next(*request);
        if (ends(*request)) {
            if (RequestAccess::started(*request)) {
                request->cancel();
            } else {
                (void)remove(list, *request);
                RequestAccess::end(*request, {.code = code, .slave = request->slave});
            }
        }
        request = next;
    }
}

}  // namespace

void enqueue(Context& ctx, MailRequest& request, bool (*start)(Context& ctx, MailRequest& request)) {
    QueueAccess::prepare(request, ctx, start);
    RequestQueue& queue = ContextAccess::network(ctx)->queue;
    MailRequest* head = queue.submitted.load(std::memory_order_relaxed);
    do {
        QueueAccess::next(request) = head;
    } while (
        !queue.submitted.compare_exchange_weak(head, &request, std::memory_order_release, std::memory_order_relaxed));
    Osal& osal = *ContextAccess::osal(ctx);
    if (queue.cycle_thread.load(std::memory_order_relaxed) != osal.calling_thread()) osal.wake();
}

void start_queued(Context& ctx, Time now) {
    Network& network = *ContextAccess::network(ctx);
    RequestQueue& queue = network.queue;
    network.engine.set_now(now);
    if (queue.submitted.load(std::memory_order_relaxed) != nullptr) take_submitted(queue, now);
    if (queue.cancel_asked.exchange(false, std::memory_order_acquire)) {
        end_some(queue.waiting, Errc::canceled, QueueAccess::cancel_asked);
        end_some(queue.running, Errc::canceled, QueueAccess::cancel_asked);
    }
    if (queue.waiting == nullptr) return;
    const Arena& arena = network.arena();
    while (MailRequest* request = next_of(queue.waiting)) {
        const bool room = arena.capacity_bytes() - arena.used_bytes() >= kHeadroomBytes;
        if (!room && queue.running != nullptr) break;
        (void)remove(queue.waiting, *request);
        // Older ones were passed over. Counted only when it begins: one that there is no room for stays where it is.
        for (MailRequest* r = queue.waiting; r != nullptr; r = QueueAccess::next(*r))
            if (r->priority < request->priority) ++QueueAccess::passed(*r);
        if (QueueAccess::start(*request)) continue;
        if (queue.running == nullptr) {  // nobody will make room
            RequestAccess::end(*request, {.code = Errc::capacity, .slave = request->slave});
            continue;
        }
        QueueAccess::next(*request) = queue.waiting;
        queue.waiting = request;
        break;
    }
    end_some(queue.waiting, Errc::timeout, [now](MailRequest& r) { return QueueAccess::deadline(r) <= now; });
}

void cancel_queued(Network& network) {
    take_submitted(network.queue, Time::min());
    end_some(network.queue.waiting, Errc::canceled, [](MailRequest&) { return true; });
}

// One that has not begun yet is taken off its list.
void MailRequest::cancel() {
    if (RequestAccess::started(*this)) return Request::cancel();
    if (!busy()) return;
    RequestQueue& queue = ContextAccess::network(*ctx_)->queue;
    take_submitted(queue, Time::min());
    (void)remove(queue.waiting, *this);
    RequestAccess::end(*this, {.code = Errc::canceled});
}

void MailRequest::ask_cancel() {
    if (!busy()) return;
    cancel_asked_.store(true, std::memory_order_release);
    ContextAccess::network(*ctx_)->queue.cancel_asked.store(true, std::memory_order_release);
    ContextAccess::osal(*ctx_)->wake();
}

bool cycle_runs(Context& ctx) {
    const RequestQueue& queue = ContextAccess::network(ctx)->queue;
    const std::uint32_t last = queue.cycle_ms.load(std::memory_order_relaxed);
    const std::uint32_t gap = std::min(queue.cycle_gap_ms.load(std::memory_order_relaxed), kSlowestCycleMs);
    const std::uint32_t now = ticks(ContextAccess::osal(ctx)->now()) + 1;
    return last != 0 && now - last <= std::max(kCycleAliveMs, 2 * gap);
}

bool is_cycle_thread(Context& ctx) {
    return ContextAccess::network(ctx)->queue.cycle_thread.load(std::memory_order_relaxed) ==
           ContextAccess::osal(ctx)->calling_thread();
}

}  // namespace margay
