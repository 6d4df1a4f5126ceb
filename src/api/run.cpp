// Functions that bring a segment to its target state, and the cycle of the public API.
#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/settings.hpp"
#include "network/wanted.hpp"
#include "util/scoped_flag.hpp"

#include <margay/margay.hpp>
#include <margay/timed_send.hpp>

#include <algorithm>
#include <utility>

namespace margay {
namespace {

Error check_target(Network& network, std::uint16_t slave, AlState state) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::request_state};
    if (const Error error = check_slave_or_all(network, slave, Step::request_state); error.code != Errc::none)
        return error;
    if (slave != 0 && state == AlState::none) return {};     // the slave uses the target of all slaves again
    const bool boot = slave != 0 && state == AlState::boot;  // only slaves that the application names
    if (!boot && !can_be_target(state)) return invalid(Argument::state, Step::request_state, slave);
    if (slave == 0) return {};
    return target_refusal(network, network.slave(slave), state);
}

Task<Result<>> bring_one(Network& network, Slave& slave, FirstFault& faults) {
    if (slave.al.state == AlState::none) co_return Nothing{};
    auto seen = co_await read_anew(network, slave);  // the known state may be old
    if (!seen) faults.note(network, slave, seen.error());
    if (!seen) co_return Nothing{};
    slave.error = {};  // the error of an earlier attempt
    auto done = co_await bring_back(network, slave);
    if (!done) faults.note(network, slave, done.error());
    co_return Nothing{};
}

// The first slave that has not reached its target, and whether waiting can help.
struct Standing {
    Error first;
    bool can_change = false;
};

bool can_change(const Network& network, const Slave& slave) {
    if (!is_highest(slave.config.highest)) return false;
    if (slave.al.state == AlState::none) return true;
    if (slave.held) return is_unread(slave) || network.marks(slave).in_use;  // an unread slave may be read later
    if (wanted_state(network, slave) < AlState::safeop || is_to_be_asked(network, slave)) return true;
    return is_mapped(network, slave) && has_place(slave) && may_be_exchanged(network, slave);
}

Standing standing(Network& network) {
    Standing now;
    for (const Slave& slave : network.slaves()) {
        const Error error = state_error(network, slave);
        if (error.code == Errc::none) continue;
        if (now.first.code == Errc::none) now.first = error;
        now.can_change |= can_change(network, slave);
    }
    return now;
}

// The error of the last cycle of a group; code none if the cycle was right.
Error cycle_trouble(const ProcessGroup& group) {
    if (is_right(group)) return {};
    Error error{.code = Errc::working_counter, .step = Step::exchange_process_data, .index = group.number};
    error.expected = group.expected_wkc;
    for (const DatagramStatus& d : group.statuses) {
        error.actual += d.got;
        if (!d.came) error.code = Errc::no_frame;
    }
    return error;
}

// Whether the application exchanges other groups, but not this group.
bool is_left_out(ProcessGroup& group, Time now) {
    const std::uint32_t sent = sent_cycles(group);
    const bool goes_on = std::exchange(group.cycles_seen, sent) != sent || group.seen_at == Time{};
    if (goes_on) group.seen_at = now;
    return later(group.seen_at, Network::kBelieved) < now;
}

Error cycles_trouble(Network& network) {
    const Time now = network.engine.link().last_cycle();
    // After a silence the slaves may belong to another machine, until the supervision has compared them.
    if (network.supervised && network.silent) return {.code = Errc::no_frame, .step = Step::exchange_process_data};
    for (ProcessGroup& group : network.process.groups) {
        if (!group.mapped) continue;
        Error error = cycle_trouble(group);
        if (is_silent(group, network.engine.link(), network.engine.now()))
            error = {.code = Errc::no_frame, .step = Step::exchange_process_data, .index = group.number};
        if (error.code == Errc::none && is_left_out(group, now))
            error = {.code = Errc::group_left_out, .step = Step::exchange_process_data, .index = group.number};
        if (error.code != Errc::none) return error;
    }
    return {};
}

// The error of a copy that is not executed: one of its slaves has left the group since the mapping, or the list of
// copies has changed.
Error copies_trouble(const Network& network) {
    for (const ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.mapping) continue;
        for (const SlaveToSlave& copy : group.config.copies)
            if (const std::uint16_t slave = invalid_end(group, copy); slave != 0)
                return invalid_mapping(Argument::copy, slave);
    }
    return {};
}

bool ends_the_cycle(Errc code) { return code == Errc::wrong_state || code == Errc::not_owner; }

bool any_mapped(const Network& network) {
    return std::ranges::any_of(network.process.groups, [](const ProcessGroup& group) { return group.mapped; });
}

Error not_mapped(std::uint8_t group) {
    return {.code = Errc::unknown_group, .step = Step::exchange_process_data, .index = group};
}

// The error of a reach(). If no group is mapped at all, the call of config_map() is missing, and the error names no
// slave.
Error reach_error(const Network& network, const Error& first) {
    const bool no_mapping = first.code == Errc::unknown_group && first.expected == 0 && !any_mapped(network);
    return no_mapping ? Error{.code = Errc::unknown_group, .step = Step::request_state} : first;
}

// The object that holds the frames of the cycle until their send time; nullptr: the frames are sent at once.
TimedSend* sender(const CycleSettings& settings) { return settings.send ? settings.send_at : nullptr; }

// When the frames of a cycle leave.
struct Departure {
    Time wanted;
    Time at;  // later if the cycle has begun after `wanted`
    Departure(const CycleSettings& settings, Time due, Time begun)
        : wanted(sender(settings) != nullptr ? later(due, settings.send_lead) : due), at(std::max(wanted, begun)) {}
};

// Executes one cycle of all mapped groups. Returns its first error; an error that ends the cycle takes precedence. It
// is also an error if no group is mapped, or if a group is not mapped any more, because its data is not exchanged.
Error exchange(Context& ctx, const CycleSettings& settings, const Departure& departure) {
    const auto groups = master_of(ctx)->network.process.groups;
    const Duration timeout = settings.reply_timeout > Duration{0} ? settings.reply_timeout : settings.period / 2;
    Error first;
    const auto keep = [&first](const Error& error) {
        if (first.code == Errc::none || ends_the_cycle(error.code)) first = error;
    };
    TimedSend* const timed = sender(settings);
    if (timed != nullptr) timed->set_send_time(departure.wanted);
    for (const ProcessGroup& group : groups) {
        if (!group.mapped || !settings.send) continue;
        if (const auto sent = send_processdata(ctx, departure.at, group.number); !sent) keep(sent.error());
    }
    if (timed != nullptr) timed->set_send_time(TimedSend::kAtOnce);
    for (const ProcessGroup& group : groups) {
        if (!group.mapped && group.was_mapped) keep(not_mapped(group.number));
        if (!group.mapped) continue;
        if (const auto received = receive_processdata(ctx, timeout, group.number); !received) keep(received.error());
    }
    if (!any_mapped(master_of(ctx)->network)) keep(not_mapped(0));
    return first;
}

// Computes when cycles are due, and counts the cycles that are left out.
class Schedule {
  public:
    Schedule(Time first, Duration period) : due_(first), period_(period) {}
    [[nodiscard]] Time due() const { return due_; }
    void shift(Duration by) { due_ += by; }
    // Moves to the next cycle; returns how many cycles could not begin in their period.
    std::uint64_t next(Time now) {
        due_ = later(due_, period_);
        if (now - due_ < period_) return 0;
        const auto late = static_cast<std::uint64_t>((now - due_) / period_);
        due_ += static_cast<Duration::rep>(late) * period_;
        return late;
    }

  private:
    Time due_;
    Duration period_;
};

// Moves the next cycles as the clock of the settings requires.
void keep_in_step(Context& ctx, const CycleSettings& settings, Schedule& schedule, const Departure& departure) {
    if (settings.clock == nullptr || !settings.send) return;
    schedule.shift(-settings.clock->follow(ctx, departure.at - departure.wanted));
    Master& master = *master_of(ctx);
    master.in_step_sent = master.network.engine.link().last_cycle();
    master.in_step_due = schedule.due();
}

// Reports an overrun at once, and further overruns once a second at most.
class OverrunNews {
  public:
    explicit OverrunNews(Network& network) : network_(network) {}
    void add(std::uint64_t left_out, std::uint64_t in_all, Time now) {
        untold_ += left_out;
        if (untold_ == 0 || now < next_) return;
        next_ = now + std::chrono::seconds(1);
        network_.report({.kind = EventKind::overrun,
                         .expected = static_cast<std::uint32_t>(std::min<std::uint64_t>(in_all, 0xFFFF'FFFF)),
                         .actual = static_cast<std::uint32_t>(std::min<std::uint64_t>(untold_, 0xFFFF'FFFF))});
        untold_ = 0;
    }

  private:
    Network& network_;
    std::uint64_t untold_ = 0;
    Time next_ = Time::min();
};

// Whether the owner exchanges process data but does not call poll(), so that requests do not progress.
bool is_starved(Master& master) {
    const bool requests = master.queue.waiting != nullptr || master.queue.running != nullptr;
    return requests && later(master.polled, Network::kBelieved) < master.network.engine.link().last_cycle();
}

// The error if reach() or run_cycle() is refused: the errors of check_waiting_owner(), in_callback (called in the work
// function of run_cycle()), or a wrong setting.
Error check_cycling(Context& ctx, const CycleSettings& cycle, Step step) {
    const Error refused = check_waiting_owner(ctx, step);
    if (refused.code != Errc::none && refused.code != Errc::waiting_forbidden) return refused;
    if (master_of(ctx)->in_work) return {.code = Errc::in_callback, .step = step};
    if (cycle.period <= Duration{0}) return invalid(Argument::period, step);
    if (cycle.reply_timeout < Duration{0}) return invalid(Argument::reply_timeout, step);
    if (sender(cycle) != nullptr && (cycle.send_lead <= Duration{0} || cycle.send_lead >= cycle.period))
        return invalid(Argument::send_lead, step);
    return refused;  // run_cycle() is allowed where other waiting calls are forbidden
}

// The supervision that reach() starts itself: its end is not reported to the application.
class OwnSupervision : public SuperviseRequest {
  public:
    explicit OwnSupervision(Network& network) : network_(network) {}
    OwnSupervision(const OwnSupervision&) = delete;
    OwnSupervision& operator=(const OwnSupervision&) = delete;
    ~OwnSupervision() {
        network_.reaching = busy();
        cancel();
        network_.reaching = false;
    }

  private:
    Network& network_;
};

// The first reading of the states may need more time than the timeout of a reach() that only looks whether all is well.
constexpr int kPeriodsToLook = 10;

// The error of a reach() that could not read the states: of the cycle if no frame comes back.
Error unknown_states(const ReadStateRequest& look, const Error& exchanged) {
    if (exchanged.code == Errc::no_frame || exchanged.code == Errc::nic) return exchanged;
    return look.busy() ? Error{.code = Errc::timeout, .step = Step::read_state} : look.error();
}

// The SuperviseRequest that has not begun; nullptr: there is none.
SuperviseRequest* waiting_supervision(const RequestQueue& queue) {
    for (Request* r = queue.waiting; r != nullptr; r = RequestAccess::next(*r))
        if (RequestAccess::operation(*r).operation == Operation::supervise) return static_cast<SuperviseRequest*>(r);
    return nullptr;
}

bool call_work(CycleWork work, Context& ctx, const CycleInfo& cycle, void* user) {
    master_of(ctx)->in_work = true;
    const bool goes_on = work(ctx, cycle, user);
    master_of(ctx)->in_work = false;
    return goes_on;
}

// Polls until `due`, at least once.
void poll_until(Context& ctx, Time due) {
    Osal& osal = master_of(ctx)->osal;
    const WaitHandles handle = master_of(ctx)->network.engine.link().nic().wait_handles();
    Time now = osal.now();
    do {
        const Time wake = poll(ctx, now);
        if (now < due) osal.wait(std::min(wake, due), handle);
        now = osal.now();
    } while (now < due);
}

// When the last cycle was due. For a cycle of the application itself: when it was sent, minus the time for which frames
// are held.
Time last_due(Master& master, const CycleSettings& settings) {
    const Time sent = master.network.engine.link().last_cycle();
    if (sent == master.in_step_sent) return master.in_step_due;
    return sender(settings) != nullptr ? later(sent, -settings.send_lead) : sent;
}

// If a clock keeps the cycle in step, the function waits until the first cycle continues the phase of the last cycle: a
// jump would lead the clock out of its limit. After a longer pause, the cycle begins with a new phase.
Schedule begin_schedule(Context& ctx, const CycleSettings& settings) {
    constexpr Duration kLongest = std::chrono::seconds(1);
    Master& master = *master_of(ctx);
    const Time now = master.osal.now();
    const Time sent = master.network.engine.link().last_cycle();
    if (settings.clock == nullptr || !settings.send || sent == Time::min() || later(sent, kLongest) < now)
        return Schedule(now, settings.period);
    const Time due = last_due(master, settings);
    const Duration passed = std::max(now - due, Duration{1});
    const Time first = later(due, ((passed - Duration{1}) / settings.period + 1) * settings.period);
    poll_until(ctx, first);
    return Schedule(first, settings.period);
}

}  // namespace

Result<> tolerate(Context& ctx, const Tolerance& tolerance) {
    if (const Error refused = check_owner(ctx, Step::identify); refused.code != Errc::none) return refused;
    Network& network = master_of(ctx)->network;
    network.tolerance = tolerance;
    update_held(network);
    for (Slave& slave : network.slaves()) update_counted(network, slave);
    return Result<>();
}

static Error check(Network& network, const TargetRequest& request) {
    return check_target(network, request.slave, request.wanted);
}

static Task<Result<>> run(Network& network, TargetRequest& request) {
    set_targets(network, request.slave, request.wanted, target_of_all(network));
    if (network.supervised) co_return Nothing{};
    FirstFault faults;
    if (request.slave != 0) {
        co_await required(bring_one(network, network.slave(request.slave), faults));
        faults.keep(state_error(network, network.slave(request.slave)));
    } else {
        const auto bring = [&network, &faults](Slave& slave) { return bring_one(network, slave, faults); };
        co_await required(for_each_slave(network, bring));
        for (const Slave& slave : network.slaves()) faults.keep(state_error(network, slave));
    }
    co_return faults.error().code == Errc::none ? Result<>() : Result<>(faults.error());
}

static constexpr OperationDescription kTarget =
    describe_operation<TargetRequest, check, run>(Operation::set_target, Step::request_state, Needs::its_slave);
TargetRequest::TargetRequest() : SlaveRequest(kTarget) {}

Result<> set_target(Context& ctx, std::uint16_t slave, AlState state) {
    Master* master = master_of(ctx);
    const bool owner = master != nullptr && master->owned_by_caller();
    SuperviseRequest* const waiting = owner ? waiting_supervision(master->queue) : nullptr;
    if (owner && (master->network.supervised || waiting != nullptr)) {
        const Error refused = check_target(master->network, slave, state);
        if (refused.code != Errc::none) return refused;
        if (waiting != nullptr && slave == 0) waiting->target = state;  // replaces the target of the waiting request
        const AlState of_all = waiting != nullptr ? waiting->target : target_of_all(master->network);
        set_targets(master->network, slave, state, of_all);
        return Result<>();
    }
    TargetRequest request;
    request.slave = slave;
    request.wanted = state;
    return submit_and_wait(ctx, request);
}

Error what_is_wrong(Context& ctx) {
    if (const Error refused = check_owner(ctx, Step::read_state); refused.code != Errc::none) return refused;
    Network& network = master_of(ctx)->network;
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::read_state};
    if (is_starved(*master_of(ctx))) return {.code = Errc::not_polled, .step = Step::exchange_process_data};
    // If a group is left out, this is the cause of the states of its slaves.
    const Error trouble = cycles_trouble(network);
    if (trouble.code == Errc::group_left_out) return trouble;
    for (const Slave& slave : network.slaves())
        if (const Error error = state_error(network, slave); error.code != Errc::none) return error;
    if (!network.supervised && later(network.states_read, Network::kBelieved) < network.engine.link().last_cycle())
        return {.code = Errc::not_supervised, .step = Step::read_state};
    return trouble.code != Errc::none ? trouble : copies_trouble(network);
}

bool all_right(Context& ctx) { return what_is_wrong(ctx).code == Errc::none; }

Result<> reach(Context& ctx, AlState state, Duration timeout, const CycleSettings& cycle) {
    if (const Error refused = check_cycling(ctx, cycle, Step::request_state); refused.code != Errc::none)
        return refused;
    Network& network = master_of(ctx)->network;
    if (const Error refused = check_target(network, 0, state); refused.code != Errc::none) return refused;
    if (!network.is_expected_list()) return Error{.code = Errc::scan_needed, .step = Step::request_state};
    if (timeout < Duration{0}) return invalid(Argument::timeout, Step::request_state);
    Osal& osal = master_of(ctx)->osal;
    (void)poll(ctx, osal.now());  // begins a waiting SuperviseRequest now, so that `state` replaces its target
    if (SuperviseRequest* const waiting = waiting_supervision(master_of(ctx)->queue)) waiting->target = state;
    OwnSupervision supervision(network);
    supervision.target = state;
    set_target_of_all(network, state);
    for (Slave& slave : network.slaves()) update_counted(network, slave);
    ReadStateRequest look;  // the known states may be old
    if (const auto looks = submit(ctx, look); !looks) return looks;
    const Time give_up = later(osal.now(), timeout);
    Schedule schedule = begin_schedule(ctx, cycle);
    for (int periods = 1;; ++periods) {
        if (!network.supervised && !supervision.busy()) {  // also if the supervision of the application has ended
            if (const auto supervised = submit(ctx, supervision); !supervised) return supervised;
        }
        const Departure departure(cycle, schedule.due(), osal.now());
        const Error exchanged = exchange(ctx, cycle, departure);
        if (ends_the_cycle(exchanged.code)) return exchanged;
        keep_in_step(ctx, cycle, schedule, departure);
        (void)schedule.next(osal.now());
        poll_until(ctx, schedule.due());
        const bool in_time = osal.now() < give_up || periods < kPeriodsToLook;
        if (look.busy() && in_time) continue;
        if (look.busy() || look.state() == RequestState::error) {  // the states are unknown
            if (!in_time) return unknown_states(look, exchanged);
            if (const auto again = submit(ctx, look); !again) return again;
            continue;
        }
        const Standing now = standing(network);
        const Error cycles = now.first.code == Errc::none ? cycles_trouble(network) : Error{};
        if (now.first.code == Errc::none && cycles.code == Errc::none) return Result<>();
        const bool in_vain = now.first.code != Errc::none && !now.can_change;
        if (in_vain || osal.now() >= give_up)
            return now.first.code != Errc::none ? reach_error(network, now.first) : cycles;
    }
}

Result<> run_cycle(Context& ctx, const CycleSettings& settings, CycleWork work, void* user) {
    const Error refused = check_cycling(ctx, settings, Step::exchange_process_data);
    if (refused.code != Errc::none && refused.code != Errc::waiting_forbidden) return refused;
    Network& network = master_of(ctx)->network;
    if (!any_mapped(network)) return not_mapped(0);
    if (work == nullptr) return invalid(Argument::work, Step::exchange_process_data);
    const ScopedFlag running(network.in_run_cycle);
    Osal& osal = master_of(ctx)->osal;
    Schedule schedule = begin_schedule(ctx, settings);
    OverrunNews news(network);
    CycleInfo cycle;
    for (;;) {
        ++cycle.number;
        cycle.due = schedule.due();
        const Time begun = osal.now();
        const Departure departure(settings, cycle.due, begun);
        cycle.lateness = begun - cycle.due;
        cycle.error = exchange(ctx, settings, departure);
        if (ends_the_cycle(cycle.error.code)) return cycle.error;
        keep_in_step(ctx, settings, schedule, departure);
        if (!call_work(work, ctx, cycle, user)) return Result<>();
        const Time done = osal.now();
        const std::uint64_t late = schedule.next(done);
        cycle.left_out += late;
        poll_until(ctx, schedule.due());
        news.add(late, cycle.left_out, done);
        // Cycles that were missed because poll() itself was late are not repeated.
    }
}

}  // namespace margay
