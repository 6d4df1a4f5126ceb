// Process data and their watchdog: OP needs outputs, and ends when they stop.
#include "subdevice_check/check.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::AlStatusCode;

constexpr Duration kUnit = 100us;  // of 0x0420, with the divider 0x0400 = 0x09C2
constexpr Duration kSlack = 50ms;
constexpr Duration kOneBuffer = 500ms;  // also a slow slave handles one buffer within this time

void needs_outputs(Bench& bench) {
    if (bench.emulation()) bench.skip("the ESC mirrors AL control (0x0141 bit 0): there is no state machine");
    bench.enter(AlState::safeop);  // also finds out whether the slave needs the clock
    bench.enter(AlState::preop);
    bench.configure_process_data();
    if (bench.area(true) == nullptr) bench.skip("the slave has no outputs");
}

// From PREOP to OP with this watchdog time. Returns the last status.
AlStatus start_with_time(Bench& bench, std::uint16_t time) {
    for (;;) {
        bench.enter(AlState::preop);
        bench.write<std::uint16_t>(reg::kProcessDataWatchdogTime.address, time);
        bench.configure_process_data();
        auto status = bench.go(AlState::safeop);
        if (status.state == AlState::safeop && !status.error) status = bench.go(AlState::op);
        if (!bench.wants_clock(status)) return status;
    }
}

// A slave with a clock may miss the frames before the watchdog expires.
bool is_sync_error(std::uint16_t code) {
    const auto c = static_cast<AlStatusCode>(code);
    return c == AlStatusCode::synchronization_error || c == AlStatusCode::dc_sync_timeout ||
           c == AlStatusCode::dc_sync_io_error || c == AlStatusCode::pll_error || c == AlStatusCode::fatal_sync_error;
}
bool misses_frames(Bench& bench) {
    const auto status = bench.al_status();
    return bench.uses_clock() && status.error && is_sync_error(status.code);
}

bool watched(Bench& bench) { return (bench.area(true)->setting.control & wire::sm_control::kWatchdogTrigger) != 0; }

void needs_watchdog(Bench& bench) {
    needs_outputs(bench);
    if (!watched(bench)) bench.skip("the SII does not enable the watchdog of the outputs");
}

// Reads inputs and writes no outputs until the slave leaves OP. Returns the time, nullopt if it stays in OP.
std::optional<Duration> until_leaves_op(Bench& bench, Duration longest) {
    const Time begun = bench.now();
    while (bench.now() - begun < longest) {
        if (bench.al_status().state != AlState::op) return bench.now() - begun;
        bench.wait(500us);
    }
    return std::nullopt;
}

void check_exchange(Session& session) {
    auto& bench = session.bench;
    bench.enter(AlState::op);
    if (bench.area(true) == nullptr && bench.area(false) == nullptr) bench.skip("the slave has no process data");
    const bool one_buffer = std::ranges::any_of(
        bench.areas(), [](const auto& area) { return area.setting.length_bytes != 0 && area.setting.mailbox(); });
    (void)bench.run(one_buffer ? kOneBuffer : 100ms);
    const auto missed = bench.cycle().missed();
    const auto cycles = bench.cycle().frames();
    // One buffer takes new data only after the slave has handled the last ones.
    if (missed > (one_buffer ? cycles - 1 : 0U))
        bench.fail(fmt::format("{} of {} cycles were not taken by the SyncManagers", missed, cycles),
                   "ETG.1000.4, SyncManager, buffered mode");
    if (const auto status = bench.al_status(); status.state != AlState::op || status.error)
        bench.fail(fmt::format("after {} cycles in OP the slave is in {}", cycles, status_text(status)));
}

void check_op_needs_outputs(Session& session) {
    auto& bench = session.bench;
    needs_outputs(bench);
    bench.enter(AlState::safeop);
    bench.enter(AlState::preop);  // SAFEOP again, without outputs this time
    bench.configure_process_data();
    if (const auto status = bench.go(AlState::safeop, false); status.state != AlState::safeop || status.error)
        bench.skip(fmt::format("without outputs the slave is in {}", status_text(status)));
    const auto status = bench.go(AlState::op, false);
    if (status.state != AlState::op) return;
    bench.remark("the slave goes to OP without any outputs");
    if (watched(bench) && !until_leaves_op(bench, 1s))
        bench.fail("the watchdog of the outputs is enabled, and the slave stays in OP without any outputs");
}

void check_enabled(Session& session) {
    auto& bench = session.bench;
    needs_outputs(bench);
    if (!watched(bench))
        bench.remark("the SII does not enable the watchdog of the outputs: they stay when the master is gone");
}

// The watchdog of the ESC has not expired: the slave has left OP by a shorter timeout of its own.
bool watchdog_runs(Bench& bench) {
    return (bench.read<std::uint16_t>(reg::kProcessDataWatchdogStatus.address) & 1) != 0;
}
void remark_own_timeout(Bench& bench, Duration left, Duration time) {
    bench.remark(fmt::format(
        "the slave left OP {} ms after the last outputs, before the watchdog time of {} ms: it has a timeout "
        "of its own",
        left / 1ms, time / 1ms));
}

void acknowledge(Bench& bench) {
    bench.request(static_cast<unsigned>(AlState::safeop) | wire::al::kErrorAcknowledge);
    for (const Time until = bench.now() + 500ms; bench.al_status().error && bench.now() < until;) bench.wait(1ms);
}

// The slave must not return to OP with the old outputs, but with new outputs.
void expect_new_outputs(Bench& bench) {
    acknowledge(bench);
    if (const auto old = bench.go(AlState::op, false); old.state == AlState::op)
        bench.fail("after the watchdog has expired the slave goes to OP with the old outputs");
    acknowledge(bench);
    if (const auto fresh = bench.go(AlState::op); fresh.state != AlState::op || fresh.error)
        bench.fail(fmt::format("after the watchdog has expired and new outputs have come the slave is in {}",
                               status_text(fresh)));
}

void check_expires(Session& session) {
    auto& bench = session.bench;
    needs_watchdog(bench);
    bench.enter(AlState::op);
    (void)bench.run(50ms);
    const auto time = kUnit * bench.read<std::uint16_t>(reg::kProcessDataWatchdogTime.address);
    const auto left = until_leaves_op(bench, time + 2s);
    if (!left) {
        bench.fail(
            fmt::format("the outputs stopped, and the slave is still in OP after {} ms; the watchdog time is {} "
                        "ms",
                        (time + 2s) / 1ms, time / 1ms));
        return;
    }
    const bool runs = watchdog_runs(bench);
    const auto status = bench.refused();
    if (misses_frames(bench)) {
        bench.skip(
            fmt::format("the slave uses the clock and misses the frames {} ms after the last one, before the "
                        "watchdog expires",
                        *left / 1ms));
    }
    if (status.state != AlState::safeop || !status.error ||
        status.code != static_cast<std::uint16_t>(AlStatusCode::sync_manager_watchdog))
        bench.fail(fmt::format("when the watchdog expired the slave went to {}, expected SAFEOP + ERROR, 0x001b",
                               status_text(status)));
    const bool early = *left + 2ms + bench.period() < time;  // the last outputs came up to a period before
    if (early && runs) {
        remark_own_timeout(bench, *left, time);
    } else {
        if (early || *left > time + kSlack)
            bench.fail(fmt::format("the slave left OP {} ms after the last outputs; the watchdog time is {} ms",
                                   *left / 1ms, time / 1ms));
        if (watchdog_runs(bench)) bench.fail("the watchdog status 0x0440 does not show that the watchdog has expired");
    }
    expect_new_outputs(bench);
}

void check_time(Session& session) {
    auto& bench = session.bench;
    needs_watchdog(bench);
    const auto status = start_with_time(bench, 3000);
    if (status.state != AlState::op) {
        bench.fail(fmt::format("with a watchdog time of 300 ms the slave is in {}", status_text(status)));
        return;
    }
    const auto left = until_leaves_op(bench, 200ms);
    if (!left) return;
    const bool runs = watchdog_runs(bench);
    if (misses_frames(bench)) return;
    if (runs && bench.refused().code == static_cast<std::uint16_t>(AlStatusCode::sync_manager_watchdog))
        return remark_own_timeout(bench, *left, 300ms);
    bench.fail(fmt::format("with a watchdog time of 300 ms the slave left OP after {} ms", *left / 1ms));
}

void check_off(Session& session) {
    auto& bench = session.bench;
    needs_watchdog(bench);
    const auto status = start_with_time(bench, 0);
    if (status.error) {
        if (status.code != static_cast<std::uint16_t>(AlStatusCode::invalid_watchdog_configuration))
            bench.fail(fmt::format("with the watchdog off the slave is in {}", status_text(status)));
        else
            bench.remark("the slave refuses to work with the watchdog off (0x001F)");
        return;
    }
    if (const auto left = until_leaves_op(bench, 500ms); left && !misses_frames(bench))
        bench.remark(fmt::format("with the watchdog off the slave left OP {} ms after the last outputs", *left / 1ms));
}

void check_inputs_of(Bench& bench, const ProcessArea& inputs) {
    std::vector<std::byte> octets(inputs.setting.length_bytes);
    if (octets.size() > 1486) bench.skip("the inputs are larger than a frame");
    const auto start = inputs.setting.physical_start;
    if (bench.try_read(start, octets)) return;
    // One buffer is empty after it was read, until the slave updates its inputs; outputs may be what it waits for.
    const bool one_buffer = inputs.setting.mailbox();
    for (int n = 0; one_buffer && n < 20; ++n) {
        for (const auto& area : bench.areas())
            if (area.outputs && area.setting.length_bytes != 0)
                (void)bench.try_write(area.setting.physical_start, std::vector<std::byte>(area.setting.length_bytes));
        bench.wait(5ms);
        if (bench.try_read(start, octets)) return;
    }
    bench.fail(fmt::format("in SAFEOP the inputs of SyncManager {} cannot be read", inputs.sync_manager));
}

void check_inputs(Session& session) {
    auto& bench = session.bench;
    bench.enter(AlState::safeop);
    if (bench.area(false) == nullptr) bench.skip("the slave has no inputs");
    bench.wait(10ms);
    for (const auto& area : bench.areas())
        if (!area.outputs && area.setting.length_bytes != 0) check_inputs_of(bench, area);
}

constexpr std::string_view kWatchdog = "ETG.1000.4, Watchdog; ETG.1000.6, EtherCAT State Machine";

constexpr Check kWatchdogChecks[] = {
    {"process_data.exchange", "each cycle in OP is taken", "ETG.1000.6, EtherCAT State Machine", check_exchange},
    {"process_data.inputs", "inputs are valid from SAFEOP on", "ETG.1000.6, EtherCAT State Machine", check_inputs},
    {"process_data.outputs", "OP needs valid outputs", "ETG.1000.6, EtherCAT State Machine", check_op_needs_outputs},
    {"watchdog.enabled", "the outputs are watched", "ETG.2010, category SyncM", check_enabled},
    {"watchdog.expires", "OP ends with 0x001B when the outputs stop, and needs new outputs", kWatchdog, check_expires},
    {"watchdog.time", "the watchdog time of the master counts", kWatchdog, check_time},
    {"watchdog.off", "a watchdog time of 0 switches the watchdog off", kWatchdog, check_off},
};

}  // namespace

std::span<const Check> watchdog_checks() { return kWatchdogChecks; }

}  // namespace margay::samples::conformance
