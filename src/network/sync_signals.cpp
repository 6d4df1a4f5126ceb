// SYNC signals: what a slave wants, and their start at a time on the grid.
#include "clock/system_time.hpp"
#include "network/clocks.hpp"
#include "network/network.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr Step kSyncStep = Step::configure_sync;

Error invalid_time(Argument which) {
    return {.code = Errc::invalid_argument, .step = kSyncStep, .detail = static_cast<std::uint32_t>(which)};
}

Result<std::uint32_t> cycle_ns(Duration cycle) {
    if (cycle >= Duration{0} && cycle.count() <= UINT32_MAX) return static_cast<std::uint32_t>(cycle.count());
    return invalid_time(Argument::sync_cycle);
}

// Applies a factor of an operation mode (ETG.2000): a positive n means n cycles, a negative n the nth part of a cycle.
Duration times_factor(Duration cycle, std::int16_t factor) {
    if (factor == 0 || cycle.count() > UINT32_MAX) return cycle;  // too long for a SYNC cycle: cycle_ns() refuses it
    return factor > 0 ? cycle * factor : cycle / -factor;
}

// The registers for an operation mode of the SII. The SYNC1 register is the time from a SYNC0 to the SYNC1 that
// belongs to it, and contains the SYNC0 cycles between (ESC data sheets, "SyncSignal generation").
Result<SyncRegisters> registers_of_mode(const wire::sii::DcOpMode& mode, const ClockSettings& clocks) {
    SyncSettings settings{.source = SyncSettings::Source::application, .assign_activate = mode.assign_activate};
    settings.sync0_cycle = mode.sync0_cycle_time_ns != 0 ? Duration(mode.sync0_cycle_time_ns)
                                                         : times_factor(clocks.cycle, mode.sync0_cycle_factor);
    if (mode.sync1_cycle_factor > 1) settings.sync1_cycle = settings.sync0_cycle * (mode.sync1_cycle_factor - 1);
    const Duration shift(mode.sync1_shift_time_ns);
    const bool has_sync1 = (mode.assign_activate & wire::sync_activation::kSync1 << 8) != 0;
    if (shift >= Duration{0})
        settings.sync1_cycle += shift;
    else if (has_sync1 && -shift >= settings.sync0_cycle)
        return invalid_time(Argument::sync_cycle);
    else if (has_sync1)  // negative shift: the time is measured from the previous SYNC0
        settings.sync1_cycle += settings.sync0_cycle + shift;
    settings.shift = Duration(mode.sync0_shift_time_ns);
    return sync_registers(settings, clocks);
}

Error no_such_mode(const Slave& slave, std::uint8_t mode) {
    Error error{.code = Errc::unsupported, .step = kSyncStep, .slave = slave.number};
    error.subindex = mode;
    return error;
}

// Reads operation mode `number` from the DC category. The caller has assigned the SII to the master.
Task<Result<SyncRegisters>> read_mode(Network& network, const Slave& slave, std::uint8_t number) {
    namespace sii = wire::sii;
    constexpr unsigned kMostCategories = 64;
    SiiReader reader(network.station(slave));
    sii::CategoryChain chain(sii::content_end_word(slave.sii_bytes));
    for (unsigned n = 0; chain.more() && n < kMostCategories; ++n) {
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        co_await required(reader.read(chain.header_word(), header));
        const auto place = chain.step(header);
        if (!place) break;
        if (place->type != sii::category::kDc) continue;
        if ((number + 1U) * sii::kDcOpModeBytes > place->words * sii::kWordBytes) break;
        std::array<std::byte, sii::kDcOpModeBytes> content{};
        const auto word = static_cast<std::uint32_t>(place->word + number * sii::kDcOpModeBytes / sii::kWordBytes);
        co_await required(reader.read(word, content));
        co_return registers_of_mode(sii::load_dc_op_mode(content), network.clocks.settings);
    }
    co_return no_such_mode(slave, number);
}

// invalid_argument if a pulse is at least as long as the cycle of its signal: such a signal has no edges.
Error check_pulse(std::int32_t pulse_ns, const SyncRegisters& sync) {
    constexpr std::uint16_t kSync0 = wire::sync_activation::kSync0 << 8;
    constexpr std::uint16_t kSync1 = wire::sync_activation::kSync1 << 8;
    if ((sync.assign_activate & (kSync0 | kSync1)) == 0) return {};
    const std::uint64_t cycle = (sync.assign_activate & kSync0) != 0
                                    ? sync.sync0_cycle_ns
                                    : sync_period_ns(sync.sync0_cycle_ns, sync.sync1_cycle_ns);
    if (cycle == 0 || pulse_ns <= 0 || cycle > static_cast<std::uint32_t>(pulse_ns)) return {};
    Error error = invalid_time(Argument::sync_pulse);
    error.expected = static_cast<std::uint32_t>(pulse_ns);
    error.actual = static_cast<std::uint32_t>(cycle);
    return error;
}

// A start of SYNC signals.
struct SyncStart {
    Duration delay{};  // how far in the future at least
    Time asked{};      // when the time of the slave was asked
    Time comes{};      // the earliest time at which the start comes
};

// The start time of the SYNC signals of a slave whose clock shows `now_ns`.
Result<std::uint64_t> find_start(Network& network, const Slave& slave, const SyncRegisters& sync, Duration delay,
                                 std::uint64_t now_ns) {
    const ClockSettings& settings = network.clocks.settings;
    // A single pulse has no period of its own.
    const std::uint64_t period = sync_period_ns(sync.sync0_cycle_ns, sync.sync1_cycle_ns);
    const Duration usual = settings.start_grid > Duration{0} ? settings.start_grid : settings.cycle;
    // A setting of dcsync0() may be older than the grid.
    if (period != 0 && static_cast<std::uint64_t>(settings.start_grid.count()) % period != 0)
        return invalid_time(Argument::sync_grid);
    const bool by_period = settings.start_grid <= Duration{0} && period != 0;
    const std::uint64_t grid = by_period ? period : static_cast<std::uint64_t>(usual.count());
    std::uint64_t start_ns = start_time_ns(now_ns + static_cast<std::uint64_t>(delay.count()), grid, sync.shift_ns);
    if (settings.start_time != nullptr)
        start_ns = settings.start_time(slave.number, start_ns, settings.start_time_user);
    // If the start time has passed, the chip would wait for centuries, or until its 32 bits wrap. If the start time of
    // a clock of 32 bits is more than one wrap ahead, the chip would start too early.
    const auto ahead = static_cast<std::int64_t>(start_ns - now_ns);
    Error refused = invalid_time(Argument::sync_start);
    if (ahead > std::int64_t{UINT32_MAX}) refused.expected = UINT32_MAX;
    if (ahead <= 0 || (network.clocks.of(slave).kind == ClockKind::bits32 && refused.expected != 0)) return refused;
    return start_ns;
}

// The start time by the clock of the slave.
Task<Result<std::uint64_t>> choose_start(Network& network, Slave& slave, SyncRegisters sync, SyncStart& start) {
    start.asked = network.engine.now();
    const auto time = co_await required(read<std::uint64_t>(network.station(slave), reg::kSystemTime, kSyncStep));
    refresh_system_time(network);
    const std::uint64_t about = network.clocks.system_at_ns(network.engine.now());
    const std::uint64_t now_ns = network.clocks.of(slave).kind == ClockKind::bits64
                                     ? time
                                     : extend_time_ns(static_cast<std::uint32_t>(time), about);
    const auto start_ns = find_start(network, slave, sync, start.delay, now_ns);
    if (start_ns) start.comes = later(start.asked, Duration{static_cast<std::int64_t>(*start_ns - now_ns)});
    co_return start_ns;
}

// Without these bits, the chip makes no signal.
constexpr bool selects_signal(const SyncRegisters& sync) {
    using namespace wire::sync_activation;
    const unsigned activation = sync.assign_activate >> 8;
    return (activation & kCyclic) != 0 && (activation & (kSync0 | kSync1)) != 0;
}

// Writes the registers while the start time is still in the future. If a frame was lost meanwhile, the caller tries
// again.
Task<Result<>> write_sync(Network& network, Slave& slave, SyncRegisters sync, SyncStart& start) {
    const Station station = network.station(slave);
    ClockEntry& clock = network.clocks.of(slave);
    // First the checks: if the new SYNC signals are refused, the active ones continue.
    if (sync.assign_activate != 0) co_await required(read_pulse_length(network, slave));
    const Error no_edges = check_pulse(clock.pulse_ns, sync);
    if (no_edges.code != Errc::none) co_return no_edges;
    std::uint64_t start_ns = 0;
    if (sync.assign_activate != 0) start_ns = co_await required(choose_start(network, slave, sync, start));
    auto off = co_await write_clock_register(station, reg::kSyncActivation, 0);
    clock.end_sync();
    if (!off || sync.assign_activate == 0) co_return off;
    constexpr wire::Register kBothCycles{reg::kSync0CycleTime.address, 8};
    const std::uint64_t cycles = sync.sync0_cycle_ns | std::uint64_t{sync.sync1_cycle_ns} << 32;
    co_await required(write_clock_register(station, kBothCycles, cycles));
    wire::Register time_register = reg::kSyncStartTime;
    if (clock.kind == ClockKind::bits32) time_register.length = 4;
    co_await required(write_clock_register(station, time_register, start_ns));
    constexpr wire::Register kAssignActivate{reg::kCyclicUnitControl.address, 2};
    co_await required(write_clock_register(station, kAssignActivate, sync.assign_activate));
    clock.sync_active = selects_signal(sync);
    if (clock.sync_active) clock.sync_start_ns = start_ns;
    clock.sync = sync;
    co_return Nothing{};
}

}  // namespace

Task<Result<>> read_pulse_length(Network& network, Slave& slave) {
    constexpr std::int32_t kUnit_ns = 10;
    auto units = co_await read<std::uint16_t>(network.station(slave), reg::kSyncPulseLength, Step::configure_clocks);
    if (!units && !does_not_answer(units.error())) co_return units.error();
    // Without any reply of the slave, it is not known whether the slave has this register.
    if (!units) co_await required(read<std::uint8_t>(network.station(slave), reg::kType, Step::configure_clocks));
    network.clocks.of(slave).pulse_ns = units ? kUnit_ns * std::int32_t{*units} : -1;
    co_return Nothing{};
}

Result<SyncRegisters> sync_registers(const SyncSettings& settings, const ClockSettings& clocks) {
    if (settings.source == SyncSettings::Source::none) return SyncRegisters{};
    const auto cycle0 = cycle_ns(settings.sync0_cycle < Duration{0} ? clocks.cycle : settings.sync0_cycle);
    if (!cycle0) return cycle0.error();
    const auto cycle1 = cycle_ns(settings.sync1_cycle);
    if (!cycle1) return cycle1.error();
    // Another start on the grid would have another phase.
    const std::uint64_t period = sync_period_ns(*cycle0, *cycle1);
    if (period != 0 && static_cast<std::uint64_t>(clocks.start_grid.count()) % period != 0)
        return invalid_time(Argument::sync_grid);
    return SyncRegisters{.assign_activate = settings.assign_activate,
                         .sync0_cycle_ns = *cycle0,
                         .sync1_cycle_ns = *cycle1,
                         .shift_ns = settings.shift.count()};
}

Task<Result<>> activate_sync(Network& network, Slave& slave, SyncRegisters sync) {
    if (!is_clock(network.clocks.of(slave).kind))
        co_return Error{.code = Errc::no_clock, .step = kSyncStep, .slave = slave.number};
    // Without a synchronised clock, its SYNC signals would drift away from the SYNC signals of the other slaves.
    const ClockEntry& clock = network.clocks.of(slave);
    if ((clock.out_of_reach || !clock.synchronised) && sync.assign_activate != 0)
        co_return Error{.code = Errc::clock_not_reached,
                        .step = kSyncStep,
                        .slave = slave.number,
                        .detail = clock.out_of_reach ? 0 : Error::kReferenceLost,
                        .expected = clock.out_of_reach ? network.clocks.settings.reference : network.clocks.reference};
    // A start that has passed before the signals were activated never comes.
    constexpr unsigned kMostTries = 3;
    constexpr std::int64_t kRateParts = 500;  // 2000 ppm
    SyncStart start{.delay = network.clocks.settings.start_delay};
    for (unsigned n = 0; n < kMostTries; ++n) {
        const auto written = co_await write_sync(network, slave, sync, start);
        if (!written) {
            Error error = written.error();
            error.step = kSyncStep;
            error.slave = slave.number;
            co_return error;
        }
        const Duration taken = network.engine.now() - start.asked;
        if (sync.assign_activate == 0 || network.engine.now() < start.comes - taken / kRateParts) co_return Nothing{};
        start.delay = std::max(start.delay, 2 * taken);
    }
    co_await required(write_clock_register(network.station(slave), reg::kSyncActivation, 0));
    network.clocks.of(slave).end_sync();
    Error passed = invalid_time(Argument::sync_start);
    passed.slave = slave.number;
    passed.actual = kMostTries;
    co_return passed;
}

Task<Result<SyncRegisters>> find_sync(Network& network, Slave& slave, SyncSettings wanted) {
    if (wanted.source != SyncSettings::Source::sii) co_return sync_registers(wanted, network.clocks.settings);
    co_await required(sii_assign(network.station(slave), false));
    auto mode = co_await read_mode(network, slave, wanted.sii_mode);
    auto offered = co_await sii_assign(network.station(slave), true);
    if (mode && !offered) co_return offered.error();
    co_return mode;
}

Task<Result<>> prepare_sync(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    Result<SyncRegisters> sync = clock.sync;
    if (!clock.sync_set) sync = co_await find_sync(network, slave, slave.config.dc());
    if (!sync) {
        Error error = sync.error();
        error.slave = slave.number;
        co_return error;
    }
    if (sync->assign_activate == 0 && !network.clocks.of(slave).sync_active) co_return Result<>();
    co_return co_await required(activate_sync(network, slave, *sync));
}

}  // namespace margay
