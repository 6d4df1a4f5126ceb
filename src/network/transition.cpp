#include "network/transition.hpp"

#include "network/hooks.hpp"
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
    const Transition which = std::exchange(network.marks(slave).requested, Transition::none);
    auto after = co_await around_transition(network, slave, which, Moment::after);
    if (!after) network.note(slave, after.error());
    co_return Result<>();
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

Task<Result<>> around_transition(Network& network, Slave& slave, Transition which, Moment moment) {
    if (!concerns(slave, which, moment)) co_return Result<>();
    const bool up = goes_up(which);
    auto done = co_await run_commands(network, slave, which, moment);
    if (!done && !up) network.note(slave, done.error());
    if (slave.hooks.transition && (done || !up)) {
        done = co_await call_hook(network, slave, slave.hooks.transition, slave.hooks.user, which, moment);
        if (!done && !up) network.note(slave, done.error());
    }
    co_return up ? done : Result<>();
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
    const Transition which = transition(slave.al.state, state);
    if (concerns(slave, which, Moment::before)) {
        auto before = co_await around_transition(network, slave, which, Moment::before);
        if (!before) co_return before.error();
    }
    network.marks(slave).requested = Transition::none;
    const Time now = network.engine.now();
    const Duration patience = until == kNever ? al_timeout(slave, state) : std::max(until - now, Duration{1});
    auto changed = co_await change_al_state_from(station, slave.al, state, slave.device_emulation, patience);
    if (!changed) {
        auto seen = co_await read_al_status(station);
        update_al_status(slave.al, seen);
        co_return changed;
    }
    slave.al = *changed;
    if (concerns(slave, which, Moment::after)) {
        auto after = co_await around_transition(network, slave, which, Moment::after);
        if (!after) co_return after.error();
    }
    co_return changed;
}

void settle_request(Network& network, Slave& slave) {
    const Row* row = row_of(network.marks(slave).requested);
    const bool met = row != nullptr && slave.al.state == row->to && !slave.al.error;
    if (met && !network.marks(slave).in_use && !network.segment_in_use)
        (void)network.settling.start(follow_transition(network, slave));
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
