#include "network/states.hpp"

#include "network/boot.hpp"
#include "network/coincidence.hpp"
#include "network/doubt.hpp"
#include "network/expectation.hpp"
#include "network/search.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr Duration kFirstPause = std::chrono::microseconds(200);
constexpr Duration kLongestPause = std::chrono::milliseconds(5);
// How long a request is repeated while the program of the slave has not read the previous request, for a caller that
// does not wait for the state. The time is short, because the outputs of the other slaves may stop meanwhile, and their
// watchdogs expire after 100 ms.
constexpr Duration kControlStaysFull = std::chrono::milliseconds(20);

Task<Result<>> read_state(Network& network, Slave& slave, SumConfirmation& confirmation) {
    if (slave.al.state == AlState::none && !slave.seen) co_return Nothing{};  // an expected slave that has not come yet
    auto seen = co_await read_al_status(network.station(slave));
    note_reading(network, slave, seen);
    confirmation.note(slave, seen);
    if (!seen && !does_not_answer(seen.error())) co_return seen.error();
    settle_request(network, slave);
    co_return Nothing{};
}

// Executes the steps before a state is requested. Returns the transition that begins.
Task<Result<Transition>> prepare_request(Network& network, Slave& slave, AlState state) {
    if (crosses_boot(network, slave, state)) {
        if (network.boot == nullptr) co_return boot_refusal(network, slave);
        co_await required(network.boot->prepare(network, slave, state, kNever));
        co_await required(prove_before_request(network, slave, state));
    }
    const AlState awaited = awaited_state(network, slave);
    const Transition which = transition(awaited, state);
    const Error left_out = left_out_state(slave, awaited, state);
    if (left_out.code != Errc::none) co_return left_out;
    const Time begun = network.engine.now();
    co_await required(finish_requested(network, slave, which));
    co_await required(around_transition(network, slave, which, Moment::before));
    if (doubt_after_hook(network, slave, begun)) {
        co_await required(prove_before_request(network, slave, state));
    }
    co_return which;
}

Task<Result<>> write_state(Network& network, Slave& slave, AlState state) {
    const AlState awaited = awaited_state(network, slave);
    const bool on_its_way = awaited == state && awaited != slave.al.state;
    if (!on_its_way) {
        auto which = co_await prepare_request(network, slave, state);
        if (!which) {
            network.note(slave, which.error());
            co_return which.error();
        }
        network.marks(slave).requested = *which;
    }
    if (slave.takes_part && state < AlState::safeop) network.marks(slave).uncertain = true;
    const bool acknowledge = slave.al.error && !slave.device_emulation;
    const auto request =
        static_cast<std::uint16_t>(static_cast<unsigned>(state) | (acknowledge ? wire::al::kErrorAcknowledge : 0U));
    auto written =
        co_await write<std::uint16_t>(network.station(slave), wire::reg::kAlControl, request, Step::request_state);
    if (does_not_answer(written.error()) && slave.al.state != AlState::none)  // the slave answered a moment ago
        written = co_await request_again(network.station(slave), request, Step::request_state, kControlStaysFull);
    if (!written) network.note(slave, written.error());
    co_return written;
}

Task<Result<>> write_state_of_all(Network& network, Slave& slave, AlState state) {
    const bool process = state == AlState::safeop || state == AlState::op;
    if (slave.al.state == AlState::none && (is_optional(slave) || !slave.seen))
        co_return process ? Result<>(missing_error(network, slave)) : Result<>();
    if (process && slave.held) co_return held_error(slave, Step::request_state);
    // The supervision brings the slave to the target of set_target().
    if (network.supervised && slave.target != AlState::none) co_return Nothing{};
    co_await completion(read_anew(network, slave));  // the request itself says whether the slave answers
    co_await required(prove_before_request(network, slave, state));
    if (process && state >= slave.al.state) {
        const Error failed = start_up_refusal(network, slave);
        if (failed.code != Errc::none) co_return failed;
    }
    co_return co_await required(write_state(network, slave, limited(slave, state)));
}

// Keeps the error of the slave with the lowest number.
Task<Result<>> write_and_keep(Network& network, Slave& slave, AlState state, FirstFault& faults) {
    auto written = co_await write_state_of_all(network, slave, state);
    faults.keep(written.error());
    co_return Nothing{};
}

// The lowest state of the slaves. Slaves that are missing and may be missing are left out. Slaves that have reached
// their highest state, if it is below OP, are left out too, unless there are no others.
AlStatus lowest(Network& network) {
    const auto left_out = [&](const Slave& s) {
        const bool tolerated = s.wanted != nullptr && missing_error(network, s).code == Errc::none;
        return s.al.state == AlState::none && (is_optional(s) || tolerated);
    };
    const auto at_its_end = [](const Slave& s) {
        return s.al.state == s.config.highest && s.config.highest != AlState::op;
    };
    const bool all_are =
        std::ranges::all_of(network.slaves(), [&](const Slave& s) { return at_its_end(s) || left_out(s); });
    AlStatus all;
    bool any = false;
    for (const Slave& slave : network.slaves()) {
        if (left_out(slave)) continue;
        const bool counts = all_are || !at_its_end(slave);
        if (counts && (!any || slave.al.state < all.state)) all.state = slave.al.state;
        any |= counts;
        if (!slave.al.error || all.error) continue;
        all.error = true;
        all.code = slave.al.code;
    }
    return all;
}

// The first slave, of all slaves or `slave` alone, whose commands or hooks after a transition have not succeeded.
const Slave* find_unfinished(const Network& network, std::uint16_t slave) {
    for (const Slave& one : network.slaves())
        if ((slave == 0 || slave == one.number) && (is_settling(network, one) || is_unfinished(network, one)))
            return &one;
    return nullptr;
}

// The first slave, of all slaves or `slave` alone, at whose place another device answers.
const Slave* find_exchanged(const Network& network, std::uint16_t slave) {
    for (const Slave& one : network.slaves())
        if ((slave == 0 || slave == one.number) && one.al.state == AlState::none && one.error.code == Errc::other_slave)
            return &one;
    return nullptr;
}

// A scan has begun: the table has other slaves now.
constexpr Error kOtherSlaves{.code = Errc::unstable, .step = Step::read_state};

Task<Result<>> prove_if_there(Network& network, Slave& slave) {
    const bool in_boot = slave.al.state == AlState::boot && network.marks(slave).was_away;
    if (slave.al.state == AlState::none || (!in_boot && !network.is_doubted(slave))) co_return Nothing{};
    // The request that uses the slave has not compared it yet, or the slave is compared when it has left BOOT.
    if (network.marks(slave).in_use || (in_boot && network.boot == nullptr))
        co_return Error{.code = Errc::identity_unread, .step = Step::identify, .slave = slave.number};
    Result<> same;
    {
        const SlaveToken token(network.marks(slave));
        if (in_boot)
            same = co_await network.boot->prove(network, slave);
        else
            same = co_await prove(network, slave);
    }
    // The reading has not started the commands and hooks after a transition, because the slave was in doubt.
    if (same) settle_request(network, slave);
    co_return same;
}

}  // namespace

Task<Result<AlStatus>> read_states(Network& network) {
    const std::uint32_t scans = network.scans;
    SumConfirmation confirmation(network);
    Error first;
    const auto read = [&network, &confirmation](Slave& s) { return read_state(network, s, confirmation); };
    co_await required(for_each_slave(network, read, &first));
    if (network.scans != scans) co_return kOtherSlaves;
    if (first.code != Errc::none) co_return first;
    confirmation.end();
    (void)doubt_after_silence(network);
    network.states_read = network.engine.now();
    // After a pause a reading alone does not show that the slaves are the same.
    if (later(network.compared, Network::kBelieved) >= network.states_read) network.compared = network.states_read;
    co_return lowest(network);
}

Task<Result<AlStatus>> observe_states(Network& network) {
    auto read = co_await read_states(network);
    if (!read || network.supervised) co_return read;
    const std::uint32_t scans = network.scans;
    Error first;
    const auto compare = [&network](Slave& s) { return prove_if_there(network, s); };
    co_await required(for_each_slave(network, compare, &first));
    if (network.scans != scans) co_return kOtherSlaves;
    if (first.code != Errc::none) co_return first;
    co_return lowest(network);
}

Task<Result<>> write_states(Network& network, std::uint16_t slave, AlState state) {
    if (slave != 0) {
        Slave& one = network.slave(slave);
        // The known state may be old. The error is not used, because the request itself finds out whether the slave
        // answers.
        co_await completion(read_anew(network, one));
        co_await required(prove_before_request(network, one, state));
        const Error refused = refusal(network, one, state);
        if (refused.code != Errc::none) co_return refused;
        co_return co_await required(write_state(network, one, state));
    }
    if (network.supervised && state != network.target)
        co_return Error{.code = Errc::supervised,
                        .step = Step::request_state,
                        .expected = static_cast<std::uint32_t>(network.target),
                        .actual = static_cast<std::uint32_t>(state)};
    FirstFault faults;
    const auto write = [&network, state, &faults](Slave& s) { return write_and_keep(network, s, state, faults); };
    co_await required(for_each_slave(network, write));
    if (faults.error().code != Errc::none) co_return faults.error();
    co_return Nothing{};
}

Task<Result<AlStatus>> wait_for_state(Network& network, std::uint16_t slave, AlState state, Time until) {
    const std::uint32_t scans = network.scans;
    Duration pause = kFirstPause;
    for (;;) {
        auto all = co_await observe_states(network);
        // Frames may be lost: the slaves are read again until the timeout.
        const bool over = until == kNever || network.engine.now() >= until;
        if (network.scans != scans) co_return kOtherSlaves;
        if (!all && over) co_return all;
        const AlStatus now = slave == 0 ? *all : network.slave(slave).al;
        const bool reached = now.state == state && !now.error;
        const Slave* unfinished = reached ? find_unfinished(network, slave) : nullptr;
        const Slave* exchanged = over && !reached ? find_exchanged(network, slave) : nullptr;
        if (all && exchanged != nullptr) co_return exchanged->error;
        if (all && unfinished == nullptr && (reached || over)) co_return now;
        // Only the supervision starts a slave again whose commands or hook have failed.
        const bool in_vain = unfinished != nullptr && !network.supervised && !is_settling(network, *unfinished);
        if (all && (over || in_vain)) co_return unfinished_error(network, *unfinished);
        co_await network.engine.sleep_until(std::min(until, network.engine.now() + pause));
        pause = std::min(pause * 2, kLongestPause);
    }
}

}  // namespace margay
