// Waiting for requests; poll(); and the owner thread of a context.
#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/coincidence.hpp"
#include "network/doubt.hpp"
#include "network/search.hpp"

#include <margay/margay.hpp>

#include <algorithm>
#include <utility>

namespace margay {
namespace {

// How long requests wait for the supervision to compare their slave.
constexpr Duration kPatience = std::chrono::milliseconds(300);
// How long another thread waits until the owner accepts its request.
constexpr Duration kOwnerSilent = std::chrono::seconds(3);

// The error if the calling thread may not wait; code none: it may wait.
Error check_may_wait(const Master& master, Step step) {
    if (!master.owned_by_caller()) return {};
    if (master.in_poll) return {.code = Errc::in_callback, .step = step};
    if (!master.owner_may_wait) return {.code = Errc::waiting_forbidden, .step = step};
    return {};
}

void poll_until_over(Context& ctx, Master& master, Request& request) {
    const WaitHandles handle = master.network.engine.link().nic().wait_handles();
    Osal& osal = master.osal;
    while (request.busy()) {
        if (!master.owned_by_caller()) {  // another thread has taken the context during this call: it ends the request
            RequestAccess::sleep(request, osal, kNever);
            continue;
        }
        const Time next = poll(ctx, osal.now());
        if (request.busy() && master.owned_by_caller()) osal.wait(next, handle);
    }
}

// Gives the supervision time to compare a slave in doubt after a pause of the application. Otherwise a call that waits
// would be refused because of this doubt.
void let_supervision_compare(Context& ctx, Master& master, Request& request) {
    Network& network = master.network;
    Osal& osal = master.osal;
    const auto refused = [&] {
        return RequestAccess::operation(request).check(network, request).code == Errc::identity_unread;
    };
    const Time end = later(osal.now(), kPatience);
    while (network.supervised && master.owned_by_caller()) {
        const Time next = poll(ctx, osal.now());
        if (!refused() || osal.now() >= end) return;
        osal.wait(std::min(next, end), network.engine.link().nic().wait_handles());
    }
}

// Sleeps until a request of another thread is over. Returns false if the owner does not poll. After the owner has
// accepted the request, this function uses only the request and the osal: the context may be destroyed meanwhile, and
// its end also ends the request.
bool sleep_until_over(Master& master, Request& request) {
    Osal& osal = master.osal;
    const Time patience = osal.now() + kOwnerSilent;
    while (request.busy() && !RequestAccess::accepted(request) && osal.now() < patience)
        RequestAccess::sleep(request, osal, patience);
    if (request.busy() && !RequestAccess::accepted(request) && withdraw_submitted(master.queue, request)) return false;
    while (request.busy()) RequestAccess::sleep(request, osal, kNever);
    return true;
}

}  // namespace

Error check_owner(Context& ctx, Step step) {
    const Master* master = master_of(ctx);
    if (master == nullptr) return {.code = Errc::wrong_state, .step = step};
    return master->owned_by_caller() ? Error{} : Error{.code = Errc::not_owner, .step = step};
}

Error check_waiting_owner(Context& ctx, Step step) {
    const Error refused = check_owner(ctx, step);
    return refused.code != Errc::none ? refused : check_may_wait(*master_of(ctx), step);
}

Result<> wait(Context& ctx, Request& request) {
    Master* master = master_of(ctx);
    const Step step = RequestAccess::operation(request).step;
    if (master == nullptr) return Error{.code = Errc::wrong_state, .step = step};
    if (const Error refused = check_may_wait(*master, step); refused.code != Errc::none) return refused;
    // The poll() of this context never ends a request of another context.
    if (request.busy() && RequestAccess::context(request) != &ctx)
        return Error{.code = Errc::wrong_state, .step = step, .detail = Error::kNotSubmitted};
    if (master->owned_by_caller())
        poll_until_over(ctx, *master, request);
    else if (!sleep_until_over(*master, request))
        RequestAccess::end(request, {.code = Errc::not_polled, .step = step}, master->osal);
    if (request.state() == RequestState::unused)
        return Error{.code = Errc::wrong_state, .step = step, .detail = Error::kNotSubmitted};
    return request.state() == RequestState::error ? Result<>(request.error()) : Result<>();
}

Result<> submit_and_wait(Context& ctx, Request& request) {
    Master* master = master_of(ctx);
    const Step step = RequestAccess::operation(request).step;
    if (master == nullptr) return Error{.code = Errc::wrong_state, .step = step};
    if (const Error refused = check_may_wait(*master, step); refused.code != Errc::none) return refused;
    if (master->owned_by_caller()) let_supervision_compare(ctx, *master, request);
    const auto submitted = submit(ctx, request);
    return submitted ? wait(ctx, request) : submitted;
}

Result<> allow_waiting(Context& ctx, bool allowed) {
    if (const Error refused = check_owner(ctx, Step::none); refused.code != Errc::none) return refused;
    master_of(ctx)->owner_may_wait = allowed;
    return Result<>();
}

Result<> take_ownership(Context& ctx) {
    Master* master = master_of(ctx);
    if (master == nullptr) return Error{.code = Errc::wrong_state};
    master->owner.store(master->osal.thread_number(), std::memory_order_relaxed);
    return Result<>();
}

// Whether the application has paused: it usually polls more often, and the slaves were not read for long, so another
// machine may be connected now. Then no request continues before the supervision has compared the slaves.
static bool is_after_pause(Master& master, Time now) {
    constexpr Duration kLate = std::chrono::milliseconds(250);
    const bool first = master.polled == Time::min();
    const Duration gap = first ? Duration{0} : now - master.polled;
    const Duration late = first || now < master.poll_due ? Duration{0} : now - master.poll_due;
    const Duration before = std::exchange(master.poll_late, late);
    return gap > Network::kBelieved && late > kLate && late / 4 > before;
}

Time poll(Context& ctx, Time now) {
    Master* master = master_of(ctx);
    if (master == nullptr) return kNever;
    if (!master->owned_by_caller()) {
        master->foreign_poll.store(true, std::memory_order_relaxed);
        return kNever;
    }
    Network& network = master->network;
    if (master->in_poll) {
        network.errors.add({.code = Errc::in_callback});
        return kNever;
    }
    if (master->foreign_poll.exchange(false, std::memory_order_relaxed)) network.errors.add({.code = Errc::not_owner});
    master->in_poll = true;
    network.engine.set_now(now);
    if (is_after_pause(*master, now) && network.supervised) {
        doubt_all(network, true);
        network.comparing_until = later(now, kPatience);
    }
    master->polled = now;
    for (ProcessGroup& group : network.process.groups) {
        if (group.mapped && group.prepared.empty()) network.engine.link().look_at_cable(now, kCableKnown);
        if (group.sums_doubted) confirm_sums(network, group);
    }
    // A request that ends in this poll() may free memory for requests that wait.
    Time queued = serve_queue(*master, now);
    Time next = network.engine.poll(now);
    const RequestQueue& queue = master->queue;
    if (queue.waiting != nullptr || queue.any_submitted.load(std::memory_order_relaxed) ||
        queue.cancel_asked.load(std::memory_order_relaxed)) {
        queued = serve_queue(*master, now);
        next = network.engine.poll(now);
    }
    if (network.redundancy != nullptr) network.redundancy->note_change(network);
    if (std::exchange(network.supervision_ended, false)) {
        Event ended{.kind = EventKind::unsupervised};
        ended.error = network.supervision_error;
        network.report(ended);
    }
    master->in_poll = false;
    // A frame that arrived between both calls of serve_queue() may have ended a request, so that another request can
    // begin now.
    const Time due = begins_at_once(*master) ? now : std::min(next, queued);
    master->poll_due = due;
    return due;
}

}  // namespace margay
