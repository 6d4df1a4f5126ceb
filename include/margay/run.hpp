// Bringing a segment to where it is wanted, keeping it there, and its cycle: one call each for what every program does.
// All functions but set_target() are for the thread that owns the context: Errc::not_owner in another one.
#pragma once

#include <margay/context.hpp>
#include <margay/expected.hpp>
#include <margay/request.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <type_traits>
#include <utility>

namespace margay {

// Says what of the segment may differ from what expect() describes; nothing may before the first call. Holds at once
// and for all that follows: after config_init() has ended with an error, tolerate() and config_map() are the
// application's decision to go on with what is there. A slave that was held until then gets its start-up commands from
// config_map(). A slave that is tolerated no more is brought down by the supervision, or by the next config_map():
// until then it keeps its state and its outputs. Never waits. Errors: wrong_state before init(), not_owner.
Result<> tolerate(Context& ctx, const Tolerance& tolerance);

// ------------------------------------------------------------------ states

// Says to which state a slave shall be brought and kept: INIT, PREOP, SAFEOP or OP; slave 0: all slaves, whose own
// targets end with that. `state` NONE ends the own target of one slave: the target of all slaves counts for it again.
// Works in both directions. While a SuperviseRequest is busy set_target() returns at once, is callable from the cycle,
// and the supervision brings the slaves there. Without one set_target() brings them there itself and waits; OP wants
// process data, which reach() sends. A slave whose target is below SAFEOP is not wanted in the exchange: the expected
// working counters do without it. Targets last until the next config_init(); the target of all slaves is OP then.
// SuperviseRequest::target counts as that of all slaves when the request is submitted and when it is changed. Errors:
// wrong_state (no slaves yet), unknown_slave, invalid_argument (another state), above_highest, other_slave and
// unexpected_slave (the slave is held); without a supervision those of what fails, with the first slave that is not
// there.
Result<> set_target(Context& ctx, std::uint16_t slave, AlState state);

// The same as a request: without a supervision it is busy until the slaves are where they are wanted.
struct TargetRequest : SlaveRequest {  // slave 0: all slaves
    TargetRequest();
    AlState wanted = AlState::none;
};

// How process data is exchanged while reach() or run_cycle() is at it: all groups that are mapped, once a period.
struct CycleSettings {
    Duration period = std::chrono::milliseconds(1);
    Duration reply_timeout{0};  // of receive_processdata(); zero: half a period
    // False: another thread sends the groups (GroupConfiguration::cycles_in_flight), they are only received here.
    bool send = true;
};

// Brings all wanted slaves to `state` (slaves with a target of their own to that) and waits until they are there with
// all that belongs to it: without an error, with their process data configured, the last cycle of each group right.
// Exchanges process data meanwhile where groups are mapped, and supervises the slaves where no SuperviseRequest is
// busy. Returns the first slave that is not there: at once when all the others are and waiting cannot help (a slave
// that is held, that no place was kept for, or whose group is not mapped), else when `timeout` is over. `state` stays
// the target of all slaves. Waits; not for the cycle. Errors besides: wrong_state (no slaves yet), invalid_argument
// (neither INIT, PREOP, SAFEOP nor OP; a period of 0, a negative time), in_callback (called by the work of
// run_cycle()), those of what_is_wrong().
Result<> reach(Context& ctx, AlState state, Duration timeout, const CycleSettings& cycle = {});

// Whether every wanted slave is in its target state without an error and with its process data configured, by what was
// read last (the supervision, or readstate()), and the last cycle of every mapped group has brought the inputs of all
// of them. To be called after receive_processdata(), from the cycle too: never waits, looks at each slave once.
[[nodiscard]] bool all_right(Context& ctx);
// The first reason why all_right() is false, by slave number; code none when it is true. missing_slave, other_slave,
// unexpected_slave, unknown_group (its group is not mapped), no_place, al_status, other_state (it is in another state),
// what its start-up has failed with, working_counter (it does not take part in the cycle, or a datagram falls short),
// no_frame (no cycle has come back), wrong_state (no slaves yet), not_polled (requests are busy, and the owner has
// exchanged process data for a second without a call of poll()).
[[nodiscard]] Error what_is_wrong(Context& ctx);

// ------------------------------------------------------------------ the cycle

// What the work of a cycle is told of it.
struct CycleInfo {
    std::uint64_t number = 0;    // 1 the first
    Time due{};                  // when it should have begun
    Duration lateness{};         // how much later it has begun
    std::uint64_t left_out = 0;  // cycles left out so far, because the work took longer than a period
    Error error;                 // the first error of sending and receiving; code none: all inputs are right
};

// Returns whether the cycle goes on.
using CycleWork = bool (*)(Context& ctx, const CycleInfo& cycle, void* user);

// The cycle of an application. Once a period it sends the outputs of all mapped groups, receives their inputs, and
// calls `work`, which reads the inputs and sets the outputs of the next cycle. poll() runs at least once after each
// cycle, also when the work takes longer than a period, and as often as it wants to until the next cycle is due. Cycles
// that could not begin in their period are left out, counted, and told as EventKind::overrun, once a second at most. A
// cycle whose frames are lost or whose working counter is short does not end it: CycleInfo::error tells. Returns
// success when `work` has returned false. Waits. Errors: wrong_state before init(), unknown_group (nothing is mapped),
// invalid_argument (a period of 0, a negative time), in_callback (called by the work of run_cycle()).
Result<> run_cycle(Context& ctx, const CycleSettings& settings, CycleWork work, void* user);

// The same with anything that is called as bool(const CycleInfo&).
//
//     run_cycle(ctx, {.period = std::chrono::milliseconds(1)}, [&](const CycleInfo& cycle) { … return !stop; });
template <class Work>
requires std::is_invocable_r_v<bool, Work&, const CycleInfo&> Result<> run_cycle(Context& ctx,
                                                                                 const CycleSettings& settings,
                                                                                 Work&& work) {
    using Callable = std::remove_reference_t<Work>;
    const auto call = [](Context&, const CycleInfo& cycle, void* user) -> bool {
        return (*static_cast<Callable*>(user))(cycle);
    };
    return run_cycle(ctx, settings, CycleWork{call},
                     const_cast<void*>(static_cast<const volatile void*>(__builtin_addressof(work))));
}

}  // namespace margay
