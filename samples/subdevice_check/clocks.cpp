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

// The cycles that are tried, in this order, where the SII leaves the cycle to the master: the next one when the slave
// refuses a cycle by AL status code 0x0035 or 0x0036. The short cycles come last, because not every master can send
// frames so often.
constexpr Duration kBusCycles[] = {2ms, 1ms, 4ms, 500us, 8ms, 10ms, 20ms, 250us, 125us, 100us, 62'500ns, 50us};
constexpr Duration kShortestTried = 10us;  // of SYNC0
constexpr Duration kStartIn = 50ms;        // SYNC0 begins this long after its activation, or up to a cycle later

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

Duration sync0_cycle(const sii::DcOpMode& mode, Duration bus) {
    if (mode.sync0_cycle_time_ns != 0) return Duration{mode.sync0_cycle_time_ns};
    const int factor = mode.sync0_cycle_factor;
    if (factor > 1) return bus * factor;
    return factor < -1 ? bus / -factor : bus;
}

struct SyncSetting {
    Duration bus{};    // the period of the frames
    Duration cycle{};  // 0x09A0
    Duration sync1{};  // 0x09A4
    std::uint8_t activation = 0;
};

// Writes the SYNC unit, in PREOP. SYNC0 is half a bus cycle away from the frames, which are sent at the multiples of
// the bus cycle (Bench::run()).
void activate(Bench& bench, const SyncSetting& setting) {
    std::array<std::byte, 8> octets{};
    bench.write<std::uint8_t>(reg::kSyncActivation.address, 0);
    bench.write<std::uint8_t>(reg::kCyclicUnitControl.address, 0);
    bench.write<std::uint32_t>(reg::kSync0CycleTime.address, static_cast<std::uint32_t>(setting.cycle.count()));
    bench.write<std::uint32_t>(reg::kSync1CycleTime.address, static_cast<std::uint32_t>(setting.sync1.count()));
    // A frame passes the slave soon after it was sent; its way back may be longer than a cycle.
    const auto since = bench.now().time_since_epoch() % setting.bus;
    bench.read_octets(reg::kSystemTime.address, octets);
    const auto now = load_le<std::uint64_t>(octets, 0);
    const auto cycles = kStartIn / setting.bus + 1;
    const auto start = now + static_cast<std::uint64_t>((cycles * setting.bus - since + setting.bus / 2).count());
    store_le<std::uint64_t>(octets, 0, start);
    bench.write_octets(reg::kSyncStartTime.address, octets);
    bench.write<std::uint8_t>(reg::kSyncActivation.address, setting.activation);
}

// Frames until the state is reached, or an error is shown.
AlStatus run_to(Bench& bench, AlState state, Duration bus) {
    bench.request(static_cast<unsigned>(state));
    (void)bench.run(
        Bench::patience(state),
        [&] {
            const auto status = bench.al_status();
            return status.state == state || status.error;
        },
        bus);
    return bench.al_status();
}

// PREOP with SYNC signals, then SAFEOP and OP. Returns the last status.
AlStatus start(Session& session, const SyncSetting& setting) {
    auto& bench = session.bench;
    bench.enter(AlState::preop);
    bench.configure_process_data();
    bench.forget_late();
    activate(bench, setting);
    const auto status = run_to(bench, AlState::safeop, setting.bus);
    if (status.state != AlState::safeop || status.error) return status;
    (void)bench.run(kStartIn + 20 * setting.bus, {}, setting.bus);
    return run_to(bench, AlState::op, setting.bus);
}

SyncSetting setting_of(const sii::DcOpMode& mode, Duration bus = kBusCycles[0]) {
    SyncSetting setting{bus, sync0_cycle(mode, bus), {}, static_cast<std::uint8_t>(mode.assign_activate >> 8)};
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

// The shortest SYNC0 cycle of the slave: 0x1C32:05, without outputs 0x1C33:05, or the objects of another SyncManager.
std::optional<Duration> shortest_cycle(Session& session) {
    std::uint32_t shortest = 0;
    for (const auto& area : session.bench.areas())
        shortest = std::max(shortest,
                            session.sdo.number(static_cast<std::uint16_t>(0x1C30 + area.sync_manager), 5).value_or(0));
    if (shortest == 0) return std::nullopt;
    return Duration{shortest};
}

// The cycles in which the slave may follow, then its shortest one, then the others.
std::vector<Duration> possible_first(std::vector<Duration> cycles, const sii::DcOpMode& mode, Duration shortest) {
    const auto possible = [&](Duration bus) { return sync0_cycle(mode, bus) >= shortest; };
    const auto others = std::ranges::stable_partition(cycles, possible).begin();
    if (shortest != Duration{} && std::ranges::find(cycles, shortest) == cycles.end()) cycles.insert(others, shortest);
    return cycles;
}

// The cycles for a mode: from the SII, or else the choice of the master. The slave may report its shortest cycle.
std::vector<Duration> bus_cycles(Session& session, const sii::DcOpMode& mode) {
    if (mode.sync0_cycle_time_ns != 0) return {kBusCycles[0]};
    std::vector<Duration> cycles(std::begin(kBusCycles), std::end(kBusCycles));
    if (!session.bench.has(mailbox_protocol::kCoE) || session.mail.dead()) return cycles;
    session.bench.enter(AlState::preop);
    return possible_first(std::move(cycles), mode, shortest_cycle(session).value_or(Duration{}));
}

// OP with the first cycle that the slave does not refuse. Returns the last status.
AlStatus start(Session& session, const sii::DcOpMode& mode, SyncSetting& setting) {
    AlStatus status{};
    for (const auto bus : bus_cycles(session, mode)) {
        setting = setting_of(mode, bus);
        status = start(session, setting);
        if (!refuses_cycle(status)) break;
    }
    return status;
}

std::string cycles_text(Session& session, const sii::DcOpMode& mode) {
    std::string text;
    for (const auto bus : bus_cycles(session, mode))
        text +=
            fmt::format("{}{}", text.empty() ? "" : ", ", static_cast<double>(sync0_cycle(mode, bus).count()) / 1e3);
    return text;
}

constexpr AlStatusCode kNoSync[] = {AlStatusCode::fatal_sync_error,      AlStatusCode::no_sync_error,
                                    AlStatusCode::synchronization_error, AlStatusCode::pll_error,
                                    AlStatusCode::dc_sync_io_error,      AlStatusCode::dc_sync_timeout};
bool says_no_sync(AlStatus status) {
    return std::ranges::find(kNoSync, static_cast<AlStatusCode>(status.code)) != std::end(kNoSync);
}

// The slave misses frames, but this master has sent some frames too late for their SYNC0. This is not a fault of the
// slave.
void skip_if_late(Bench& bench, const SyncSetting& setting, AlStatus status) {
    const bool frames =
        says_no_sync(status) || static_cast<AlStatusCode>(status.code) == AlStatusCode::sync_manager_watchdog;
    const Duration late = bench.cycle().latest();
    if (!frames || late < setting.bus / 2) return;
    bench.skip(
        fmt::format("the slave is in {}, and this master sent a frame {} µs too late, with frames each {} µs: "
                    "try again on a machine that is not so busy",
                    status_text(status), late / 1us, setting.bus / 1us));
}

void check_sync(Session& session) {
    auto& bench = session.bench;
    for (const auto& mode : needs_modes(session)) {
        SyncSetting setting;
        const auto status = start(session, mode, setting);
        if (refuses_cycle(status) && mode.sync0_cycle_time_ns == 0)
            bench.skip(
                fmt::format("AssignActivate 0x{:04x} could not be tried: the slave refuses SYNC0 each {} µs ({})",
                            mode.assign_activate, cycles_text(session, mode), status_text(status)));
        if (status.state != AlState::op || status.error) {
            skip_if_late(bench, setting, status);
            bench.fail(fmt::format("with SYNC0 each {} µs (AssignActivate 0x{:04x}) the slave is in {}",
                                   setting.cycle / 1us, mode.assign_activate, status_text(status)));
            continue;
        }
        (void)bench.run(200ms, {}, setting.bus);
        const auto after = bench.al_status();
        if (after.state == AlState::op && !after.error) continue;
        skip_if_late(bench, setting, after);
        bench.fail(fmt::format("with SYNC0 each {} µs the slave did not stay in OP: {}", setting.cycle / 1us,
                               status_text(after)));
    }
}

// SYNC0 is off and the frames continue: the slave must not return to OP.
void check_op_again(Bench& bench, Duration bus) {
    bench.request(static_cast<unsigned>(AlState::safeop) | wire::al::kErrorAcknowledge);
    (void)bench.run(100ms, {}, bus);
    if (const auto status = bench.al_status(); status.state != AlState::safeop || status.error) return;
    const auto status = run_to(bench, AlState::op, bus);
    if (status.state == AlState::op)
        bench.fail("SYNC0 was switched off in OP, and after an acknowledge the slave went to OP again without it");
    else if (status.error && !says_no_sync(status))
        bench.fail(fmt::format("without SYNC0 the slave refused OP with {}, expected 0x002d", status_text(status)),
                   "ETG.1020, AL Status Codes");
}

void check_lost(Session& session) {
    auto& bench = session.bench;
    const auto modes = needs_modes(session);
    SyncSetting setting;
    if (const auto status = start(session, modes.front(), setting); status.state != AlState::op)
        bench.skip("the slave does not go to OP with SYNC0 (clock.sync0)");
    bench.write<std::uint8_t>(reg::kSyncActivation.address, 0);
    (void)bench.run(
        1s, [&] { return bench.al_status().state != AlState::op; }, setting.bus);
    if (bench.al_status().state == AlState::op) {
        bench.remark("SYNC0 was switched off in OP, and the slave stays in OP");
        return;
    }
    const auto status = bench.refused();
    if (!says_no_sync(status))
        bench.fail(
            fmt::format("SYNC0 was switched off in OP, and the slave went to {}, expected 0x002c", status_text(status)),
            "ETG.1020, AL Status Codes");
    if (status.state == AlState::safeop) check_op_again(bench, setting.bus);
}

// A mode with SYNC1: clock.sync0 has tried it. The same without SYNC1.
void check_sync1(Session& session) {
    auto& bench = session.bench;
    bool any = false;
    for (const auto& mode : needs_modes(session)) {
        auto setting = setting_of(mode);
        if ((setting.activation & wire::sync_activation::kSync1) == 0) continue;
        any = true;
        // With SYNC1, to find the cycle.
        if (start(session, mode, setting).state != AlState::op) continue;  // clock.sync0 reports it
        setting.activation &= static_cast<std::uint8_t>(~unsigned{wire::sync_activation::kSync1});
        setting.sync1 = {};
        const auto status = start(session, setting);
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
    const auto status = start(session, setting);
    if (status.state == AlState::op) {
        bench.fail("SYNC0 is active with a cycle time of 0, and the slave went to OP");
        return;
    }
    // A slave may also take it as a single pulse, and miss SYNC0 later.
    constexpr AlStatusCode kCodes[] = {AlStatusCode::invalid_dc_sync0_cycle_time,
                                       AlStatusCode::invalid_dc_sync_cycle_time,
                                       AlStatusCode::invalid_dc_sync_configuration,
                                       AlStatusCode::no_sync_error,
                                       AlStatusCode::fatal_sync_error,
                                       AlStatusCode::synchronization_error,
                                       AlStatusCode::pll_error,
                                       AlStatusCode::dc_sync_io_error,
                                       AlStatusCode::dc_sync_timeout};
    if (!status.error)
        bench.fail(fmt::format("SYNC0 is active with a cycle time of 0, and the slave stays in {} without an error",
                               status_text(status)));
    else if (std::find(std::begin(kCodes), std::end(kCodes), static_cast<AlStatusCode>(status.code)) ==
             std::end(kCodes))
        bench.fail(fmt::format("SYNC0 is active with a cycle time of 0, and the slave is in {}, expected 0x0036",
                               status_text(status)),
                   "ETG.1020, AL Status Codes");
}

// SYNC0 with half of the shortest cycle that the slave reports.
void check_cycle_short(Session& session) {
    auto& bench = session.bench;
    const auto mode = needs_modes(session).front();
    if (mode.sync0_cycle_time_ns != 0) bench.skip("the SII has a cycle time of its own");
    session.sdo.needs_sdo();
    bench.enter(AlState::preop);
    const auto shortest = shortest_cycle(session);
    if (!shortest) bench.skip("the slave does not tell its shortest cycle (0x1C32:05)");
    auto setting = setting_of(mode);
    setting.cycle = *shortest / 2;
    if (setting.cycle < kShortestTried) bench.skip("half of the shortest cycle is too short for a trial");
    setting.bus = setting.cycle * std::max<std::int64_t>(1, kBusCycles[0] / setting.cycle);
    const auto status = start(session, setting);
    // In SAFEOP, another error than that of the cycle time is the lack of frames for each SYNC0.
    if (status.state != AlState::preop && !refuses_cycle(status))
        bench.remark(
            fmt::format("the slave tells a shortest cycle of {} ns (subindex 5 of 0x1C32 or 0x1C33), and SYNC0 "
                        "each {} ns is accepted",
                        shortest->count(), setting.cycle.count()));
}

// SYNC0 alone, and the cycle time of SYNC1 left over by another configuration.
void check_cycle1(Session& session) {
    auto& bench = session.bench;
    const auto mode = needs_modes(session).front();
    SyncSetting setting;
    if ((setting_of(mode).activation & wire::sync_activation::kSync1) != 0) bench.skip("the operation mode uses SYNC1");
    if (const auto status = start(session, mode, setting); status.state != AlState::op)
        bench.skip("the slave does not go to OP with SYNC0 (clock.sync0)");
    setting.sync1 = setting.cycle;
    const auto status = start(session, setting);
    if (status.state != AlState::op || status.error)
        bench.remark(fmt::format("with SYNC0 alone and a cycle time of SYNC1 that is not 0 the slave is in {}",
                                 status_text(status)));
}

constexpr std::string_view kClock = "ETG.1000.4, Distributed clock";
constexpr std::string_view kSync = "ETG.1020, Synchronization; ETG.2010, category DC";

constexpr Check kClockChecks[] = {
    {"clock.registers", "a clock that is announced exists", kClock, check_registers},
    {"clock.rate", "the clock counts nanoseconds", kClock, check_rate},
    {"clock.sync0", "OP with the SYNC signals of each operation mode", kSync, check_sync},
    {"clock.lost", "OP ends when SYNC0 ends, and needs a new SYNC0", kSync, check_lost},
    {"clock.sync1", "an operation mode with SYNC1 needs SYNC1", kSync, check_sync1},
    {"clock.cycle_zero", "SYNC0 with a cycle time of 0 is refused with 0x0036", kSync, check_cycle_zero},
    {"clock.cycle_short", "SYNC0 shorter than the cycle in 0x1C32:05 is refused", kSync, check_cycle_short},
    {"clock.cycle1", "an unused cycle time of SYNC1 does no harm", kSync, check_cycle1},
};

}  // namespace

std::span<const Check> clock_checks() { return kClockChecks; }

unsigned clock_attempts(const Session& session) {
    const auto modes = modes_of(session);
    const auto mode = std::ranges::find_if(modes, uses_sync);
    const bool fixed = mode != modes.end() && mode->sync0_cycle_time_ns != 0;
    return fixed ? 1U : static_cast<unsigned>(std::size(kBusCycles) + 1);  // and the shortest one of the slave
}

void find_shortest_cycle(Session& session) {
    if (session.shortest_cycle || !has_sync_mode(session)) return;
    std::optional<Duration> shortest;
    try {
        session.sdo.needs_sdo();
        shortest = shortest_cycle(session);
    } catch (const NotJudged&) {  // another check reports it
    }
    session.shortest_cycle = shortest.value_or(Duration{});
}

bool has_sync_mode(const Session& session) {
    const auto modes = modes_of(session);
    return std::ranges::any_of(modes, uses_sync);
}

// SYNC0 with the period of the frames suits slaves that compare both. Where the SII has a cycle time of its own, the
// frames have it too.
Duration activate_clock(Session& session, unsigned attempt) {
    const auto modes = modes_of(session);
    const auto& mode = *std::ranges::find_if(modes, uses_sync);
    std::vector<Duration> cycles(std::begin(kBusCycles), std::end(kBusCycles));
    std::swap(cycles[0], cycles[1]);  // 1 ms, as without a clock
    cycles = possible_first(std::move(cycles), mode, session.shortest_cycle.value_or(Duration{}));
    const auto bus = mode.sync0_cycle_time_ns != 0 ? Duration{mode.sync0_cycle_time_ns}
                                                   : cycles[std::min<std::size_t>(attempt, cycles.size() - 1)];
    activate(session.bench, setting_of(mode, bus));
    return bus;
}

}  // namespace margay::samples::conformance
