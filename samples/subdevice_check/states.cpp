// The EtherCAT state machine: every transition that exists, every one that does not, and the AL status codes.
#include "subdevice_check/check.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::AlStatusCode;
constexpr unsigned kAcknowledge = wire::al::kErrorAcknowledge;
constexpr Duration kSlow = 100ms;
constexpr unsigned kReservedStatus = 0xC0;
constexpr Duration kAnswersId = 500ms;  // a slow slave answers a request for its ID, and the end of the request

unsigned word(AlState state) { return static_cast<unsigned>(state); }

void needs_state_machine(Bench& bench) {
    if (bench.emulation()) bench.skip("the ESC mirrors AL control (0x0141 bit 0): there is no state machine");
}

std::string transition_text(AlState from, AlState to) { return state_text(from) + " to " + state_text(to); }

// One step of the way up, with its time.
enum class Step { done, failed, again };
Step step_up(Bench& bench, AlState from, AlState to) {
    const Time begun = bench.now();
    const auto status = bench.go(to);
    const auto took = bench.now() - begun;
    if (bench.wants_clock(status)) return Step::again;
    if (bench.no_cycle_suits(status)) bench.skip_without_cycle(status);
    if (status.state != to || status.error) {
        bench.fail(fmt::format("{}: the slave is in {} after {} ms, with everything configured as its SII says",
                               transition_text(from, to), status_text(status), took / 1ms));
        return Step::failed;
    }
    if (const auto word = bench.read<std::uint16_t>(reg::kAlStatus.address); (word & kReservedStatus) != 0)
        bench.fail(fmt::format("{}: the AL status is 0x{:04x}, and bits 6 and 7 are reserved",
                               transition_text(from, to), word),
                   "ETG.1000.6, AL Status");
    if (status.code != 0)
        bench.fail(
            fmt::format("{}: the AL status code is 0x{:04x} without an error", transition_text(from, to), status.code),
            "ETG.1000.6, AL Status Code");
    if (took > kSlow)
        bench.remark(fmt::format("{} took {} ms", transition_text(from, to), took / 1ms),
                     "ETG.2000, StateMachine/Timeout");
    return Step::done;
}

void check_up(Session& session) {
    auto& bench = session.bench;
    for (auto step = Step::again; step == Step::again;) {  // again: a slave that needs the clock
        bench.reset();
        bench.configure_mailboxes();
        bench.give_eeprom(true);
        step = step_up(bench, AlState::init, AlState::preop);
        if (step != Step::done) continue;
        session.mail.restarted();
        bench.configure_process_data();
        step = step_up(bench, AlState::preop, AlState::safeop);
        if (step == Step::done) step = step_up(bench, AlState::safeop, AlState::op);
    }
}

void check_down(Session& session) {
    auto& bench = session.bench;
    constexpr std::pair<AlState, AlState> kWays[] = {
        {AlState::op, AlState::safeop},    {AlState::op, AlState::preop},    {AlState::op, AlState::init},
        {AlState::safeop, AlState::preop}, {AlState::safeop, AlState::init}, {AlState::preop, AlState::init}};
    for (const auto& [from, to] : kWays) {
        bench.enter(from);
        const auto frames = bench.frames_in(from);  // so that the watchdog does not end OP before a slow slave does
        const auto status = bench.go(to);
        if (status.state != to || status.error)
            bench.fail(fmt::format("{}: the slave is in {}", transition_text(from, to), status_text(status)));
    }
}

void check_same(Session& session) {
    auto& bench = session.bench;
    for (const auto state : {AlState::init, AlState::preop, AlState::safeop, AlState::op}) {
        bench.enter(state);
        const auto frames = bench.frames_in(state);
        bench.request(word(state));
        const auto status = bench.unchanged();
        if (status != AlStatus{state, false, 0})
            bench.fail(fmt::format("a request for {} in {} led to {}", state_text(state), state_text(state),
                                   status_text(status)));
    }
}

// The status after an acknowledge, which the slave may need some time for.
AlStatus settled(Bench& bench, const AlStatus& expected) {
    const auto there = [&] { return bench.al_status() == expected; };
    if (expected.state == AlState::op) {
        (void)bench.run(500ms, there);
    } else {
        for (const Time until = bench.now() + 500ms; !there() && bench.now() < until;) bench.wait(1ms);
    }
    return bench.al_status();
}

// The slave must keep its state and set an AL status code. Returns the time until the code was set.
Duration expect_request_refused(Bench& bench, AlState state, unsigned requested, const std::vector<AlStatusCode>& codes,
                                const std::string& what) {
    const auto frames = bench.frames_in(state);
    const Time begun = bench.now();
    bench.request(requested);
    const auto status = bench.refused();
    const auto took = bench.now() - begun;
    if (status.state != state) {
        bench.fail(fmt::format("{}: the slave went to {}", what, status_text(status)));
    } else if (!status.error) {
        bench.fail(
            fmt::format("{}: the slave stays in {} and does not set the error indication", what, state_text(state)));
    } else if (std::ranges::find(codes, static_cast<AlStatusCode>(status.code)) == codes.end()) {
        bench.fail(fmt::format("{}: the AL status code is 0x{:04x} ({}), expected 0x{:04x} ({})", what, status.code,
                               wire::al_status_text(status.code), static_cast<unsigned>(codes.front()),
                               wire::to_text(codes.front())),
                   "ETG.1000.6, table AL Status Codes");
    }
    bench.request(word(status.state) | kAcknowledge);
    (void)settled(bench, {status.state, false, 0});
    return status.error ? took : Duration{};
}

void remark_slow_refusal(Bench& bench, Duration slowest) {
    if (slowest > kSlow)
        bench.remark(fmt::format("the error indication came up to {} ms after the request", slowest / 1ms),
                     "ETG.2000, StateMachine/Timeout");
}

void check_skipped(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    constexpr std::pair<AlState, AlState> kWays[] = {
        {AlState::init, AlState::safeop}, {AlState::init, AlState::op}, {AlState::preop, AlState::op}};
    Duration slowest{};
    for (const auto& [from, to] : kWays) {
        bench.enter(from);
        slowest = std::max(slowest,
                           expect_request_refused(bench, from, word(to), {AlStatusCode::invalid_requested_state_change},
                                                  transition_text(from, to)));
    }
    remark_slow_refusal(bench, slowest);
}

void check_unknown(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    std::vector states{AlState::init, AlState::preop, AlState::safeop, AlState::op};
    if (bench.slave().boot_mailbox.present()) states.push_back(AlState::boot);
    for (const auto state : states) {
        bench.enter(state);
        for (const unsigned value : {0U, 5U, 6U, 7U, 9U, 15U}) {
            if (bench.al_status().state != state) bench.enter(state);  // the previous request has led to another state
            (void)expect_request_refused(bench, state, value, {AlStatusCode::unknown_requested_state},
                                         fmt::format("the state {} requested in {}", value, state_text(state)));
        }
    }
}

void check_boot(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    const auto invalid = AlStatusCode::invalid_requested_state_change;
    const auto unsupported = AlStatusCode::bootstrap_not_supported;
    const bool boot = bench.slave().boot_mailbox.present();
    for (const auto from : {AlState::preop, AlState::safeop, AlState::op}) {
        bench.enter(from);
        (void)expect_request_refused(bench, from, word(AlState::boot),
                                     boot ? std::vector{invalid} : std::vector{unsupported, invalid},
                                     transition_text(from, AlState::boot));
    }
    if (!boot) {
        bench.enter(AlState::init);
        (void)expect_request_refused(bench, AlState::init, word(AlState::boot),
                                     {unsupported, AlStatusCode::unknown_requested_state},
                                     "INIT to BOOT without a bootstrap mailbox in the SII");
        return;
    }
    for (const auto to : {AlState::preop, AlState::safeop, AlState::op}) {
        bench.enter(AlState::boot);
        (void)expect_request_refused(bench, AlState::boot, word(to), {invalid}, transition_text(AlState::boot, to));
    }
    bench.enter(AlState::boot);
    const auto status = bench.go(AlState::init);
    if (status.state != AlState::init || status.error)
        bench.fail(fmt::format("BOOT to INIT: the slave is in {}", status_text(status)));
}

// A refused request for a state that does not exist, so that the error indication is set in `state`. Skips the check
// when the slave does not refuse it there.
AlStatus provoke(Bench& bench, AlState state) {
    bench.enter(state);
    const auto frames = bench.frames_in(state);
    bench.request(5);
    const auto status = bench.refused();
    if (status.state != state || !status.error)
        bench.skip(fmt::format("no error indication could be provoked in {} (states.unknown)", state_text(state)));
    return status;
}

void check_acknowledge(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    (void)provoke(bench, AlState::preop);
    bench.request(word(AlState::preop) | kAcknowledge);
    const auto status = settled(bench, {AlState::preop, false, 0});
    if (status.error || status.state != AlState::preop)
        bench.fail(fmt::format("an acknowledge in PREOP + ERROR led to {}", status_text(status)));
    else if (status.code != 0)
        bench.fail(fmt::format("after the acknowledge the AL status code is still 0x{:04x}", status.code),
                   "ETG.1000.6, AL Status Code");
    // In the other states, too.
    for (const auto state : {AlState::init, AlState::safeop, AlState::op, AlState::boot}) {
        if (state == AlState::boot && !bench.slave().boot_mailbox.present()) continue;
        (void)provoke(bench, state);
        const auto frames = bench.frames_in(state);
        bench.request(word(state) | kAcknowledge);
        const auto cleared = settled(bench, {state, false, 0});
        if (cleared != AlStatus{state, false, 0})
            bench.fail(fmt::format("an acknowledge in {} + ERROR led to {}", state_text(state), status_text(cleared)));
    }
    // The acknowledge comes with a request for another state, which is executed.
    constexpr std::pair<AlState, AlState> kWays[] = {
        {AlState::preop, AlState::safeop}, {AlState::safeop, AlState::preop}, {AlState::safeop, AlState::op}};
    for (const auto& [from, to] : kWays) {
        (void)provoke(bench, from);
        if (from == AlState::preop) bench.configure_process_data();
        bench.request(word(to) | kAcknowledge);
        const auto done = [&] { return bench.al_status() == AlStatus{to, false, 0}; };
        if (!bench.run(Bench::patience(to), done) && !bench.wants_clock(bench.al_status()))
            bench.fail(fmt::format("a request for {} with an acknowledge in {} + ERROR led to {}", state_text(to),
                                   state_text(from), status_text(bench.al_status())));
    }
    bench.enter(AlState::preop);
    bench.request(word(AlState::preop) | kAcknowledge);
    if (const auto none = bench.unchanged(); none != AlStatus{AlState::preop, false, 0})
        bench.fail(fmt::format("an acknowledge without an error led to {}", status_text(none)));
}

void check_error_stays(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    const auto before = provoke(bench, AlState::preop);
    bench.configure_process_data();
    bench.request(word(AlState::safeop));
    bench.wait(50ms);
    const auto status = bench.al_status();
    if (status.state != AlState::preop)
        bench.fail(
            fmt::format("a request for SAFEOP without an acknowledge in PREOP + ERROR led to {}", status_text(status)));
    else if (!status.error)
        bench.fail("a request without an acknowledge has cleared the error indication");
    else if (status.code != before.code)
        bench.remark(fmt::format("a request that was not executed changed the AL status code from 0x{:04x} to 0x{:04x}",
                                 before.code, status.code));
    (void)provoke(bench, AlState::safeop);
    bench.request(word(AlState::op));
    (void)bench.run(100ms);
    if (const auto after = bench.al_status(); after.state != AlState::safeop || !after.error)
        bench.fail(
            fmt::format("a request for OP without an acknowledge in SAFEOP + ERROR led to {}", status_text(after)));
}

void check_init_clears(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    (void)provoke(bench, AlState::preop);
    const Time begun = bench.now();
    bench.request(word(AlState::init) | kAcknowledge);
    auto status = bench.al_status();
    while (status != AlStatus{AlState::init, false, 0} && bench.now() - begun < Bench::patience(AlState::init)) {
        bench.wait(1ms);
        status = bench.al_status();
    }
    if (status != AlStatus{AlState::init, false, 0})
        bench.fail(fmt::format("INIT with an acknowledge in PREOP + ERROR led to {}", status_text(status)));
}

void check_device_id(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    if (bench.slave().device_id_source != DeviceIdSource::al_status)
        bench.skip("the SII does not announce an explicit device ID in the AL status code");
    bench.enter(AlState::preop);
    bench.request(word(AlState::preop) | wire::al::kDeviceIdentification);
    bool answered = false;
    std::uint16_t id = 0;
    for (const Time until = bench.now() + kAnswersId; bench.now() < until && !answered; bench.wait(1ms)) {
        answered = (bench.read<std::uint16_t>(reg::kAlStatus.address) & wire::al::kDeviceIdentification) != 0;
        id = bench.read<std::uint16_t>(reg::kAlStatusCode.address);
    }
    if (!answered) bench.fail("the slave does not answer the request for its ID in the AL status (bit 5)");
    if (answered && id == 0) bench.remark("the explicit device ID is 0: the selector is not set");
    bench.request(word(AlState::preop));
    const auto stays = [&] {
        return (bench.read<std::uint16_t>(reg::kAlStatus.address) & wire::al::kDeviceIdentification) != 0 ||
               bench.al_status().code != 0;
    };
    for (const Time until = bench.now() + kAnswersId; stays() && bench.now() < until;) bench.wait(1ms);
    if (stays()) bench.fail("the ID stays in the AL status code after the request has ended");
}

void check_again(Session& session) {
    auto& bench = session.bench;
    for (int n = 1; n <= 3; ++n) {
        bench.reset();
        bench.configure_mailboxes();
        bench.give_eeprom(true);
        if (const auto status = bench.go(AlState::preop); status.state != AlState::preop || status.error) {
            bench.fail(fmt::format("start {} of 3: the slave is in {}", n, status_text(status)));
            return;
        }
    }
}

// SAFEOP and OP a second time, without INIT in between.
void check_up_again(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    for (const auto down : {AlState::safeop, AlState::preop}) {
        bench.enter(AlState::op);
        if (const auto status = bench.go(down, false); status.state != down || status.error) continue;  // states.down
        std::vector<AlState> way{AlState::op};
        if (down == AlState::preop) {
            way.insert(way.begin(), AlState::safeop);
            bench.configure_process_data();
        }
        for (const auto to : way) {
            const auto status = bench.go(to);
            if (status.state == to && !status.error) continue;
            bench.fail(fmt::format("OP to {} and up again: the slave is in {}", state_text(down), status_text(status)));
            break;
        }
    }
}

// A master that keeps the EEPROM is allowed; some devices need it in INIT to PREOP and say so by 0x0050.
void check_eeprom_kept(Session& session) {
    auto& bench = session.bench;
    needs_state_machine(bench);
    bench.reset();
    bench.configure_mailboxes();
    const auto status = bench.go(AlState::preop);
    if (!status.error) return;
    if (status.code == static_cast<std::uint16_t>(AlStatusCode::eeprom_no_access))
        bench.remark("the slave refuses PREOP (0x0050) while the master has the EEPROM");
    else
        bench.fail(fmt::format("without access to the EEPROM the slave is in {}", status_text(status)));
}

constexpr std::string_view kMachine = "ETG.1000.6, EtherCAT State Machine";

constexpr Check kStateChecks[] = {
    {"states.up", "INIT, PREOP, SAFEOP, OP in the times of the ESI", kMachine, check_up},
    {"states.down", "all transitions to lower states", kMachine, check_down},
    {"states.same", "a request for the present state changes nothing", kMachine, check_same},
    {"states.restart", "INIT and PREOP again and again", kMachine, check_again},
    {"states.up_again", "SAFEOP and OP a second time without INIT", kMachine, check_up_again},
    {"states.skipped", "transitions over a state are refused with 0x0011", kMachine, check_skipped},
    {"states.unknown", "requests for states that do not exist are refused with 0x0012", kMachine, check_unknown},
    {"states.boot", "BOOT only from and to INIT, and only with a bootstrap mailbox", kMachine, check_boot},
    {"states.acknowledge", "the acknowledge clears the error indication and the AL status code",
     "ETG.1000.6, AL Control", check_acknowledge},
    {"states.error_stays", "without an acknowledge, an error stays and no higher state is entered",
     "ETG.1000.6, AL Control", check_error_stays},
    {"states.init_clears", "INIT with an acknowledge clears an error", "ETG.1000.6, AL Control", check_init_clears},
    {"states.device_id", "the explicit device ID in the AL status code", "ETG.1020, Explicit Device Identification",
     check_device_id},
    {"states.eeprom_kept", "PREOP while the master has the EEPROM", "ETG.1000.6, table AL Status Codes",
     check_eeprom_kept},
};

}  // namespace

std::span<const Check> state_checks() { return kStateChecks; }

}  // namespace margay::samples::conformance
