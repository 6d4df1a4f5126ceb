// Distributed clocks: the clock itself, and each operation mode of the SII with SYNC signals.
#include "subdevice_check/check.hpp"
#include "wire/al_status_code.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::AlStatusCode;
namespace sii = wire::sii;

constexpr Duration kBusCycle = 2ms;  // where the SII leaves the cycle to the master
constexpr Duration kStartIn = 50ms;  // SYNC0 begins this long after its activation

std::vector<sii::DcOpMode> modes_of(const Session& session) {
    std::vector<sii::DcOpMode> modes;
    const auto content = sii::find_category(session.sii, sii::category::kDc);
    if (!content) return modes;
    sii::DcOpModes list(*content);
    while (const auto mode = list.next()) modes.push_back(*mode);
    return modes;
}

bool uses_sync(const sii::DcOpMode& mode) {
    return (mode.assign_activate >> 8 & (wire::sync_activation::kCyclic | wire::sync_activation::kSync0)) == 3;
}

bool features_say_clock(Bench& bench) {
    return (bench.read<std::uint16_t>(reg::kFeatures.address) & wire::features::kDistributedClocks) != 0;
}

std::optional<std::uint32_t> system_time(Bench& bench) {
    std::array<std::byte, 4> octets{};
    if (!bench.try_read(reg::kSystemTime.address, octets)) return std::nullopt;
    return load_le<std::uint32_t>(octets, 0);
}

void check_registers(Session& session) {
    auto& bench = session.bench;
    const bool announced = features_say_clock(bench);
    const auto modes = modes_of(session);
    if (!announced && modes.empty()) bench.skip("neither the features register nor the SII announces a clock");
    const auto first = system_time(bench);
    bench.wait(20ms);
    const auto second = system_time(bench);
    const bool runs = first && second && *first != *second;
    if (runs && !announced && bench.slave().dl.type >= 0x04)
        bench.remark("the clock runs, and the features register 0x0008 does not announce it");
    if (!runs && !modes.empty())
        bench.fail(fmt::format("the SII has {} DC operation modes, and the ESC has no clock that runs", modes.size()));
    else if (!runs)
        bench.remark("the features register 0x0008 announces a clock, and it does not run");
}

void needs_clock(Session& session) {
    if (!system_time(session.bench)) session.bench.skip("the ESC has no clock");
    const auto first = system_time(session.bench);
    session.bench.wait(1ms);
    if (system_time(session.bench) == first) session.bench.skip("the clock of the ESC does not run");
}

void check_rate(Session& session) {
    auto& bench = session.bench;
    needs_clock(session);
    const Time begun = bench.now();
    const auto first = system_time(bench);
    bench.wait(200ms);
    const auto second = system_time(bench);
    const auto passed = bench.now() - begun;
    const Duration counted{static_cast<std::uint32_t>(second.value_or(0) - first.value_or(0))};
    const auto difference = counted > passed ? counted - passed : passed - counted;
    if (difference > passed / 20)
        bench.fail(fmt::format("the clock counted {} ms in {} ms", counted / 1ms, passed / 1ms));
}

Duration sync0_cycle(const sii::DcOpMode& mode) {
    if (mode.sync0_cycle_time_ns != 0) return Duration{mode.sync0_cycle_time_ns};
    const int factor = mode.sync0_cycle_factor;
    if (factor > 1) return kBusCycle * factor;
    return factor < -1 ? kBusCycle / -factor : kBusCycle;
}

struct SyncSetting {
    Duration cycle{};  // 0x09A0
    Duration sync1{};  // 0x09A4
    std::uint8_t activation = 0;
};

// Writes the SYNC unit, in PREOP. SYNC0 is half a bus cycle away from `grid`, at which frames are sent.
void activate(Bench& bench, const SyncSetting& setting, Time grid) {
    std::array<std::byte, 8> octets{};
    bench.write<std::uint8_t>(reg::kSyncActivation.address, 0);
    bench.write<std::uint8_t>(reg::kCyclicUnitControl.address, 0);
    bench.write<std::uint32_t>(reg::kSync0CycleTime.address, static_cast<std::uint32_t>(setting.cycle.count()));
    bench.write<std::uint32_t>(reg::kSync1CycleTime.address, static_cast<std::uint32_t>(setting.sync1.count()));
    bench.read_octets(reg::kSystemTime.address, octets);
    const auto now = load_le<std::uint64_t>(octets, 0);
    // The time from this reading to a point half a cycle behind a frame.
    const auto since = (bench.now() - grid) % kBusCycle;
    const auto start = now + static_cast<std::uint64_t>((kStartIn - since + kBusCycle / 2).count());
    store_le<std::uint64_t>(octets, 0, start);
    bench.write_octets(reg::kSyncStartTime.address, octets);
    bench.write<std::uint8_t>(reg::kSyncActivation.address, setting.activation);
}

// Frames on the grid until the state is reached, or an error is shown.
AlStatus run_to(Bench& bench, AlState state, Time grid, Duration longest) {
    bench.request(static_cast<unsigned>(state));
    const auto since = (bench.now() - grid) % kBusCycle;
    bench.wait(kBusCycle - since);
    (void)bench.run(
        longest,
        [&] {
            const auto status = bench.al_status();
            return status.state == state || status.error;
        },
        kBusCycle);
    return bench.al_status();
}

void run_on_grid(Bench& bench, Time grid, Duration time, const std::function<bool()>& done = {}) {
    const auto since = (bench.now() - grid) % kBusCycle;
    bench.wait(kBusCycle - since);
    (void)bench.run(time, done, kBusCycle);
}

// PREOP with SYNC signals, then SAFEOP and OP. Returns the last status.
AlStatus start(Session& session, const SyncSetting& setting, Time& grid) {
    auto& bench = session.bench;
    bench.enter(AlState::preop);
    bench.configure_process_data();
    grid = bench.now();
    activate(bench, setting, grid);
    const auto status = run_to(bench, AlState::safeop, grid, Bench::patience(AlState::safeop));
    if (status.state != AlState::safeop || status.error) return status;
    run_on_grid(bench, grid, kStartIn + 20 * kBusCycle);
    return run_to(bench, AlState::op, grid, Bench::patience(AlState::op));
}

SyncSetting setting_of(const sii::DcOpMode& mode) {
    SyncSetting setting{sync0_cycle(mode), {}, static_cast<std::uint8_t>(mode.assign_activate >> 8)};
    if ((setting.activation & wire::sync_activation::kSync1) != 0) {
        setting.sync1 = mode.sync1_cycle_factor > 1 ? setting.cycle * (mode.sync1_cycle_factor - 1) : Duration{};
        setting.sync1 += Duration{std::max(0, mode.sync1_shift_time_ns)};
    }
    return setting;
}

std::vector<sii::DcOpMode> needs_modes(Session& session) {
    std::vector<sii::DcOpMode> modes;
    for (const auto& mode : modes_of(session))
        if (uses_sync(mode)) modes.push_back(mode);
    if (modes.empty()) session.bench.skip("the SII has no DC operation mode with SYNC0");
    if (session.bench.emulation()) session.bench.skip("the ESC mirrors AL control: there is no state machine");
    needs_clock(session);
    return modes;
}

void check_sync(Session& session) {
    auto& bench = session.bench;
    for (const auto& mode : needs_modes(session)) {
        Time grid{};
        const auto setting = setting_of(mode);
        const auto status = start(session, setting, grid);
        if (status.state != AlState::op || status.error) {
            bench.fail(fmt::format("with SYNC0 each {} µs (AssignActivate 0x{:04x}) the slave is in {}",
                                   setting.cycle / 1us, mode.assign_activate, status_text(status)));
            continue;
        }
        run_on_grid(bench, grid, 200ms);
        if (const auto after = bench.al_status(); after.state != AlState::op || after.error)
            bench.fail(fmt::format("with SYNC0 each {} µs the slave did not stay in OP: {}", setting.cycle / 1us,
                                   status_text(after)));
    }
}

constexpr AlStatusCode kNoSync[] = {AlStatusCode::fatal_sync_error,      AlStatusCode::no_sync_error,
                                    AlStatusCode::synchronization_error, AlStatusCode::pll_error,
                                    AlStatusCode::dc_sync_io_error,      AlStatusCode::dc_sync_timeout};
bool says_no_sync(AlStatus status) {
    return std::ranges::find(kNoSync, static_cast<AlStatusCode>(status.code)) != std::end(kNoSync);
}

// SYNC0 is off and the frames go on: the slave must not go to OP again.
void check_op_again(Bench& bench, Time grid) {
    bench.request(static_cast<unsigned>(AlState::safeop) | wire::al::kErrorAcknowledge);
    run_on_grid(bench, grid, 100ms);
    if (const auto status = bench.al_status(); status.state != AlState::safeop || status.error) return;
    const auto status = run_to(bench, AlState::op, grid, Bench::patience(AlState::op));
    if (status.state == AlState::op)
        bench.fail("SYNC0 was switched off in OP, and after an acknowledge the slave went to OP again without it");
    else if (status.error && !says_no_sync(status))
        bench.fail(fmt::format("without SYNC0 the slave refused OP with {}, expected 0x002d", status_text(status)),
                   "ETG.1020, AL Status Codes");
}

void check_lost(Session& session) {
    auto& bench = session.bench;
    const auto modes = needs_modes(session);
    Time grid{};
    if (const auto status = start(session, setting_of(modes.front()), grid); status.state != AlState::op)
        bench.skip("the slave does not go to OP with SYNC0 (clock.sync0)");
    bench.write<std::uint8_t>(reg::kSyncActivation.address, 0);
    run_on_grid(bench, grid, 1s, [&] { return bench.al_status().state != AlState::op; });
    const auto status = bench.refused();
    if (status.state == AlState::op) {
        bench.remark("SYNC0 was switched off in OP, and the slave stays in OP");
        return;
    }
    if (!says_no_sync(status))
        bench.fail(
            fmt::format("SYNC0 was switched off in OP, and the slave went to {}, expected 0x002c", status_text(status)),
            "ETG.1020, AL Status Codes");
    if (status.state == AlState::safeop) check_op_again(bench, grid);
}

// A mode with SYNC1: clock.sync0 has tried it. The same without SYNC1.
void check_sync1(Session& session) {
    auto& bench = session.bench;
    bool any = false;
    for (const auto& mode : needs_modes(session)) {
        auto setting = setting_of(mode);
        if ((setting.activation & wire::sync_activation::kSync1) == 0) continue;
        any = true;
        Time grid{};
        setting.activation &= static_cast<std::uint8_t>(~unsigned{wire::sync_activation::kSync1});
        setting.sync1 = {};
        const auto status = start(session, setting, grid);
        if (status.state == AlState::op && !status.error)
            bench.remark(
                fmt::format("the operation mode with AssignActivate 0x{:04x} has SYNC1, and the slave also "
                            "goes to OP without SYNC1",
                            mode.assign_activate));
        else if (static_cast<AlStatusCode>(status.code) != AlStatusCode::invalid_dc_sync_configuration)
            bench.fail(fmt::format("without SYNC1 of AssignActivate 0x{:04x} the slave is in {}, expected 0x0030",
                                   mode.assign_activate, status_text(status)),
                       "ETG.1020, AL Status Codes");
    }
    if (!any) bench.skip("no operation mode of the SII has SYNC1");
}

void check_cycle_zero(Session& session) {
    auto& bench = session.bench;
    auto setting = setting_of(needs_modes(session).front());
    setting.cycle = {};
    Time grid{};
    const auto status = start(session, setting, grid);
    if (status.state == AlState::op) bench.fail("SYNC0 is active with a cycle time of 0, and the slave went to OP");
}

// SYNC0 alone, and the cycle time of SYNC1 left over by another configuration.
void check_cycle1(Session& session) {
    auto& bench = session.bench;
    auto setting = setting_of(needs_modes(session).front());
    if ((setting.activation & wire::sync_activation::kSync1) != 0) bench.skip("the operation mode uses SYNC1");
    setting.sync1 = setting.cycle;
    Time grid{};
    const auto status = start(session, setting, grid);
    if (status.state != AlState::op || status.error)
        bench.remark(fmt::format("with SYNC0 alone and a cycle time of SYNC1 that is not 0 the slave is in {}",
                                 status_text(status)));
}

constexpr std::string_view kClock = "ETG.1000.4, Distributed clock";
constexpr std::string_view kSync = "ETG.1020, Synchronization; ETG.2010, category DC";

constexpr Check kChecks[] = {
    {"clock.registers", "a clock that is announced exists", kClock, check_registers},
    {"clock.rate", "the clock counts nanoseconds", kClock, check_rate},
    {"clock.sync0", "OP with the SYNC signals of each operation mode", kSync, check_sync},
    {"clock.lost", "OP ends when SYNC0 ends, and needs a new SYNC0", kSync, check_lost},
    {"clock.sync1", "an operation mode with SYNC1 needs SYNC1", kSync, check_sync1},
    {"clock.cycle_zero", "SYNC0 with a cycle time of 0 is refused", kSync, check_cycle_zero},
    {"clock.cycle1", "an unused cycle time of SYNC1 does no harm", kSync, check_cycle1},
};

}  // namespace

std::span<const Check> clock_checks() { return kChecks; }

}  // namespace margay::samples::conformance
