// SYNC signals, and the clock of a slave that comes back.
#include "clock/system_time.hpp"
#include "network/clock_restore.hpp"
#include "network/network.hpp"
#include "station/sii_access.hpp"
#include "util/scoped_flag.hpp"
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

// The SYNC signals of the slave: from dcsync0(), from its configuration, or from its SII.
Task<Result<SyncRegisters>> find_sync(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    const SyncSettings wanted = slave.config.dc();
    if (clock.sync_set) co_return clock.sync;
    if (wanted.source == SyncSettings::Source::none) co_return SyncRegisters{};
    if (wanted.source == SyncSettings::Source::application) co_return sync_registers(wanted, network.clocks.settings);
    co_await required(sii_assign(network.station(slave), false));
    auto mode = co_await read_mode(network, slave, wanted.sii_mode);
    auto offered = co_await sii_assign(network.station(slave), true);
    if (mode && !offered) co_return offered.error();
    co_return mode;
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

// Writes the registers while the start time is still in the future. If a frame was lost meanwhile, the caller tries
// again.
Task<Result<>> write_sync(Network& network, Slave& slave, SyncRegisters sync, Time& asked) {
    const Station station = network.station(slave);
    ClockEntry& clock = network.clocks.of(slave);
    const ClockSettings& settings = network.clocks.settings;
    // First the checks: if the new SYNC signals are refused, the active ones continue.
    if (sync.assign_activate != 0) co_await required(read_pulse_length(network, slave));
    const Error no_edges = check_pulse(clock.pulse_ns, sync);
    if (no_edges.code != Errc::none) co_return no_edges;
    auto off = co_await write_clock_register(station, reg::kSyncActivation, 0);
    clock.end_sync();
    if (!off || sync.assign_activate == 0) co_return off;
    constexpr wire::Register kBothCycles{reg::kSync0CycleTime.address, 8};
    const std::uint64_t cycles = sync.sync0_cycle_ns | std::uint64_t{sync.sync1_cycle_ns} << 32;
    auto written = co_await write_clock_register(station, kBothCycles, cycles);
    if (!written) co_return written;
    asked = network.engine.now();
    auto time = co_await read<std::uint64_t>(station, reg::kSystemTime, kSyncStep);
    if (!time) co_return time.error();
    refresh_system_time(network);
    const std::uint64_t about = network.clocks.system_at_ns(network.engine.now());
    const std::uint64_t now_ns =
        clock.kind == ClockKind::bits64 ? *time : extend_time_ns(static_cast<std::uint32_t>(*time), about);
    // A single pulse has no period of its own.
    const std::uint64_t period = sync_period_ns(sync.sync0_cycle_ns, sync.sync1_cycle_ns);
    const Duration usual = settings.start_grid > Duration{0} ? settings.start_grid : settings.cycle;
    const bool by_period = settings.start_grid <= Duration{0} && period != 0;
    const std::uint64_t grid = by_period ? period : static_cast<std::uint64_t>(usual.count());
    std::uint64_t start_ns =
        start_time_ns(now_ns + static_cast<std::uint64_t>(settings.start_delay.count()), grid, sync.shift_ns);
    if (settings.start_time != nullptr)
        start_ns = settings.start_time(slave.number, start_ns, settings.start_time_user);
    // If the start time has passed, the chip would wait for centuries, or until its 32 bits wrap. If the start time of
    // a clock of 32 bits is more than one wrap ahead, the chip would start too early.
    const auto ahead = static_cast<std::int64_t>(start_ns - now_ns);
    Error refused = invalid_time(Argument::sync_start);
    if (ahead > std::int64_t{UINT32_MAX}) refused.expected = UINT32_MAX;
    if (ahead <= 0 || (clock.kind == ClockKind::bits32 && refused.expected != 0)) co_return refused;
    wire::Register start = reg::kSyncStartTime;
    if (clock.kind == ClockKind::bits32) start.length = 4;
    written = co_await write_clock_register(station, start, start_ns);
    if (!written) co_return written;
    constexpr wire::Register kAssignActivate{reg::kCyclicUnitControl.address, 2};
    written = co_await write_clock_register(station, kAssignActivate, sync.assign_activate);
    clock.sync_active = written.ok();
    if (written) clock.sync_start_ns = start_ns;
    if (written) clock.sync = sync;
    co_return written;
}

// Whether the slave has the offset and the delay that were written, so that its clock was not reset.
Task<Result<bool>> has_its_clock(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    std::array<std::byte, 12> there{};
    const Station station = network.station(slave);
    Datagram look(station.engine.link(), wire::Command::FPRD, {station.address, reg::kSystemTimeOffset.address},
                  MutableBytes(there));
    auto reply = co_await look;
    const Error error = error_of_reply(station, reply, Step::configure_clocks, reg::kSystemTimeOffset.address);
    if (error.code != Errc::none) co_return error;
    const std::uint64_t mask = clock.kind == ClockKind::bits64 ? UINT64_MAX : UINT32_MAX;
    const bool same = ((load_le<std::uint64_t>(there) ^ clock.offset_ns) & mask) == 0 &&
                      load_le<std::uint32_t>(there, 8) == clock.delay_ns;
    if (!same) co_return false;
    co_return co_await required(is_near(network, slave));
}

// A clock that has kept its time while the reference was away; this clock runs at the rate that it has learned.
// nullptr: none.
Slave* kept_clock(Network& network) {
    Clocks& clocks = network.clocks;
    for (Slave& slave : network.slaves()) {
        const ClockEntry& clock = clocks.of(slave);
        if (slave.number != clocks.reference && slave.al.state >= AlState::safeop && clock.synchronised &&
            clock.knows_rate && clock.measured && !clock.delay_old)
            return &slave;
    }
    return nullptr;
}

// The slave with the reference clock was reset: its offset is 0, and its clock begins anew. It gets the system time of
// another clock, or the system time by the master's clock if there is no other one, so that the other clocks need not
// follow a jump. The function latches receive times, and no other sequence latches them now.
Task<Result<>> continue_reference(Network& network) {
    Clocks& clocks = network.clocks;
    Slave& reference = network.slave(clocks.reference);
    Slave* const kept = network.redundancy == nullptr ? kept_clock(network) : nullptr;
    co_await required(latch_receive_times(network));
    const Time sent = clocks.latched_at;
    co_await required(read_receive_times(network, reference, Keep::no));
    if (kept != nullptr) {
        co_await required(read_receive_times(network, *kept, Keep::no));
        const ClockEntry& source = clocks.of(*kept);
        clocks.note_time(source.local_ns + source.offset_ns - source.delay_ns, source.kind == ClockKind::bits64, sent);
    }
    ClockEntry& clock = clocks.of(reference);
    clock.end_sync();
    clock.offset_ns = clock_offset_ns(clocks.system_at_ns(sent), clock.delay_ns, clock.local_ns);
    co_return co_await required(write_clock(network, reference));
}

// Whether the reference clock was reset. Then its offset is 0, or, if the bus shift has written an offset meanwhile,
// its time is far from the expected system time. `offset`: receives the offset register.
Task<Result<bool>> was_reset(Network& network, const Slave& reference, std::uint64_t& offset) {
    constexpr std::int64_t kNearest_ns = 20'000'000;
    constexpr std::int64_t kRateParts = 500;  // 2000 ppm
    const Clocks& clocks = network.clocks;
    const ClockEntry& clock = clocks.entries[reference.number - 1U];
    const Station station = network.station(reference);
    offset = co_await required(read<std::uint64_t>(station, reg::kSystemTimeOffset, Step::configure_clocks));
    if (offset == 0 && clock.offset_ns != 0) co_return true;
    if (clocks.is_driven) co_return false;
    const Time now = network.engine.now();
    const auto time = co_await required(read<std::uint64_t>(station, reg::kSystemTime, Step::configure_clocks));
    const std::uint64_t about = clocks.system_at_ns(now);
    const std::uint64_t seen =
        clock.kind == ClockKind::bits64 ? time : extend_time_ns(static_cast<std::uint32_t>(time), about);
    co_return std::abs(static_cast<std::int64_t>(seen - about)) >
        kNearest_ns + (now - clocks.system_at).count() / kRateParts;
}

}  // namespace

Task<Result<>> restore_reference(Network& network) {
    Clocks& clocks = network.clocks;
    while (clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const ScopedFlag measuring(clocks.measuring);
    std::uint64_t offset = 0;
    const Slave& reference = network.slave(clocks.reference);
    const auto reset = co_await required(was_reset(network, reference, offset));
    if (reset) co_await required(continue_reference(network));
    // The cycles have carried no time since the reference was lost, unless another slave has become the reference
    // meanwhile.
    if (!clocks.paused && clocks.reference == reference.number) (void)carry_time_of(network, &reference);
    co_return Nothing{};
}

namespace {

Slave& reference_of(Network& network, const Slave& slave) {
    return network.slave(network.redundancy == nullptr ? network.clocks.reference
                                                       : network.redundancy->reference_of(network, slave));
}

// Sets the clock of the slave by the clock of the reference: both latch the same frame. If configdc() has not seen the
// slave, its delay is measured first, together with the delays of its neighbours.
Task<Result<>> set_clock_by_reference(Network& network, Slave& slave) {
    Clocks& clocks = network.clocks;
    if (!clocks.of(slave).measured) co_await required(improve_delays(network));
    if (!clocks.of(slave).measured)  // its place in the ring is not known yet
        co_return Error{.code = Errc::unstable, .step = Step::configure_clocks, .slave = slave.number};
    Slave& reference = reference_of(network, slave);
    const auto way = co_await required(measure_way(network, slave, reference));
    while (clocks.measuring) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const ScopedFlag measuring(clocks.measuring);
    (void)find_frame_ways(network);
    std::uint64_t offset = 0;
    const auto reset = co_await required(was_reset(network, reference, offset));
    if (reset && reference.number == clocks.reference) {
        co_await required(continue_reference(network));
        offset = clocks.of(reference).offset_ns;
    }
    co_await required(latch_receive_times(network));
    co_await required(read_receive_times(network, slave, Keep::no));
    co_await required(read_receive_times(network, reference, Keep::no));
    ClockEntry& clock = clocks.of(slave);
    const ClockEntry& source = clocks.of(reference);
    const std::uint64_t system = source.local_ns + offset - source.delay_ns;
    clocks.note_time(system, source.kind == ClockKind::bits64, clocks.latched_at);
    clock.offset_ns = clock_offset_ns(clocks.system_ns, way + source.delay_ns, clock.local_ns);
    co_return co_await required(write_clock(network, slave));
}

// A measurement of the delays does not write the delay of a clock that is being set. So the delay is written again
// here, because delays may have been measured meanwhile.
Task<Result<>> write_delay_again(Network& network, Slave& slave) {
    co_return co_await required(
        write_clock_register(network.station(slave), wire::reg::kSystemTimeDelay, network.clocks.of(slave).delay_ns));
}

// Sends the time until the clock of the slave is within the limit, for kLongest at most. If the clock is still outside
// the limit, the supervision reports it later.
Task<Result<>> wait_for_clock(Network& network, Slave& slave) {
    constexpr Duration kLongest = std::chrono::milliseconds(800);
    const Time give_up = later(network.engine.now(), kLongest);
    unsigned good = 0;
    constexpr unsigned kEnough = 10;
    while (good < kEnough && network.engine.now() < give_up) {
        co_await required(send_time(network));
        co_await required(read_difference(network, slave));
        const std::int64_t away = std::abs(std::int64_t{network.clocks.of(slave).difference_ns});
        good = away <= network.clocks.settings.limit_ns ? good + 1 : 0;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    co_return Result<>();
}

}  // namespace

// The slave is before the reference in the ring, so the time of the reference does not reach the slave: it would
// receive the time that the master has sent. So the cycles stop to carry the time, the clock of the slave is set by the
// reference, and the slave becomes the reference. Meanwhile the other clocks run at their rates.
Task<Result<>> become_reference(Network& network, Slave& slave, ClockRate rate) {
    Clocks& clocks = network.clocks;
    constexpr Duration kLongestOther = std::chrono::seconds(8);
    // With long cycles the measurement takes long. The cycles still carry the time meanwhile.
    if (!clocks.of(slave).measured) co_await required(improve_delays(network));
    const Time give_up = later(network.engine.now(), kLongestOther);
    while (network.redundancy == nullptr && clocks.paused && network.engine.now() < give_up)
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));  // another slave becomes the reference now
    (void)carry_time_of(network, nullptr);
    TimePause pause(network);
    // After a loss of power, the control loop corrects the clock at the greatest rate, and would continue while the
    // clock is being set.
    auto set = co_await reset_control_loop(network.station(slave));
    if (set) set = co_await set_clock_by_reference(network, slave);
    if (set && rate == ClockRate::of_reference) set = co_await learn_rate(network, slave, reference_of(network, slave));
    // Another slave, before this one, may have become the reference meanwhile.
    const bool first =
        set && slave.ring_position != 0 && slave.ring_position < network.slave(clocks.reference).ring_position;
    clocks.of(slave).synchronised = set.ok();
    if (set) set = co_await write_delay_again(network, slave);
    clocks.lose_sync(slave);
    if (first) co_await completion(set_reference(network, slave));
    // If the new reference has another rate, the clocks that follow it need time to learn this rate. The clocks that do
    // not follow the slave are not in step with it.
    for (const Slave& other : network.slaves())
        if (first && (rate == ClockRate::own || followed_clock(network, other).slave != slave.number))
            clocks.lose_sync(other);
    const Slave& reference = network.slave(clocks.reference);
    (void)carry_time_of(network, &reference);
    pause.end();
    co_return set;
}

namespace {

// A branch before the reference has come back: whether another slave with a clock is before this slave. Then the other
// slave becomes the reference, and this slave follows it; until then, this slave receives the time that the master
// sends. If the other slave does not reach its state, return_to_first_clock() makes this slave the reference.
bool follows_another(Network& network, const Slave& slave) {
    if (network.redundancy != nullptr) return false;
    return std::ranges::any_of(network.slaves(), [&network, &slave](const Slave& other) {
        return other.ring_position != 0 && other.ring_position < slave.ring_position &&
               other.al.state != AlState::none && is_clock(network.clocks.of(other).kind) &&
               !note_reach(network, network.slave(other.number));
    });
}

// calm_rate() sets the deepest filter. A slave that was lost meanwhile may still have this filter.
Task<Result<>> restore_filter(Network& network, const Slave& slave) {
    const wire::Register filter = wire::reg::kSystemTimeDifferenceFilter;
    const auto depth = co_await required(read<std::uint8_t>(network.station(slave), filter, Step::configure_clocks));
    if (depth != kDeepestFilter) co_return Nothing{};
    co_return co_await required(write_clock_register(network.station(slave), filter, kUsualFilter));
}

Task<Result<>> restore_clock(Network& network, Slave& slave) {
    Clocks& clocks = network.clocks;
    ClockEntry& clock = clocks.of(slave);
    if (clock.kind == ClockKind::unknown) {
        co_await required(probe_clock(network, slave));
    }
    if (!is_clock(clock.kind) || clocks.reference == 0 || note_reach(network, slave)) co_return Result<>();
    if (clocks.reference == slave.number) co_return co_await required(restore_reference(network));
    if (clock.synchronised) {
        co_await required(restore_filter(network, slave));
        const auto same = co_await required(has_its_clock(network, slave));
        if (same) co_return Result<>();
    }
    clock.synchronised = false;
    clock.end_sync();
    clock.follows = 0;
    clocks.lose_sync(slave);
    // set_late_clock() sets the clock when the reference is back, or when another slave has become the reference.
    if (network.slave(clocks.reference).al.state == AlState::none) co_return Result<>();
    const Slave& reference = network.slave(clocks.reference);
    // 0: its place in the ring is not known yet.
    const bool before = slave.ring_position != 0 && slave.ring_position < reference.ring_position && !clock.beside;
    if (before && !is_way_unknown(network, slave, reference) && !follows_another(network, slave))
        co_return co_await required(become_reference(network, slave, ClockRate::of_reference));
    co_await required(set_clock_by_reference(network, slave));
    clock.synchronised = true;
    co_await required(write_delay_again(network, slave));
    if (before && network.redundancy == nullptr) co_return Result<>();
    co_return co_await required(wait_for_clock(network, slave));
}

}  // namespace

// A slave that was away may not have received a time since then, so its difference register may be old.
Task<Result<bool>> is_near(Network& network, Slave& slave) {
    const ClockEntry& clock = network.clocks.of(slave);
    Slave& reference = reference_of(network, slave);
    if (!clock.synchronised || network.clocks.reference == slave.number) co_return true;
    if (reference.al.state == AlState::none) co_return true;  // without the reference, no comparison is possible
    const bool watched = network.clocks.settings.watch_interval > Duration{0};
    if (!watched || (!clock.is_in_step() && !clock.knows_difference())) {
        const auto ahead = co_await required(measure_ahead(network, slave, reference));
        co_return std::abs(ahead) <= kNear_ns;
    }
    co_await required(read_difference(network, slave));
    co_return std::abs(std::int64_t{clock.difference_ns}) <= kNear_ns;
}

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
    constexpr unsigned kMostTries = 3;
    Result<> written;
    for (unsigned n = 0; n < kMostTries; ++n) {
        Time asked{};
        written = co_await write_sync(network, slave, sync, asked);
        const bool late = network.engine.now() - asked > network.clocks.settings.start_delay / 2;
        if (!written || !late || sync.assign_activate == 0) break;
    }
    if (written) co_return written;
    Error error = written.error();
    error.step = kSyncStep;
    error.slave = slave.number;
    co_return error;
}

Task<Result<>> prepare_clock(Network& network, Slave& slave) {
    co_await required(restore_clock(network, slave));
    auto sync = co_await find_sync(network, slave);
    if (!sync) {
        Error error = sync.error();
        error.slave = slave.number;
        co_return error;
    }
    if (sync->assign_activate == 0 && !network.clocks.of(slave).sync_active) co_return Result<>();
    co_return co_await required(activate_sync(network, slave, *sync));
}

}  // namespace margay
