// Functions that bring a segment to its target state, keep it there, and run its cycle: one call for each task that
// every program has. All functions except set_target() are for the thread that owns the context; in another thread they
// return Errc::not_owner.
#pragma once

#include <margay/context.hpp>
#include <margay/expected.hpp>
#include <margay/frame_timing.hpp>
#include <margay/request.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <type_traits>
#include <utility>

namespace margay {

// Sets the accepted differences from the list of expect(). Before the first call, none is accepted. The setting applies
// at once and to all later calls. After config_init() has ended with an error, the application calls tolerate() and
// config_map() to continue with the slaves that are present. A slave that was held until then gets its start-up
// commands from config_map(). A slave that is not tolerated any more is brought down by the supervision, or by the next
// config_map(); until then it keeps its state and its outputs. Never waits. Errors: wrong_state before init(),
// not_owner.
Result<> tolerate(Context& ctx, const Tolerance& tolerance);

// ------------------------------------------------------------------ states

// Sets the target state of a slave: INIT, PREOP, SAFEOP, OP, or BOOT for one slave; slave 0: of all slaves, and the
// targets of single slaves end. `state` NONE ends the target of one slave: the target of all slaves applies to it
// again. OP does the same while OP is the target of all slaves. The target may be above or below the present state.
//
// While a SuperviseRequest is busy, set_target() returns at once, is callable from the cycle, and the supervision
// brings the slaves to their targets. Without a supervision, set_target() itself changes the states and waits; OP needs
// an exchange of process data, which reach() provides.
//
// BOOT: the slave goes to INIT first, gets the mailboxes of BOOT, and leaves the exchange of process data. Nothing but
// a later call for this slave takes it out of BOOT, where its firmware may be incomplete: neither the supervision nor
// the target of all slaves. The way back is the whole start-up; PDOs that were read from the slave are read again.
// Where their sizes differ from the mapping, the slave stays in PREOP with pdo_size, and needs config_map().
//
// A slave with a target below SAFEOP is not wanted in the exchange of process data: the expected working counters do
// not count it. With a target of SAFEOP or OP they count it at once: until the slave takes part, each cycle of its
// group returns working_counter. Targets last until the next config_init(); then the target of all slaves is OP.
// SuperviseRequest::target sets the target of all slaves when the request is submitted and when the value changes.
//
// Errors: wrong_state (no slaves yet), unknown_slave, invalid_argument (another state), unsupported (BOOT, and the
// slave has no bootstrap mailboxes), above_highest, other_slave and unexpected_slave (the slave is held); without a
// supervision also the errors of the state changes, of the first slave that did not reach its target.
Result<> set_target(Context& ctx, std::uint16_t slave, AlState state);

// The same as a request. Without a supervision it is busy until the slaves have reached their targets.
struct TargetRequest : SlaveRequest {  // slave 0: all slaves
    TargetRequest();
    AlState wanted = AlState::none;
};

// Keeps a cycle in step with another clock: see MasterClock (master_clock.hpp).
class CycleClock {
  public:
    // Called after each cycle. `lateness`: how much later than due the cycle was sent. Returns by how much the next
    // cycle must come earlier; negative: later.
    [[nodiscard]] Duration follow(Context& ctx, Duration lateness) { return follow_(*this, ctx, lateness); }

  protected:
    using Follow = Duration (*)(CycleClock& self, Context& ctx, Duration lateness);
    constexpr explicit CycleClock(Follow function) : follow_(function) {}
    ~CycleClock() = default;

  private:
    Follow follow_;
};

// How reach() and run_cycle() exchange process data: all mapped groups, once a period.
struct CycleSettings {
    Duration period = std::chrono::milliseconds(1);
    Duration reply_timeout{0};  // the timeout of receive_processdata(); zero: half a period
    // False: another thread sends the groups (GroupConfiguration::cycles_in_flight), and the owner only receives them.
    bool send = true;
    // After each cycle, reach() and run_cycle() call this clock for the due time of the next cycle. nullptr: the next
    // cycle is due one period later, by the osal's clock. Without effect where another thread sends. With a clock, the
    // first cycle keeps the phase of the last cycle of an earlier call, if the last cycle was at most a second ago: the
    // function waits until the first cycle is due.
    CycleClock* clock = nullptr;
    // The frames of a cycle leave `send_lead` after the cycle was due, by a NIC that can hold them until then
    // (timed_send.hpp), so that they leave without the jitter of the wake-up. send_lead must be longer than this jitter
    // and shorter than the period. A cycle that begins later sends at once; TimedSend::missed() counts its frames.
    // nullptr: the frames leave when the cycle begins. Without effect where another thread sends.
    TimedSend* send_at = nullptr;
    Duration send_lead{0};
};

// Brings all wanted slaves to `state` (a slave with a target of its own: to that target). Waits until each of them is
// in that state without an error and with its process data configured, and the last cycle of each group was right.
// Exchanges process data meanwhile if groups are mapped, and supervises the slaves if no SuperviseRequest is busy.
// `state` stays the target of all slaves.
//
// Returns the error of the first slave that has not reached its target: when `timeout` is over, or at once if all other
// slaves have reached theirs and waiting cannot help (the slave is held, has no place in the image, needs a mapping, or
// its group is not mapped). Waits; not for the cycle. Errors: wrong_state (no slaves yet), invalid_argument (`state` is
// not INIT, PREOP, SAFEOP or OP; a period of 0, a negative time, a send_lead outside of the period), scan_needed
// (expect() was called after config_init()), in_callback (called by the work function of run_cycle()), and the errors
// of what_is_wrong(). reach() reads the states of all slaves at least once, and for that may take up to ten periods
// longer than `timeout`. If no frame comes back: no_frame, or nic (the interface is down).
Result<> reach(Context& ctx, AlState state, Duration timeout, const CycleSettings& cycle = {});

// Whether every wanted slave is in its target state without an error and with its process data configured, as the
// supervision or readstate() has read it last, and the last cycle of every mapped group has brought the inputs of all
// of these slaves. Call it after receive_processdata(). Callable from the cycle: never waits, and looks at each slave
// once.
//
// How old the result may be: of a slave that exchanges process data it is as old as the last received cycle, which was
// sent up to cycles_in_flight cycles before. A slave whose target is INIT or PREOP is in no cycle. A supervision sees
// within some cycles that such a slave is gone, if poll() is called after each cycle, and within 100 ms if no frame
// comes back. receive_processdata() names the one change that no cycle shows. Without a supervision, all_right() is
// false (not_supervised) if the states of the slaves were not read for a second of cycles: call readstate() more often,
// or submit a SuperviseRequest.
[[nodiscard]] bool all_right(Context& ctx);
// The first reason why all_right() is false, by slave number; code none if all_right() is true. Codes: missing_slave,
// other_slave, unexpected_slave, identity_unread (the slave was away, and its identity was not compared since),
// unknown_group (the group of the slave is not mapped), no_place, al_status, other_state (the slave is in another state
// than its target), start_up_unfinished (the slave is in its state, but the commands or the hook after the transition
// have not ended, have failed or were ended), remapping_needed (found when the slave is started again), every error of
// the slave's start-up, working_counter (the slave does not take part in the cycle, or a working counter of group
// `index` is low), no_frame (no cycle of group `index` came), wrong_state (no slaves yet), not_polled (requests are
// busy, and the owner has exchanged process data for a second without a call of poll()), not_supervised (no supervision
// is busy, and the states of all slaves were not read for a second of cycles), group_left_out (a mapped group was not
// exchanged for a second of cycles; seen from the second call on), invalid_argument (a copy of a mapped group is not
// executed, because its slave is in another group now, or GroupConfiguration::copies was changed; detail:
// Argument::copy).
[[nodiscard]] Error what_is_wrong(Context& ctx);

// ------------------------------------------------------------------ the cycle

// The facts about a cycle that the work function of run_cycle() receives.
struct CycleInfo {
    std::uint64_t number = 0;    // the first cycle is 1
    Time due{};                  // when the cycle was due to begin
    Duration lateness{};         // how much later than `due` the cycle began
    std::uint64_t left_out = 0;  // cycles left out so far, because the work took longer than a period
    // The first error of sending and receiving; code none: every group has been exchanged, and all inputs are right.
    Error error;
};

// Returns true to continue, false to end the cycle.
using CycleWork = bool (*)(Context& ctx, const CycleInfo& cycle, void* user);

// Runs the cycle of an application. Once a period it sends the outputs of all mapped groups, receives their inputs, and
// calls `work`, which reads the inputs and sets the outputs of the next cycle. poll() is called at least once after
// each cycle, also if the work takes longer than a period, and then as often as poll() requests until the next cycle is
// due. Cycles that could not begin in their period are left out, counted, and reported as EventKind::overrun, at most
// once a second. A cycle with lost frames or a low working counter does not end run_cycle(): CycleInfo::error then
// contains the error. CycleInfo::error is unknown_group (index: the group) while a group is not mapped any more,
// because a scan or a mapping is executing or has failed. `work` must not throw: an exception ends the program. Returns
// success when `work` has returned false. Waits. Errors: wrong_state before init(), unknown_group (no group is mapped),
// invalid_argument (a period of 0, a negative time, a send_lead outside of the period), in_callback (called by the work
// function of run_cycle()).
Result<> run_cycle(Context& ctx, const CycleSettings& settings, CycleWork work, void* user);

// The same with any object that can be called as bool(const CycleInfo&). `work` must live until run_cycle() returns.
//
//     run_cycle(ctx, {.period = std::chrono::milliseconds(1)}, [&](const CycleInfo& cycle) { … return !stop; });
template <class Work>
requires std::is_invocable_r_v<bool, Work&, const CycleInfo&> Result<> run_cycle(Context& ctx,
                                                                                 const CycleSettings& settings,
                                                                                 Work&& work) {
    using Callable = std::remove_reference_t<Work>;
    if constexpr (std::is_function_v<Callable>) {
        Callable* const function = work;
        return run_cycle(ctx, settings, function);
    } else {
        const auto call = [](Context&, const CycleInfo& cycle, void* user) -> bool {
            return (*static_cast<Callable*>(user))(cycle);
        };
        return run_cycle(ctx, settings, CycleWork{call},
                         const_cast<void*>(static_cast<const volatile void*>(__builtin_addressof(work))));
    }
}

}  // namespace margay
