#include "api/queue.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/doubt.hpp"
#include "network/search.hpp"
#include "network/transition.hpp"
#include "util/turns.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace margay {
namespace {

// Free arena memory that a new request needs in order to continue after its beginning; includes the pump of the slave's
// mailbox.
constexpr std::size_t kHeadroomBytes = 1024 * sizeof(void*);
constexpr std::uint8_t kHighestPriority = 3;

const OperationDescription& operation(const Request& r) { return RequestAccess::operation(r); }
Request*& next(Request& r) { return RequestAccess::next(r); }
std::uint16_t slave_of(const Request& r) { return operation(r).slave(r); }
bool may_be_cut(const Request& r) { return operation(r).timing != Timing::by_sequence_alone; }

bool remove(Request*& list, Request& request) {
    for (Request** at = &list; *at != nullptr; at = &next(**at))
        if (*at == &request) {
            *at = next(request);
            return true;
        }
    return false;
}

// What the request reserves. A request for slave 0 reserves the whole segment. With a supervision, set_target()
// reserves nothing: it only stores the target, and the supervision brings the slave to it.
Needs needs_of(const Network& network, const Request& r) {
    if (operation(r).operation == Operation::set_target && network.supervised) return Needs::nothing;
    const Needs needs = operation(r).needs;
    return needs == Needs::its_slave && slave_of(r) == 0 ? Needs::segment : needs;
}

// Inserts the request into the list of waiting requests, in the order of submission.
void insert(RequestQueue& queue, Request& request) {
    Request** at = &queue.waiting;
    const auto older = [&](Request& other) {
        return static_cast<std::int32_t>(RequestAccess::ticket(other) - RequestAccess::ticket(request)) <= 0;
    };
    while (*at != nullptr && older(**at)) at = &next(**at);
    next(request) = *at;
    *at = &request;
}

void accept(RequestQueue& queue, Request& request, Time now) {
    if (request.timeout > Duration{0}) RequestAccess::deadline(request) = later(now, request.timeout);
    RequestAccess::accept(request);
    // cancel() may have been called before the request had its slot in the queue.
    if (RequestAccess::cancel_asked(request).load(std::memory_order_acquire))
        queue.cancel_asked.store(true, std::memory_order_release);
    insert(queue, request);
}

void accept_submitted(RequestQueue& queue, Time now) {
    if (!queue.any_submitted.exchange(false, std::memory_order_acquire)) return;
    for (auto& slot : queue.submitted)
        if (Request* request = slot.exchange(nullptr, std::memory_order_acq_rel)) accept(queue, *request, now);
}

// Whether at least one running request will end by itself and free its memory.
bool ends_some_day(const RequestQueue& queue) {
    for (Request* r = queue.running; r != nullptr; r = next(*r))
        if (operation(*r).ends == Ends::by_itself) return true;
    return false;
}

// Whether no running operation, and no task of the supervision, uses what this request needs.
bool is_free(Network& network, const Request& request) {
    switch (needs_of(network, request)) {
        case Needs::nothing: return true;
        case Needs::segment:
            return !network.segment_in_use && !network.searching && !network.any_slave_in_use() &&
                   !network.is_turn_of_supervision();
        case Needs::segment_to_begin: return !network.segment_in_use;
        case Needs::its_slave: {
            const std::uint16_t slave = slave_of(request);
            return !network.segment_in_use && (slave < 1 || slave > network.count || !network.marks(slave).in_use);
        }
    }
    return true;
}

// Whether the supervision is about to compare the slave, which may be another one after a pause of the application.
bool is_being_compared(Network& network, const Request& request) {
    return network.supervised && network.engine.now() < network.comparing_until &&
           operation(request).check(network, request).code == Errc::identity_unread;
}

// Calls `visit` for each waiting request that can begin, the oldest first, until `visit` returns false. A request that
// waits for the whole segment holds back younger requests for a part of the segment. Otherwise it might never begin.
template <class Visit>
void for_each_ready(Master& master, Visit visit) {
    bool segment_wanted = false;
    for (Request* r = master.queue.waiting; r != nullptr; r = next(*r)) {
        const Needs needs = needs_of(master.network, *r);
        const bool ready = is_free(master.network, *r) && !(segment_wanted && needs != Needs::nothing) &&
                           !is_being_compared(master.network, *r);
        segment_wanted |= needs == Needs::segment && !ready;
        if (ready && !visit(*r)) return;
    }
}

// Whether a request waits for the whole segment: the supervision then begins nothing that would use a part of it.
bool is_segment_wanted(Master& master) {
    for (Request* r = master.queue.waiting; r != nullptr; r = next(*r))
        if (needs_of(master.network, *r) == Needs::segment) return true;
    return false;
}

// The supervision executes a round before the next request uses the segment.
void give_turn(Network& network) {
    network.supervision_turn = true;
    if (network.supervision_sleep == nullptr) return;
    network.engine.wake(*network.supervision_sleep);
    network.supervision_sleep = nullptr;
}

// While a request waits for the segment, the supervision begins nothing. But the request may wait for a long time, for
// a hook or for the SII of one slave, and the hook may wait for a slave that the supervision has not started yet: so
// the supervision gets turns. The time until the next turn doubles, so that it becomes longer than every start-up of a
// slave: then the request begins.
void reserve_segment(Master& master, Time now) {
    constexpr Duration kFirst = std::chrono::seconds(1);
    RequestQueue& queue = master.queue;
    Network& network = master.network;
    const bool wanted = is_segment_wanted(master);
    const bool first = wanted && !network.segment_wanted;
    network.segment_wanted = wanted;
    if (!first && now < queue.turn_at) return;
    if (wanted && !first) give_turn(network);
    queue.turn_after = first ? kFirst : std::min<Duration>(queue.turn_after * 2, 64 * kFirst);
    queue.turn_at = later(now, queue.turn_after);
}

// The request that begins next; nullptr: none can begin.
Request* next_to_begin(Master& master) {
    NextTurn<Request> rule;
    for_each_ready(master, [&rule](Request& r) {
        rule.offer(r, r.priority, RequestAccess::passed(r));
        return true;
    });
    return rule.next();
}

// Counts the older requests that could also begin, and that are passed over.
void count_passed(Master& master, const Request& chosen) {
    for_each_ready(master, [&chosen](Request& r) {
        if (&r == &chosen) return false;
        ++RequestAccess::passed(r);
        return true;
    });
}

// Keeps the request in the list of running requests, and reserves what it needs, as long as its sequence exists.
class Running {
  public:
    Running(Master& master, Request& request)
        : master_(master), request_(request), needs_(needs_of(master.network, request)) {
        next(request) = master.queue.running;
        master.queue.running = &request;
        if (needs_ == Needs::segment) master.network.segment_in_use = true;
        if (needs_ == Needs::its_slave) token_.emplace(master.network.marks(slave_of(request)));
    }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;
    ~Running() {
        (void)remove(master_.queue.running, request_);
        token_.reset();
        if (needs_ == Needs::segment) {
            master_.network.segment_in_use = false;
            give_turn(master_.network);
        }
        if (error_.code == Errc::canceled && error_.step == Step::none) end_by_cut();
        if (operation(request_).operation == Operation::supervise) master_.network.supervision_error = error_;
        RequestAccess::end(request_, error_, master_.osal);
    }
    void done(const Error& error) {
        error_ = error;
        if (error_.code == Errc::capacity && error_.step == Step::none) name_starved();
    }

  private:
    // There was no memory for a task. Its error contains neither the step nor the slave, so they are added here.
    void name_starved() {
        error_.step = operation(request_).step;
        error_.detail = Error::kTasks;
        if (error_.slave == 0) error_.slave = slave_of(request_);
    }
    // The sequence of the request was destroyed. If it waited for a hook when its time was over, the hook is the cause.
    void end_by_cut() {
        const Errc why = RequestAccess::why(request_);
        const std::uint16_t hooked = master_.network.slave_of_cut_hook;
        const bool waits_for_it = operation(request_).ends == Ends::by_itself;
        error_ = {.code = why, .step = operation(request_).step, .slave = slave_of(request_)};
        if (why != Errc::timeout || !waits_for_it || hooked == 0) return;
        error_.step = Step::application_hook;
        error_.slave = hooked;
        master_.network.note(master_.network.slave(hooked), error_);
    }

    Master& master_;
    Request& request_;
    Needs needs_;
    std::optional<SlaveToken> token_;
    Error error_{.code = Errc::canceled};
};

Task<Result<>> drive(Master& master, Request& request) {
    Running running(master, request);
    auto result = co_await operation(request).sequence(master.network, request);
    running.done(result.error());
    co_return Nothing{};
}

// Ends a request that has not begun. The end of a supervision is an event, also if no poll() has begun it.
void end_unbegun(Master& master, Request& request, const Error& error) {
    Network& network = master.network;
    if (operation(request).operation == Operation::supervise && !network.reaching && !network.supervised) {
        network.supervision_error = error;
        network.supervision_ended = true;
    }
    RequestAccess::end(request, error, master.osal);
}

Error unbegun(const Request& request, Errc code) {
    return {.code = code, .step = operation(request).step, .slave = slave_of(request)};
}

// The operation that keeps the waiting request from beginning; Operation::none: it is not known, or memory is missing.
Operation in_the_way(Master& master, const Request& waiting) {
    Network& network = master.network;
    const Needs needed = needs_of(network, waiting);
    if (needed == Needs::nothing) return Operation::none;
    const bool free = is_free(network, waiting);  // if free, an older request may wait for the whole segment
    for (Request* r = free ? master.queue.waiting : master.queue.running; r != nullptr && r != &waiting; r = next(*r)) {
        const Needs needs = needs_of(network, *r);
        const bool part = needs == Needs::its_slave && (needed == Needs::segment || slave_of(*r) == slave_of(waiting));
        if (free ? needs == Needs::segment && !is_free(network, *r) : needs == Needs::segment || part)
            return operation(*r).operation;
    }
    return (free ? is_being_compared(network, waiting) : network.supervised) ? Operation::supervise : Operation::none;
}

// Begins the request. False: the arena has no memory for it now.
bool begin(Master& master, Request& request) {
    Error refused = operation(request).check(master.network, request);
    if (RequestAccess::cancel_asked(request).load(std::memory_order_acquire))
        refused = unbegun(request, Errc::canceled);
    if (refused.code != Errc::none) {
        end_unbegun(master, request, refused);
        return true;
    }
    const TaskReference task = drive(master, request);
    if (!task) return false;
    note_lost_wishes(request);
    RequestAccess::sequence(request) = task;
    (void)master.network.requests.start(task);
    return true;
}

// Ends the requests of a list for which `ends` returns true.
void end_some(Master& master, Request*& list, Errc code, bool (*ends)(Request& request, Time now), Time now) {
    for (Request* request = list; request != nullptr;) {
        Request* const after = next(*request);
        if (ends(*request, now)) {
            RequestAccess::why(*request) = code;
            if (RequestAccess::sequence(*request)) {
                master.network.slave_of_cut_hook = 0;
                TaskAccess::end(std::exchange(RequestAccess::sequence(*request), {}));
            } else {
                Error error = unbegun(*request, code);
                if (code == Errc::timeout)
                    error.detail = Error::kNotBegun + static_cast<std::uint32_t>(in_the_way(master, *request));
                (void)remove(list, *request);
                end_unbegun(master, *request, error);
            }
        }
        request = after;
    }
}

bool is_cancel_asked(Request& request, Time) {
    return RequestAccess::cancel_asked(request).load(std::memory_order_acquire);
}

// The time at which the queue ends this running request.
Time end_by_queue(Request& request) {
    // The sequence can report a more precise error, so it ends first. If the sequence waits for something without a
    // timeout, for example for a hook, the queue ends the request.
    constexpr Duration kSequenceFirst = std::chrono::milliseconds(250);
    switch (operation(request).timing) {
        case Timing::by_queue: return RequestAccess::deadline(request);
        case Timing::by_sequence: return later(RequestAccess::deadline(request), kSequenceFirst);
        case Timing::by_sequence_alone: break;
    }
    return kNever;
}

// The time at which a work must end, because a waiting request needs its slave; kNever: no request needs it.
Time end_of_work(Master& master, const SlaveWork& work) {
    for (Request* r = master.queue.waiting; r != nullptr; r = next(*r)) {
        const Needs needs = needs_of(master.network, *r);
        if (needs == Needs::segment || (needs == Needs::its_slave && slave_of(*r) == work.slave))
            return later(work.since, SlaveWork::kLongest);
    }
    return kNever;
}

// Ends the works whose time is over. Returns the time at which the next work must end.
Time end_works(Master& master, Time now) {
    Network& network = master.network;
    Time first = kNever;
    for (SlaveWork* work = network.works.front(); work != nullptr;) {
        SlaveWork* const after = network.works.after(*work);
        const Time end = end_of_work(master, *work);
        if (end <= now)
            end_work(network, *work);
        else
            first = std::min(first, end);
        work = after;
    }
    return first;
}

// The earliest time at which the queue must end a request.
Time first_deadline(Master& master, Time first) {
    const RequestQueue& queue = master.queue;
    const Time compared = master.network.comparing_until;
    if (queue.waiting != nullptr && master.network.engine.now() < compared) first = std::min(first, compared);
    for (Request* r = queue.waiting; r != nullptr; r = next(*r)) first = std::min(first, RequestAccess::deadline(*r));
    for (Request* r = queue.running; r != nullptr; r = next(*r)) first = std::min(first, end_by_queue(*r));
    return first;
}

// Whether to try another request: the arena has room for it, or no running request will free memory.
bool may_have_room(const RequestQueue& queue, const Arena& arena) {
    if (!ends_some_day(queue)) return true;
    return arena.used_bytes() < queue.too_full_bytes && arena.capacity_bytes() - arena.used_bytes() >= kHeadroomBytes;
}

void begin_waiting(Master& master) {
    RequestQueue& queue = master.queue;
    const Arena& arena = master.network.arena();
    queue.too_full_bytes = arena.capacity_bytes();
    while (Request* request = next_to_begin(master)) {
        if (!may_have_room(queue, arena)) return;
        count_passed(master, *request);
        (void)remove(queue.waiting, *request);
        if (begin(master, *request)) continue;
        if (ends_some_day(queue)) {
            queue.too_full_bytes = arena.used_bytes();
            insert(queue, *request);
            return;
        }
        Error error = unbegun(*request, Errc::capacity);
        error.detail = Error::kTasks;
        error.expected = static_cast<std::uint32_t>(kHeadroomBytes);
        error.actual = static_cast<std::uint32_t>(arena.capacity_bytes() - arena.used_bytes());
        end_unbegun(master, *request, error);
    }
}

}  // namespace

bool enqueue(Master& master, Request& request) {
    RequestQueue& queue = master.queue;
    RequestAccess::ticket(request) = queue.tickets.fetch_add(1, std::memory_order_relaxed);
    if (master.owned_by_caller()) {
        accept(queue, request, master.in_poll ? master.network.engine.now() : master.osal.now());
        return true;
    }
    for (auto& slot : queue.submitted) {
        Request* free = nullptr;
        if (!slot.compare_exchange_strong(free, &request, std::memory_order_acq_rel)) continue;
        queue.any_submitted.store(true, std::memory_order_release);
        master.osal.wake();
        return true;
    }
    return false;
}

bool withdraw_submitted(RequestQueue& queue, Request& request) {
    for (auto& slot : queue.submitted) {
        Request* it = &request;
        if (slot.compare_exchange_strong(it, nullptr, std::memory_order_acq_rel)) return true;
    }
    return false;
}

Time serve_queue(Master& master, Time now) {
    RequestQueue& queue = master.queue;
    if (master.network.silence_noted) (void)doubt_after_silence(master.network);
    accept_submitted(queue, now);
    if (queue.cancel_asked.exchange(false, std::memory_order_acquire)) {
        end_some(master, queue.waiting, Errc::canceled, is_cancel_asked, now);
        const auto cut = [](Request& r, Time at) { return is_cancel_asked(r, at) && may_be_cut(r); };
        end_some(master, queue.running, Errc::canceled, cut, now);
    }
    end_some(
        master, queue.running, Errc::timeout, [](Request& r, Time at) { return end_by_queue(r) <= at; }, now);
    Time end_of_first_work = kNever;
    if (queue.waiting != nullptr) {
        end_of_first_work = end_works(master, now);
        begin_waiting(master);
        const auto late = [](Request& r, Time at) { return RequestAccess::deadline(r) <= at; };
        end_some(master, queue.waiting, Errc::timeout, late, now);
    }
    reserve_segment(master, now);
    return first_deadline(master, end_of_first_work);
}

bool begins_at_once(Master& master) {
    const RequestQueue& queue = master.queue;
    if (queue.any_submitted.load(std::memory_order_relaxed) || queue.cancel_asked.load(std::memory_order_relaxed))
        return true;
    return queue.waiting != nullptr && may_have_room(queue, master.network.arena()) && next_to_begin(master) != nullptr;
}

void cancel_queued(Master& master) {
    accept_submitted(master.queue, Time{});
    end_some(
        master, master.queue.waiting, Errc::canceled, [](Request&, Time) { return true; }, Time{});
}

// ------------------------------------------------------------------ submit and cancel

Result<> submit(Context& ctx, Request& request) {
    Master* master = master_of(ctx);
    const OperationDescription& wanted = operation(request);
    if (master == nullptr) return Error{.code = Errc::wrong_state, .step = wanted.step};
    if (!RequestAccess::claim(request, ctx))
        return Error{.code = Errc::busy, .step = wanted.step, .detail = static_cast<std::uint32_t>(wanted.operation)};
    Error refused;
    if (request.priority > kHighestPriority)
        refused = invalid(Argument::priority, wanted.step);
    else if (request.timeout < Duration{0})
        refused = invalid(Argument::timeout, wanted.step);
    else if (master->owned_by_caller())
        refused = is_being_compared(master->network, request) ? Error{} : wanted.check(master->network, request);
    if (refused.code == Errc::none) {
        if (enqueue(*master, request)) return Result<>();
        refused = {.code = Errc::capacity, .step = wanted.step, .detail = Error::kPlaces};
        refused.expected = RequestQueue::kPlaces + 1;
        refused.actual = RequestQueue::kPlaces;
    }
    RequestAccess::end(request, refused, master->osal);
    return refused;
}

// Ends a sequence outside poll(). For the callbacks of its events, the same calls are forbidden as in poll().
static void destroy_sequence(Master& master, TaskReference sequence) {
    master.in_poll = true;
    TaskAccess::end(sequence);
    master.in_poll = false;
}

void Request::cancel() {
    std::uint32_t state = state_.load(std::memory_order_acquire);
    while ((state & kPreparing) != 0) state = state_.load(std::memory_order_acquire);  // a few instructions of submit()
    if (plain(state) != RequestState::busy) return;
    Master& master = *master_of(*ctx_);
    const bool owner = master.owned_by_caller();
    if (owner && !master.in_poll && sequence_ && may_be_cut(*this))
        return destroy_sequence(master, std::exchange(sequence_, {}));
    const Error canceled = unbegun(*this, Errc::canceled);
    if (owner && remove(master.queue.waiting, *this)) return end_unbegun(master, *this, canceled);
    // The end of a supervision is an event, so only the owner ends a supervision.
    const bool by_owner = operation(*this).operation == Operation::supervise;
    if ((owner || !by_owner) && withdraw_submitted(master.queue, *this)) {
        if (by_owner) return end_unbegun(master, *this, canceled);
        return RequestAccess::end(*this, canceled, master.osal);
    }
    cancel_asked_.store(true, std::memory_order_release);
    master.queue.cancel_asked.store(true, std::memory_order_release);
    master.osal.wake();
}

Request::~Request() {
    if (!busy()) return;
    cancel();
    if (!busy()) return;
    Master& master = *master_of(*ctx_);
    if (master.owned_by_caller()) {
        if (master.in_poll) __builtin_trap();  // called in a callback: the sequence still uses the request
        destroy_sequence(master, std::exchange(sequence_, {}));
    }
    while (busy()) RequestAccess::sleep(*this, master.osal, kNever);
}

}  // namespace margay
