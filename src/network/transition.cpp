#include "network/transition.hpp"

#include "network/boot.hpp"
#include "network/hooks.hpp"
#include "network/mailbox_setup.hpp"
#include "network/startup.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

struct Row {
    Transition transition;
    AlState from;
    AlState to;
    std::string_view initials;
};
constexpr std::array kRows{
    Row{Transition::init_to_preop, AlState::init, AlState::preop, "IP"},
    Row{Transition::preop_to_safeop, AlState::preop, AlState::safeop, "PS"},
    Row{Transition::safeop_to_op, AlState::safeop, AlState::op, "SO"},
    Row{Transition::op_to_safeop, AlState::op, AlState::safeop, "OS"},
    Row{Transition::op_to_preop, AlState::op, AlState::preop, "OP"},
    Row{Transition::op_to_init, AlState::op, AlState::init, "OI"},
    Row{Transition::safeop_to_preop, AlState::safeop, AlState::preop, "SP"},
    Row{Transition::safeop_to_init, AlState::safeop, AlState::init, "SI"},
    Row{Transition::preop_to_init, AlState::preop, AlState::init, "PI"},
    Row{Transition::init_to_boot, AlState::init, AlState::boot, "IB"},
    Row{Transition::boot_to_init, AlState::boot, AlState::init, "BI"},
};

const Row* row_of(Transition which) {
    const auto row = std::ranges::find_if(kRows, [&](const Row& r) { return contains(which, r.transition); });
    return row == kRows.end() ? nullptr : &*row;
}

bool goes_up(Transition which) {
    return contains(
        Transition::init_to_preop | Transition::preop_to_safeop | Transition::safeop_to_op | Transition::init_to_boot,
        which);
}

bool concerns(const Slave& slave, Transition which, Moment moment) {
    return which != Transition::none &&
           (static_cast<bool>(slave.hooks.transition) || has_commands(slave, which, moment));
}

Task<Result<>> follow_transition(Network& network, Slave& slave) {
    const SlaveToken token(network.marks(slave));
    Settling settling(slave.number);
    network.settlings.push_back(settling);
    const Transition which = std::exchange(network.marks(slave).requested, Transition::none);
    auto after = co_await around_transition(network, slave, which, Moment::after);
    if (!after) network.note(slave, after.error());
    co_return Nothing{};
}

}  // namespace

Transition transition(AlState from, AlState to) {
    const auto row = std::ranges::find_if(kRows, [&](const Row& r) { return r.from == from && r.to == to; });
    return row == kRows.end() ? Transition::none : row->transition;
}

std::string_view initials(Transition one) {
    const Row* row = row_of(one);
    return row == nullptr ? "" : row->initials;
}

// There is nothing after the transition (any more).
static void nothing_follows(SlaveMarks& marks, Transition which) {
    if (marks.unfinished == which) marks.unfinished = Transition::none;
}

// While what follows a transition to a higher state executes. If it fails or is cut, the slave is in its state without
// it. Transition::none: nothing is marked.
class Following {
  public:
    Following(SlaveMarks& marks, Transition which) : marks_(marks), which_(which) {
        marks_.following = which != Transition::none;
    }
    Following(const Following&) = delete;
    Following& operator=(const Following&) = delete;
    ~Following() {
        if (which_ == Transition::none) return;
        marks_.following = false;
        if (succeeded)
            nothing_follows(marks_, which_);
        else
            marks_.unfinished = which_;
    }
    bool succeeded = false;

  private:
    SlaveMarks& marks_;
    Transition which_;
};

Task<Result<>> around_transition(Network& network, Slave& slave, Transition which, Moment moment) {
    if (!concerns(slave, which, moment)) {
        if (moment == Moment::after) nothing_follows(network.marks(slave), which);
        co_return Nothing{};
    }
    const bool up = goes_up(which);
    Following following(network.marks(slave), up && moment == Moment::after ? which : Transition::none);
    Result<> done;
    if (has_commands(slave, which, moment))
        done = co_await slave.config.setup->startup.part()->run(network, slave, which, moment);
    if (!done && !up) network.note(slave, done.error());
    if (slave.hooks.transition && (done || !up)) {
        done = co_await call_hook(network, slave, which, moment);
        if (!done && !up) network.note(slave, done.error());
    }
    following.succeeded = done.ok();
    co_return up ? done : Result<>();
}

void mark_unfinished(Network& network, Slave& slave, Transition which) {
    if (goes_up(which) && concerns(slave, which, Moment::after)) network.marks(slave).unfinished = which;
}

bool is_unfinished(const Network& network, const Slave& slave) {
    const Row* row = row_of(network.marks(slave).unfinished);
    return row != nullptr && slave.al.state >= row->to;
}

Task<Result<AlStatus>> change_state(Network& network, Slave& slave, AlState state, Time until) {
    const Error refused = refusal(network, slave, state);
    if (refused.code != Errc::none) co_return refused;
    co_return co_await bring_to_state(network, slave, state, until);
}

Task<Result<AlStatus>> bring_to_state(Network& network, Slave& slave, AlState state, Time until) {
    const Station station = network.station(slave);
    if (limited(slave, state) != state) co_return above_highest(slave, state);
    if (slave.al.state == AlState::none) {
        auto now = co_await read_al_status(station);
        if (!now) co_return now;
        slave.al = *now;
    }
    if (crosses_boot(network, slave, state)) {
        if (network.boot == nullptr) co_return boot_refusal(network, slave);
        auto prepared = co_await network.boot->prepare(network, slave, state, until);
        if (!prepared) co_return prepared.error();
    }
    const AlState from = slave.al.state;
    const Transition which = transition(from, state);
    if (concerns(slave, which, Moment::before)) {
        auto before = co_await around_transition(network, slave, which, Moment::before);
        if (!before) co_return before.error();
    }
    // A state that was requested without waiting, and reached since: what follows is still to be done.
    const Transition before_this = std::exchange(network.marks(slave).requested, Transition::none);
    const Row* reached = row_of(before_this);
    const bool pending = which == Transition::none && reached != nullptr && reached->to == state;
    const Transition follows = pending ? before_this : which;
    mark_unfinished(network, slave, follows);
    const Time now = network.engine.now();
    const Duration patience = until == kNever ? al_timeout(slave, state) : std::max(until - now, Duration{1});
    auto changed = co_await change_al_state_from(station, slave.al, state, slave.device_emulation, patience);
    if (!changed) {
        auto seen = co_await read_al_status(station);
        update_al_status(slave.al, seen);
        co_return changed;
    }
    slave.al = *changed;
    if (network.boot != nullptr) network.boot->reached(network, slave, from, state);
    if (concerns(slave, follows, Moment::after)) {
        auto after = co_await around_transition(network, slave, follows, Moment::after);
        if (!after) co_return after.error();
    } else {
        nothing_follows(network.marks(slave), follows);
    }
    co_return changed;
}

void settle_request(Network& network, Slave& slave) {
    const Row* row = row_of(network.marks(slave).requested);
    const bool met = row != nullptr && slave.al.state == row->to && !slave.al.error;
    if (met && network.boot != nullptr) network.boot->reached(network, slave, row->from, row->to);
    if (!met || network.marks(slave).in_use || network.segment_in_use) return;
    network.settling_since = network.engine.now();
    Task<Result<>> task = follow_transition(network, slave);
    const std::coroutine_handle<> handle = task.handle();
    (void)network.settling.start(std::move(task));
    if (Settling* begun = find_settling(network, slave)) begun->sequence = handle;
}

Settling* find_settling(Network& network, const Slave& slave) {
    for (Settling* s = network.settlings.front(); s != nullptr; s = network.settlings.after(*s))
        if (s->slave == slave.number) return s;
    return nullptr;
}

void end_settling(Network& network) {
    while (Settling* settling = network.settlings.front()) {
        network.slave_of_cut_hook = 0;
        settling->sequence.destroy();
        if (const std::uint16_t number = network.slave_of_cut_hook; number != 0)
            network.note(network.slave(number),
                         {.code = Errc::timeout, .step = Step::application_hook, .slave = number});
    }
}

bool crosses_boot(Network& network, const Slave& slave, AlState to) {
    const AlState from = slave.al.state;
    if (to == AlState::boot) return from != AlState::boot;
    if (network.boot == nullptr || to == AlState::init) return false;
    if (from == AlState::boot) return true;
    return from == AlState::init && to == AlState::preop && uses_mailbox(slave) && network.has_mailbox(slave) &&
           !network.mailbox(slave).is_open();
}

Error boot_refusal(const Network& network, const Slave& slave) {
    if (network.boot != nullptr && slave.boot_mailbox.present()) return {};
    return {.code = Errc::unsupported, .step = Step::request_state, .slave = slave.number};
}

Error above_highest(const Slave& slave, AlState state) {
    return {.code = Errc::above_highest,
            .step = Step::request_state,
            .slave = slave.number,
            .expected = static_cast<std::uint32_t>(slave.config.highest),
            .actual = static_cast<std::uint32_t>(state)};
}

Duration al_timeout(const Slave& slave, AlState state) {
    const SlaveTimes times = slave.config.times();
    const bool down = slave.al.state > state || state == AlState::init;
    const Duration own = down                       ? times.down
                         : state == AlState::safeop ? times.to_safeop
                         : state == AlState::op     ? times.to_op
                                                    : times.to_preop;
    return own > Duration{0} ? own : default_al_timeout(down ? AlState::init : state);
}

AlState limited(const Slave& slave, AlState wanted) {
    const bool process = wanted == AlState::safeop || wanted == AlState::op;
    return process && wanted > slave.config.highest ? slave.config.highest : wanted;
}

}  // namespace margay
