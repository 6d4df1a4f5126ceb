// The objects in the memory of a context: the network, the requests, and the owner thread.
#pragma once

#include "api/queue.hpp"
#include "network/network.hpp"
#include "osal/osal.hpp"

#include <margay/context.hpp>

#include <atomic>

namespace margay {

struct Master {
    template <class... Args>
    Master(Osal& system, Args&&... args) : osal(system), owner(system.thread_number()), network(args...) {}

    Osal& osal;
    std::atomic<std::uintptr_t> owner;
    std::atomic<bool> foreign_poll{false};  // another thread has called poll()
    bool owner_may_wait = true;
    bool in_poll = false;
    bool in_work = false;       // the work function of run_cycle() is being called
    Time polled = Time::min();  // the time of the last poll()
    Time poll_due = kNever;     // the time of the next call that the last poll() has returned
    Duration poll_late{0};      // how much later poll() was called than the poll() before it had requested
    // The last cycle that a clock has kept in step: when its frames were sent, when it was due, and by how much the
    // clock has moved the next cycle.
    Time in_step_sent = Time::min();
    Time in_step_due = Time::min();
    RequestQueue queue;
    Network network;  // declared after `queue`, so that its requests end before the queue is destroyed

    [[nodiscard]] bool owned_by_caller() const { return owner.load(std::memory_order_relaxed) == osal.thread_number(); }
    [[nodiscard]] Arena& arena() { return network.arena(); }
};

struct ContextAccess {
    static Master*& master(Context& ctx) { return ctx.master_; }
    static LinkSettings& early_settings(Context& ctx) { return ctx.early_settings_; }
    // Returned by slave() for numbers without a slave.
    static Slave& nobody(Context& ctx) { return ctx.none_; }
    // Returned by group() for numbers without a group, and before init().
    static Group& no_group(Context& ctx) { return ctx.no_group_; }
    static EventQueue& no_events(Context& ctx) { return ctx.no_events_; }
    static EmergencyRing& no_emergencies(Context& ctx) { return ctx.no_emergencies_; }
    static std::span<std::byte> memory(Context& ctx) { return ctx.memory_; }
    static std::size_t needed_bytes(Context& ctx) { return ctx.needed_bytes_; }
};

// nullptr before init().
[[nodiscard]] inline Master* master_of(Context& ctx) { return ContextAccess::master(ctx); }

// The error of a call that only the owner may make: wrong_state before init(), not_owner; code none: the call is
// allowed.
[[nodiscard]] Error check_owner(Context& ctx, Step step);

// The same for a call that waits; further codes: in_callback, waiting_forbidden.
[[nodiscard]] Error check_waiting_owner(Context& ctx, Step step);

// For a request for a scan or a mapping: adds the warning configuration_lost if the application has set `config` or
// `hooks` of a slave, or `config` of a group, that does not exist: too early, or with a wrong number. For the owner,
// where the request begins, whichever thread has submitted it.
void note_lost_wishes(Request& request);

// For functions that wait: returns an error if waiting is not allowed; otherwise submits the request and waits for its
// end.
Result<> submit_and_wait(Context& ctx, Request& request);

// The same for a request with a result: `value` is the member of the request that holds the result.
template <class T>
Result<T> submit_and_wait(Context& ctx, Request& request, const T& value) {
    const auto done = submit_and_wait(ctx, request);
    return done ? Result<T>(value) : Result<T>(done.error());
}

}  // namespace margay
