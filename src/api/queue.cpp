#include "api/queue.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <algorithm>
#include <utility>

namespace margay {

// ------------------------------------------------------------------ the state of a request

bool RequestAccess::claim(Request& r, Context& ctx) {
    constexpr auto kBusy = static_cast<std::uint32_t>(RequestState::busy);
    std::uint32_t state = r.state_.load(std::memory_order_relaxed);
    do {
        if (Request::plain(state) == RequestState::busy) return false;
    } while (!r.state_.compare_exchange_weak(state, kBusy, std::memory_order_acq_rel));
    r.ctx_ = &ctx;
    r.error_ = {};
    r.passed_ = 0;
    r.sequence_ = {};
    r.cancel_asked_.store(false, std::memory_order_relaxed);
    return true;
}

void RequestAccess::end(Request& r, const Error& error, Osal& osal) {
    r.sequence_ = {};
    r.error_ = error;
    const RequestState state = error.code == Errc::none ? RequestState::success : RequestState::error;
    const std::uint32_t before = r.state_.exchange(static_cast<std::uint32_t>(state), std::memory_order_acq_rel);
    // Only the address of the word is used: a thread that has seen the end may have destroyed the request.
    if ((before & Request::kAwaited) != 0) osal.wake_sleepers(&r.state_);
}

void RequestAccess::sleep(Request& r, Osal& osal, Time until) {
    std::uint32_t state = r.state_.load(std::memory_order_acquire);
    if (Request::plain(state) != RequestState::busy) return;
    const std::uint32_t awaited = state | Request::kAwaited;
    if (state != awaited && !r.state_.compare_exchange_strong(state, awaited, std::memory_order_acq_rel)) return;
    osal.sleep_while(r.state_, awaited, until);
}

namespace {

// What a request needs to get on once it has begun, and the pump of the mailbox of its slave.
constexpr std::size_t kHeadroomBytes = 1024 * sizeof(void*);
constexpr std::uint8_t kMostPassed = 8;

const OperationDescription& operation(const Request& r) { return RequestAccess::operation(r); }
Request*& next(Request& r) { return RequestAccess::next(r); }
std::uint16_t slave_of(const Request& r) { return static_cast<const SlaveRequest&>(r).slave; }

void append(Request*& list, Request& request) {
    Request** at = &list;
    while (*at != nullptr) at = &next(**at);
    *at = &request;
    next(request) = nullptr;
}

bool remove(Request*& list, Request& request) {
    for (Request** at = &list; *at != nullptr; at = &next(**at))
        if (*at == &request) {
            *at = next(request);
            return true;
        }
    return false;
}

void push_submitted(RequestQueue& queue, Request& request) {
    Request* head = queue.submitted.load(std::memory_order_relaxed);
    do {
        next(request) = head;
    } while (
        !queue.submitted.compare_exchange_weak(head, &request, std::memory_order_release, std::memory_order_relaxed));
}

// All that was submitted, oldest first.
Request* pop_submitted(RequestQueue& queue) {
    Request* newest = queue.submitted.exchange(nullptr, std::memory_order_acquire);
    Request* oldest = nullptr;
    while (newest != nullptr) {
        Request* const before = std::exchange(next(*newest), oldest);
        oldest = std::exchange(newest, before);
    }
    return oldest;
}

void take_submitted(RequestQueue& queue, Time now) {
    for (Request* request = pop_submitted(queue); request != nullptr;) {
        Request& taken = *std::exchange(request, next(*request));
        RequestAccess::deadline(taken) = taken.timeout > Duration{0} ? now + taken.timeout : kNever;
        append(queue.waiting, taken);
    }
}

template <class Holds>
bool any_running(const RequestQueue& queue, Holds holds) {
    for (Request* r = queue.running; r != nullptr; r = next(*r))
        if (holds(*r)) return true;
    return false;
}

// A request that is over some day, so that its memory comes free.
bool ends_some_day(const RequestQueue& queue) {
    return any_running(queue, [](const Request& r) { return operation(r).ends == Ends::by_itself; });
}

// Whether no running operation uses what this request needs.
bool is_free(Master& master, const Request& request) {
    const RequestQueue& queue = master.queue;
    const auto needs_segment = [](const Request& r) { return operation(r).needs == Needs::segment; };
    switch (operation(request).needs) {
        case Needs::nothing: return true;
        case Needs::segment:
            return !any_running(queue, [](const Request& r) { return operation(r).needs != Needs::nothing; });
        case Needs::its_slave: {
            const std::uint16_t slave = slave_of(request);
            if (slave >= 1 && slave <= master.network.count && master.network.slave(slave).recovering) return false;
            return !any_running(queue, needs_segment);
        }
    }
    return true;
}

// The request that is to begin next: the highest priority, of equals the oldest; but first a request that was passed
// over often. nullptr: none can begin. A request that waits for the whole segment keeps back the younger requests that
// would take a part of it again and again.
Request* next_to_begin(Master& master) {
    Request* best = nullptr;
    bool segment_wanted = false;
    for (Request* r = master.queue.waiting; r != nullptr; r = next(*r)) {
        const Needs needs = operation(*r).needs;
        const bool free = is_free(master, *r) && !(segment_wanted && needs != Needs::nothing);
        segment_wanted |= needs == Needs::segment;
        if (!free) continue;
        if (RequestAccess::passed(*r) >= kMostPassed) return r;
        if (best == nullptr || r->priority > best->priority) best = r;
    }
    return best;
}

// Has the request in the list of the running ones, and what it needs for itself, as long as its sequence lives.
class Running {
  public:
    Running(Master& master, Request& request) : master_(master), request_(request) {
        next(request) = master.queue.running;
        master.queue.running = &request;
        mark_slave(true);
    }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;
    ~Running() {
        (void)remove(master_.queue.running, request_);
        mark_slave(false);
        RequestAccess::end(request_, error_, master_.osal);
    }
    void done(const Error& error) { error_ = error; }

  private:
    void mark_slave(bool used) {
        if (operation(request_).needs == Needs::its_slave) master_.network.slave(slave_of(request_)).recovering = used;
    }
    Master& master_;
    Request& request_;
    Error error_{.code = Errc::canceled};
};

Task<Result<>> drive(Master& master, Request& request) {
    Running running(master, request);
    auto result = co_await operation(request).sequence(master.network, request);
    running.done(result.error());
    co_return Result<>();
}

// False: there is no room for the request now.
bool begin(Master& master, Request& request) {
    const Error refused = operation(request).check(master.network, request);
    if (refused.code != Errc::none) {
        RequestAccess::end(request, refused, master.osal);
        return true;
    }
    Task<Result<>> task = drive(master, request);
    if (!task) return false;
    RequestAccess::sequence(request) = task.handle();
    (void)master.network.requests.start(std::move(task));
    return true;
}

// Ends the requests of a list for which `ends` holds.
template <class Ends>
void end_some(Master& master, Request*& list, Errc code, Ends ends) {
    for (Request* request = list; request != nullptr;) {
        Request* const after = next(*request);
        if (ends(*request)) {
            if (RequestAccess::sequence(*request)) {
                RequestAccess::sequence(*request).destroy();
            } else {
                (void)remove(list, *request);
                RequestAccess::end(*request, {.code = code, .step = operation(*request).step}, master.osal);
            }
        }
        request = after;
    }
}

void begin_waiting(Master& master) {
    RequestQueue& queue = master.queue;
    const Arena& arena = master.network.arena();
    while (Request* request = next_to_begin(master)) {
        const bool room = arena.capacity_bytes() - arena.used_bytes() >= kHeadroomBytes;
        const bool room_comes = ends_some_day(queue);
        if (!room && room_comes) return;
        (void)remove(queue.waiting, *request);
        // Counted only when the request begins: a request that there is no room for keeps its place.
        for (Request* r = queue.waiting; r != nullptr; r = next(*r))
            if (r->priority < request->priority) ++RequestAccess::passed(*r);
        if (begin(master, *request)) continue;
        if (room_comes) {
            next(*request) = queue.waiting;
            queue.waiting = request;
            return;
        }
        Error error{.code = Errc::capacity, .step = operation(*request).step};
        error.expected = static_cast<std::uint32_t>(kHeadroomBytes);
        error.actual = static_cast<std::uint32_t>(arena.capacity_bytes() - arena.used_bytes());
        RequestAccess::end(*request, error, master.osal);
    }
}

}  // namespace

void enqueue(Master& master, Request& request) {
    push_submitted(master.queue, request);
    if (!master.owned_by_caller()) master.osal.wake();
}

bool withdraw_submitted(RequestQueue& queue, Request& request) {
    bool found = false;
    for (Request* at = pop_submitted(queue); at != nullptr;) {
        Request& one = *std::exchange(at, next(*at));
        if (&one == &request)
            found = true;
        else
            push_submitted(queue, one);
    }
    return found;
}

Time serve_queue(Master& master, Time now) {
    RequestQueue& queue = master.queue;
    if (queue.submitted.load(std::memory_order_relaxed) != nullptr) take_submitted(queue, now);
    if (queue.cancel_asked.exchange(false, std::memory_order_acquire)) {
        const auto asked = [](Request& r) { return RequestAccess::cancel_asked(r).load(std::memory_order_acquire); };
        end_some(master, queue.waiting, Errc::canceled, asked);
        end_some(master, queue.running, Errc::canceled, asked);
    }
    if (queue.waiting == nullptr) return kNever;
    begin_waiting(master);
    end_some(master, queue.waiting, Errc::timeout, [now](Request& r) { return RequestAccess::deadline(r) <= now; });
    Time soonest = kNever;
    for (Request* r = queue.waiting; r != nullptr; r = next(*r))
        soonest = std::min(soonest, RequestAccess::deadline(*r));
    return soonest;
}

void cancel_queued(Master& master) {
    take_submitted(master.queue, Time{});
    end_some(master, master.queue.waiting, Errc::canceled, [](Request&) { return true; });
}

// ------------------------------------------------------------------ submit and cancel

Result<> submit(Context& ctx, Request& request) {
    Master* master = master_of(ctx);
    const OperationDescription& wanted = operation(request);
    if (master == nullptr) return Error{.code = Errc::wrong_state, .step = wanted.step};
    if (!RequestAccess::claim(request, ctx)) return Error{.code = Errc::busy, .step = wanted.step};
    if (master->owned_by_caller()) {
        const Error refused = wanted.check(master->network, request);
        if (refused.code != Errc::none) {
            RequestAccess::end(request, refused, master->osal);
            return refused;
        }
    }
    enqueue(*master, request);
    return Result<>();
}

void Request::cancel() {
    if (!busy()) return;
    Master& master = *master_of(*ctx_);
    const bool at_once = master.owned_by_caller() && !master.in_poll;
    if (at_once && sequence_) return sequence_.destroy();
    if (withdraw_submitted(master.queue, *this) || (at_once && remove(master.queue.waiting, *this)))
        return RequestAccess::end(*this, {.code = Errc::canceled, .step = operation_->step}, master.osal);
    cancel_asked_.store(true, std::memory_order_release);
    master.queue.cancel_asked.store(true, std::memory_order_release);
    master.osal.wake();
}

Request::~Request() {
    if (!busy()) return;
    cancel();
    if (!busy()) return;
    Master& master = *master_of(*ctx_);
    if (master.owned_by_caller()) __builtin_trap();  // in a callback: the sequence still uses the request
    while (busy()) RequestAccess::sleep(*this, master.osal, kNever);
}

}  // namespace margay
