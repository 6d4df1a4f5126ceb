#include "network/transition.hpp"

#include "network/attempts.hpp"
#include "network/boot.hpp"
#include "network/hooks.hpp"
#include "network/mailbox_setup.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/search.hpp"
#include "network/settings.hpp"
#include "network/startup.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <margay/features.hpp>

#include <algorithm>
#include <optional>
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

// A slave that has gone from INIT to PREOP has forgotten what its mailbox protocols did before: transfers of that time
// end.
void mailbox_starts(Network& network, Slave& slave, Transition which) {
    if (which == Transition::init_to_preop) open_mailbox(network, slave, slave.mailbox);
}

Task<Result<>> follow_transition(Network& network, Slave& slave) {
    const SlaveToken token(network.marks(slave));
    SlaveWork work(slave.number, network.engine.now());
    network.works.push_back(work);
    const Transition which = std::exchange(network.marks(slave).requested, Transition::none);
    mailbox_starts(network, slave, which);
    if (goes_up(which)) work.upwards_to = slave.al.state;
    auto after = co_await around_transition(network, slave, which, Moment::after);
    if (!after) network.note(slave, after.error());
    co_return Nothing{};
}

}  // namespace

Transition transition(AlState from, AlState to) {
    const auto row = std::ranges::find_if(kRows, [&](const Row& r) { return r.from == from && r.to == to; });
    return row == kRows.end() ? Transition::none : row->transition;
}

Error left_out_state(const Slave& slave, AlState from, AlState to) {
    const bool upwards = from != AlState::none && from != AlState::boot && to > from;
    if (!slave.device_emulation || !upwards || transition(from, to) != Transition::none) return {};
    return {.code = Errc::other_state,
            .step = Step::request_state,
            .slave = slave.number,
            .expected = static_cast<std::uint32_t>(to == AlState::op ? AlState::safeop : AlState::preop),
            .actual = static_cast<std::uint32_t>(from)};
}

std::string_view initials(Transition one) {
    const Row* row = row_of(one);
    return row == nullptr ? "" : row->initials;
}

// The commands and the hook after the transition have ended, or there are none.
static void nothing_follows(SlaveMarks& marks, Transition which) {
    if (marks.unfinished == which) marks.unfinished = Transition::none;
}

// Exists while the commands and the hook after a transition execute. If they fail or are cut after a transition to a
// higher state, the slave is in its state without them.
class Following {
  public:
    Following(SlaveMarks& marks, Transition which) : marks_(marks), which_(which) { marks_.following = true; }
    Following(const Following&) = delete;
    Following& operator=(const Following&) = delete;
    ~Following() {
        marks_.following = false;
        if (succeeded)
            nothing_follows(marks_, which_);
        else if (goes_up(which_))
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
    if (SlaveWork* work = find_work(network, slave); work != nullptr && up)
        work->upwards_to = std::max(work->upwards_to, row_of(which)->to);
    const WorkLimit limit(network, slave.number);
    std::optional<Following> following;
    if (moment == Moment::after) following.emplace(network.marks(slave), which);
    Result<> done;
    if (has_commands(slave, which, moment))
        done = co_await slave.config.setup->startup.part()->run(network, slave, which, moment);
    if (!done && !up) network.note(slave, done.error());
    if (slave.hooks.transition && (done || !up)) {
        done = co_await call_hook(slave.hooks.transition, network, slave, which, moment);
        if (!done && !up) network.note(slave, done.error());
    }
    if (following) following->succeeded = done.ok();
    co_return up ? done : Result<>();
}

void mark_unfinished(Network& network, Slave& slave, Transition which) {
    // The mailbox is opened after the transition.
    const bool opens = which == Transition::init_to_preop && uses_mailbox(slave);
    if (opens || (goes_up(which) && concerns(slave, which, Moment::after))) network.marks(slave).unfinished = which;
}

bool is_unfinished(const Network& network, const Slave& slave) {
    const Row* row = row_of(network.marks(slave).unfinished);
    if (row == nullptr) return false;
    const bool boot = row->to == AlState::boot || slave.al.state == AlState::boot;  // BOOT is not above another state
    return boot ? slave.al.state == row->to : slave.al.state >= row->to;
}

bool doubt_after_hook(Network& network, Slave& slave, Time begun) {
    const bool stale = !network.supervised && later(begun, Network::kBelieved) < network.engine.now();
    if (stale && is_known(slave)) network.marks(slave).doubt(false);
    return network.marks(slave).unproved;
}

Task<Result<AlStatus>> change_state(Network& network, Slave& slave, AlState state, Time until) {
    const Error refused = refusal(network, slave, state);
    if (refused.code != Errc::none) co_return refused;
    co_return co_await required(bring_to_state(network, slave, state, until));
}

Task<Result<AlStatus>> bring_to_state(Network& network, Slave& slave, AlState state, Time until) {
    const Station station = network.station(slave);
    if (limited(slave, state) != state) co_return above_highest(slave, state);
    if (slave.al.state == AlState::none) {
        const auto now = co_await required(read_al_status(station));
        slave.al = now;
    }
    if (crosses_boot(network, slave, state)) {
        if (network.boot == nullptr) co_return boot_refusal(network, slave);
        co_await required(network.boot->prepare(network, slave, state, until));
        co_await required(prove_before_request(network, slave, state));
    }
    const AlState from = slave.al.state;
    const Transition which = transition(from, state);
    const Error left_out = left_out_state(slave, from, state);
    if (left_out.code != Errc::none) co_return left_out;
    const Time begun = network.engine.now();
    if (network.marks(slave).requested != Transition::none) {
        co_await required(finish_requested(network, slave, which));
    }
    if (concerns(slave, which, Moment::before)) {
        co_await required(around_transition(network, slave, which, Moment::before));
    }
    if (doubt_after_hook(network, slave, begun)) {
        co_await required(prove_before_request(network, slave, state));
    }
    mark_unfinished(network, slave, which);
    const Time now = network.engine.now();
    const Duration patience = until == kNever ? al_timeout(slave, state) : std::max(until - now, Duration{1});
    if (slave.takes_part) network.marks(slave).uncertain = state < AlState::safeop;
    auto changed = co_await change_al_state_from(station, slave.al, state, slave.device_emulation, patience);
    const AlState before = slave.al.state;
    if (!changed) {
        auto seen = co_await read_al_status(station);
        update_al_status(slave.al, seen);
        if (slave.takes_part && seen) network.marks(slave).uncertain = false;
        update_mailbox(network, slave);
        co_return changed;
    }
    slave.al = *changed;
    if (slave.takes_part) network.marks(slave).uncertain = false;
    note_reached(network, slave, before);
    update_mailbox(network, slave);
    mailbox_starts(network, slave, which);
    if (network.boot != nullptr) network.boot->reached(network, slave, from, state);
    // After BOOT, the new firmware of the slave runs now, and the identity may have changed.
    if (network.marks(slave).from_boot && state == AlState::preop) {
        co_await required(prove_before_request(network, slave, state));
    }
    if (concerns(slave, which, Moment::after)) {
        const Time reached = network.engine.now();
        co_await required(around_transition(network, slave, which, Moment::after));
        if (doubt_after_hook(network, slave, reached)) {
            co_await required(prove_before_request(network, slave, state));
        }
    } else {
        nothing_follows(network.marks(slave), which);
        if (is_unfinished(network, slave)) co_return unfinished_error(network, slave);
    }
    co_return changed;
}

void settle_request(Network& network, Slave& slave) {
    const Row* row = row_of(network.marks(slave).requested);
    const bool met = row != nullptr && slave.al.state == row->to && !slave.al.error;
    if (met && network.boot != nullptr) network.boot->reached(network, slave, row->from, row->to);
    // The commands and the hook must not reach another slave. So they wait until the identity was compared, and the
    // next reading after that starts them.
    if (!met || network.is_doubted(slave) || network.marks(slave).in_use || network.segment_in_use) return;
    const TaskReference task = follow_transition(network, slave);
    (void)network.settling.start(task);
    if (SlaveWork* begun = find_work(network, slave)) begun->sequence = task;
}

bool is_settling(const Network& network, const Slave& slave) {
    const SlaveMarks& marks = network.marks(slave);
    if (marks.following) return true;
    const Row* row = row_of(marks.requested);
    return row != nullptr && slave.al.state == row->to && !slave.al.error &&
           concerns(slave, marks.requested, Moment::after);
}

Error unfinished_error(const Network& network, const Slave& slave) {
    if (!is_settling(network, slave)) return start_up_refusal(network, slave);
    return {.code = Errc::start_up_unfinished,
            .step = network.marks(slave).in_hook ? Step::application_hook : Step::request_state,
            .slave = slave.number,
            .expected = static_cast<std::uint32_t>(slave.al.state),
            .actual = static_cast<std::uint32_t>(slave.al.state)};
}

Task<Result<>> finish_requested(Network& network, Slave& slave, Transition next) {
    const bool pending = is_settling(network, slave);
    const bool on_its_way = awaited_state(network, slave) != slave.al.state;
    const Row* row = row_of(network.marks(slave).requested);
    if (row != nullptr && slave.al.state == row->to) mailbox_starts(network, slave, row->transition);
    const Transition requested = std::exchange(network.marks(slave).requested, Transition::none);
    if (next != Transition::none && !goes_up(next)) co_return Nothing{};
    // The commands and the hook cannot be executed in this state.
    if (on_its_way) mark_unfinished(network, slave, requested);
    if (!pending) co_return Nothing{};
    co_return co_await required(around_transition(network, slave, requested, Moment::after));
}

AlState awaited_state(const SlaveMarks& marks, const Slave& slave) {
    const Row* row = slave.al.error ? nullptr : row_of(marks.requested);
    return row == nullptr || slave.al.state != row->from ? slave.al.state : row->to;  // the slave may have fallen since
}

bool is_requested(const Network& network, const Slave& slave, AlState state) {
    const Row* row = row_of(network.marks(slave).requested);
    return row != nullptr && row->to == state;
}

WorkLimit::WorkLimit(Network& network, std::uint16_t slave) : work_(find_work(network, network.slave(slave))) {
    if (work_ != nullptr && work_->since != kNever) work_ = nullptr;
    if (work_ != nullptr) work_->since = network.engine.now();
}

SlaveWork* find_work(Network& network, const Slave& slave) {
    for (SlaveWork* work = network.works.front(); work != nullptr; work = network.works.after(*work))
        if (work->slave == slave.number) return work;
    return nullptr;
}

void end_work(Network& network, SlaveWork& work) {
    Slave& slave = network.slave(work.slave);
    SlaveMarks& marks = network.marks(slave);
    Error error{.code = Errc::timeout, .step = Step::application_hook, .slave = slave.number};
    if (!marks.in_hook) error.step = Step::request_state;
    if (!marks.in_hook && marks.following) error = unfinished_error(network, slave);
    TaskAccess::end(work.sequence);
    if (!network.supervised) return network.note(slave, error);
    report_failure(network, slave, slave.al, error);
    if (marks.attempts == 0) marks.attempts = 1;
}

void drop_work(Network& network, const Slave& slave) {
    if (SlaveWork* work = find_work(network, slave)) TaskAccess::end(work->sequence);
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
    Error error{.code = Errc::unsupported, .step = Step::request_state, .slave = slave.number};
    if (network.boot == nullptr) error.detail = static_cast<std::uint32_t>(Feature::boot);
    return error;
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
    // config_map() and what_is_wrong() refuse all other values.
    const AlState highest = is_highest(slave.config.highest) ? slave.config.highest : AlState::preop;
    return process && wanted > highest ? highest : wanted;
}

}  // namespace margay
