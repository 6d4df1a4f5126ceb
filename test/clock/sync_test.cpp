// SYNC signals: activated on a grid, before SAFEOP, and again when a slave comes back. The watch of the clocks, and a
// reference that is lost.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;
using sim::DcUnit;

struct Sync : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};

    // Slaves in a line, clocks in sync, SYNC0 every millisecond.
    void bring_up(unsigned slaves) {
        add_line(slaves);
        start();
        const auto reference = configdc(*ctx, kFewFrames);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        for (std::uint16_t n = 1; n <= slaves; ++n) ctx->slave(n).config.setup = &every_ms;
    }
    std::uint64_t pulses(std::uint16_t slave, unsigned signal = 0) {
        segment.advance(osal.now());
        return segment.slave(slave - 1U).sync().pulses(signal);
    }
    // SYNC0 each millisecond for slave 2.
    void request_while_the_cycle_runs(SyncRequest& request) {
        ASSERT_TRUE(config_map(*ctx, image).ok());
        request.slave = 2;
        request.sync = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms};
        ASSERT_TRUE(submit(*ctx, request).ok());
        cycles(100);
        ASSERT_FALSE(request.busy());
    }
    // The time of the next SYNC0 of a slave within its cycle, in system time.
    std::uint64_t phase_ns(std::uint16_t slave, std::uint64_t cycle = 1'000'000) {
        return register_of<std::uint64_t>(slave, wire::reg::kSyncStartTime) % cycle;
    }
};

TEST_F(Sync, IsActiveBeforeTheSlaveChecksIt) {
    bring_up(4);
    SlaveSetup shifted = every_ms;
    shifted.dc.shift = -100us;
    shifted.dc.assign_activate = 0x0700;
    shifted.dc.sync1_cycle = 250us;
    ctx->slave(3).config.setup = &shifted;
    const std::uint64_t before = segment.slave(0).clock().copy(osal.now());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(ctx->group(0).dc_time.value, 0U);
    for (std::uint16_t n = 1; n <= 4; ++n) {
        EXPECT_EQ(ctx->slave(n).al.state, AlState::safeop) << n;
        EXPECT_TRUE(clock(n).sync_active) << n;
        EXPECT_GE(clock(n).sync_start_ns, before + 100'000'000U) << "in the future";
        EXPECT_LE(clock(n).sync_start_ns, before + 130'000'000U);
        EXPECT_EQ(clock(n).sync_start_ns % 1'000'000, n == 3 ? 900'000U : 0U) << n;
        EXPECT_EQ(register_of<std::uint16_t>(n, wire::reg::kCyclicUnitControl), n == 3 ? 0x0700 : 0x0300) << n;
        EXPECT_EQ(register_of<std::uint32_t>(n, wire::reg::kSync0CycleTime), 1'000'000U) << n;
        EXPECT_EQ(register_of<std::uint32_t>(n, wire::reg::kSync1CycleTime), n == 3 ? 250'000U : 0U) << n;
        EXPECT_EQ(pulses(n), 0U) << n;
    }
    cycles(300);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 4) << "the cycle carries the time of the reference clock by itself";
    EXPECT_LE(greatest_error_ns(4), 100);
    for (std::uint16_t n = 1; n <= 4; ++n) {
        EXPECT_NEAR(static_cast<double>(pulses(n)), static_cast<double>(pulses(1)), 1) << n;
        EXPECT_EQ(phase_ns(n), n == 3 ? 900'000U : 0U) << n;
    }
    EXPECT_EQ(pulses(1, 1), 0U);
    EXPECT_NEAR(static_cast<double>(pulses(3, 1)), static_cast<double>(pulses(3)), 1);
}

TEST_F(Sync, OnTheGridOfTheCaller) {
    add_line(3);
    start();
    ClockSettings settings = kFewFrames;
    settings.start_grid = 8ms;
    settings.start_delay = 20ms;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    ASSERT_TRUE(dcsync0(*ctx, 1, true, 1ms).ok());
    osal.advance(3ms);
    ASSERT_TRUE(dcsync0(*ctx, 2, true, 2ms, 30us).ok());
    osal.advance(3ms);
    ASSERT_TRUE(dcsync01(*ctx, 3, true, 500us, 1500us, -30us).ok());
    EXPECT_EQ(clock(1).sync_start_ns % 8'000'000, 0U);
    EXPECT_EQ(clock(2).sync_start_ns % 8'000'000, 30'000U);
    EXPECT_EQ(clock(3).sync_start_ns % 8'000'000, 7'970'000U);
    ASSERT_TRUE(dcsync0(*ctx, 2, false, 0ms).ok());
    EXPECT_FALSE(clock(2).sync_active);
    EXPECT_EQ(register_of<std::uint8_t>(2, wire::reg::kSyncActivation), 0);
}

TEST_F(Sync, MistakesAreNamed) {
    add({});
    add({.unit = DcUnit::receive_times});
    start();
    EXPECT_EQ(words(dcsync0(*ctx, 1, true, 1ms).error()),
              "slave 1: activating SYNC: not possible in this state (call configdc() before: it has to find a clock)");
    ctx->slave(1).config.setup = &every_ms;
    EXPECT_EQ(config_map(*ctx, image).error().code, Errc::wrong_state);
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_EQ(words(dcsync0(*ctx, 2, true, 1ms).error()), "slave 2: activating SYNC: no clock that runs");
    EXPECT_EQ(dcsync0(*ctx, 1, true, -1ms).error().code, Errc::invalid_argument);
    EXPECT_EQ(dcsync0(*ctx, 1, true, 5s).error().code, Errc::invalid_argument);
    EXPECT_EQ(dcsync01(*ctx, 1, true, 1ms, -1ms).error().code, Errc::invalid_argument);
    EXPECT_EQ(dcsync0(*ctx, 7, true, 1ms).error().code, Errc::unknown_slave);
    ctx->slave(2).config.setup = &every_ms;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::no_clock);
    EXPECT_EQ(mapped.error().slave, 2) << "and slave 1 is in SAFEOP";
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
}

// The features register of slave 2 announces a clock that is switched off. The slave is reported, and the other slaves
// work with SYNC0.
TEST_F(Sync, OfAClockThatIsSwitchedOffIsRefusedAndTheRestRuns) {
    add({});
    add({.unit = DcUnit::none, .features = 0x01CC});
    add({.drift_ppb = 30'000});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t n = 1; n <= 3; ++n) ctx->slave(n).config.setup = &every_ms;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(words(mapped.error()), "slave 2: activating SYNC: no clock that runs");
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return in_op(1) && in_op(3); })) << joined(events());
    cycles(200);  // SYNC0 starts in the future
    const std::uint64_t before = pulses(3);
    const Time begin = osal.now();
    cycles(500);  // each cycle takes at least a millisecond: the library tries slave 2 repeatedly
    EXPECT_NEAR(static_cast<double>(pulses(3) - before), static_cast<double>((osal.now() - begin) / 1ms), 2);
    EXPECT_LE(std::abs(ahead_ns(3)), 100);
}

// There is no clock. The text contains this, and the segment works without clocks.
TEST_F(Sync, WithoutAnyClockTheSegmentRuns) {
    add({.unit = DcUnit::none});
    add({.unit = DcUnit::receive_times});
    start();
    EXPECT_EQ(words(configdc(*ctx, kFewFrames).error()), "synchronising the clocks: no clock that runs");
    run();
    cycles(100);
    EXPECT_TRUE(all_right(*ctx));
    EXPECT_EQ(clock_status(*ctx, osal.now()).reference, 0);
}

TEST_F(Sync, ACycleOfZeroIsOnePulse) {
    add_line(2);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    const std::uint64_t before = pulses(2);
    ASSERT_TRUE(dcsync0(*ctx, 2, true, 0ms, 40us).ok());
    osal.advance(300ms);
    EXPECT_EQ(pulses(2) - before, 1U);
    osal.advance(1s);
    EXPECT_EQ(pulses(2) - before, 1U);
    EXPECT_EQ(clock(2).sync_start_ns % 1'000'000, 40'000U) << "on the grid of ClockSettings::cycle";
}

// Slave 3 loses its power and comes back with a clock that starts at another time. It gets its delay, its offset and
// SYNC in the old phase. The other clocks stay in sync, and their SYNC0 continues.
TEST_F(Sync, ASlaveThatComesBackHasItsOldPhase) {
    bring_up(4);
    run();
    cycles(500);
    (void)events();
    const auto delay = clock(3).delay_ns;
    power(2, false);
    cycles(50);
    const std::uint64_t others = pulses(2);
    const Time back = osal.now();
    power(2, true);
    ASSERT_TRUE(until([&] { return clock(3).sync_active && clock(3).in_sync; }, 1000)) << joined(events());
    EXPECT_LE(std::abs(ahead_ns(3)), 200) << "within a second after the power";
    ASSERT_TRUE(until([&] { return in_op(3) && in_op(4); }, 1500)) << joined(events());
    cycles(300);
    EXPECT_NEAR(static_cast<double>(pulses(2) - others), static_cast<double>((osal.now() - back) / 1ms), 1)
        << "the others have missed or doubled no SYNC0";
    EXPECT_TRUE(clock(3).sync_active);
    EXPECT_EQ(clock(3).delay_ns, delay);
    EXPECT_EQ(register_of<std::uint32_t>(3, wire::reg::kSystemTimeDelay), delay);
    EXPECT_EQ(phase_ns(3), 0U);
    EXPECT_LE(greatest_error_ns(4), 150);
    EXPECT_TRUE(clock(3).in_sync);
    const auto all = events();
    EXPECT_EQ(told(all, "slave 1: clock"), 0) << joined(all);
    EXPECT_EQ(told(all, "slave 2: clock"), 0) << joined(all);
}

TEST_F(Sync, AClockThatLeavesTheLimitIsReported) {
    bring_up(3);
    run();
    cycles(300);
    EXPECT_TRUE(clock(3).in_sync);
    (void)events();
    segment.slave(2).set_drift(3'000'000, osal.now());
    cycles(100);
    auto all = events();
    EXPECT_EQ(told(all, "slave 3: clock out of sync, "), 1) << joined(all);
    EXPECT_EQ(told(all, " ns ahead (limit 200 ns)"), 1) << joined(all);
    EXPECT_EQ(told(all, "slave 2: clock"), 0) << joined(all);
    EXPECT_FALSE(clock(3).in_sync);
    EXPECT_GT(clock(3).difference_ns, 200);
    segment.slave(2).set_drift(10'000, osal.now());
    cycles(3000);
    all = events();
    EXPECT_EQ(told(all, "slave 3: clock in sync, "), 1) << joined(all);
    EXPECT_TRUE(clock(3).in_sync);
}

// Two slaves without an active clock, then a fork: slave 3 with the reference clock at one branch, slaves 4 and 5 at
// the other branch.
struct Fork : Sync {
    void bring_up_fork(const ClockSettings& settings = kFewFrames) {
        segment.add(clocked({.unit = DcUnit::none}).assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        auto root = clocked({.unit = DcUnit::receive_times});
        root.chip.ports = sim::junction().ports;
        const auto fork = segment.add(std::move(root).assemble());
        ASSERT_TRUE(segment.connect({0, 1}, {fork, 0}));
        hang(fork, 3, 30'000);   // slave 3: the reference
        hang(fork, 1, -50'000);  // slave 4
        hang(3, 1, 90'000);      // slave 5
        start();
        const auto reference = configdc(*ctx, settings);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ASSERT_EQ(*reference, 3);
        for (std::uint16_t n = 3; n <= 5; ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        cycles(500);
        (void)events();
        EXPECT_LE(greatest_error_ns(5), 100);
    }
    void hang(std::uint32_t at, std::uint8_t port, std::int32_t drift) {
        auto made = clocked({.drift_ppb = drift, .start_ns = at * 12345});
        made.chip.ports = sim::junction().ports;
        const auto n = segment.add(std::move(made).assemble());
        EXPECT_TRUE(segment.connect({at, port}, {n, 0}, kCable));
    }
};

// The slave with the reference clock loses its power. The next clock becomes the reference with the next cycle and
// keeps its rate. When the lost slave is back, it is the reference again. Without the lost slave the frame arrives at
// slave 4 earlier by its way to slave 3 and back (1.6 µs). One comparison is wrong by this time, and the filter of the
// chip uses a sixteenth of it.
TEST_F(Fork, TheNextClockTakesOverWithoutAStep) {
    bring_up_fork();
    const Time lost = osal.now();
    const auto system = segment.slave(3).clock().copy(lost);
    power(2, false);
    std::int64_t most = 0;
    for (int n = 0; n < 1000; ++n) {
        cycles(1);
        most = std::max(most, std::abs(ahead_ns(4, 5)));
    }
    EXPECT_LE(most, 200) << "the limit";
    EXPECT_LE(greatest_error_ns(5), 100) << "and after a second all is in sync";
    EXPECT_EQ(reference_clock(*ctx), 4);
    auto all = events();
    EXPECT_EQ(told(all, "slave 3 with the reference clock is lost"), 1) << joined(all);
    EXPECT_EQ(told(all, "clock out of sync"), 0) << joined(all);
    EXPECT_EQ(told(all, "the clock of slave 4 is the reference clock now, in place of slave 3"), 1) << joined(all);
    const auto passed = (osal.now() - lost).count();
    EXPECT_NEAR(static_cast<double>(segment.slave(3).clock().copy(osal.now()) - system),
                static_cast<double>(passed) * (1 + 30e-6), static_cast<double>(passed) * 1e-5)
        << "goes on at the rate of the lost clock: 30 ppm";
    power(2, true);
    most = 0;
    for (int n = 0; n < 3000; ++n) {
        cycles(1);
        most = std::max(most, std::abs(ahead_ns(4, 5)));
    }
    EXPECT_TRUE(in_op(3)) << joined(events());
    EXPECT_EQ(reference_clock(*ctx), 3);
    EXPECT_LE(most, 200) << "phase and rate of the reference have not changed";
    EXPECT_LE(greatest_error_ns(5), 100);
    EXPECT_EQ(phase_ns(3), 0U);
}

// The application has chosen that no other clock becomes the reference. The clocks continue at the rates that they have
// learned.
TEST_F(Fork, ALostReferenceMayStayLost) {
    ClockSettings settings = kFewFrames;
    settings.replace_lost_reference = false;
    bring_up_fork(settings);
    power(2, false);
    cycles(500);
    const auto all = events();
    EXPECT_EQ(told(all, "slave 3 with the reference clock is lost"), 1) << joined(all);
    EXPECT_EQ(told(all, "is the reference clock now"), 0) << joined(all);
    EXPECT_EQ(reference_clock(*ctx), 3);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 0);
    EXPECT_LE(std::abs(ahead_ns(4, 5)), 20'000) << "0.5 s without a comparison";
}

// config_map() while the reference is lost: the other slaves are mapped, and the cycle does not carry zeros to their
// clocks.
TEST_F(Fork, ALostReferenceStopsNoMapping) {
    bring_up_fork();
    supervision.cancel();
    cycles(1);
    for (const bool by_number : {true, false}) {
        ctx->group(0).config.dc_reference = by_number ? 3 : 0;
        power(2, false);
        (void)readstate(*ctx);
        ASSERT_EQ(ctx->slave(3).al.state, AlState::none);
        const auto mapped = config_map(*ctx, image);
        EXPECT_EQ(mapped.error().code, Errc::missing_slave) << words(mapped.error());
        EXPECT_TRUE(ctx->group(0).mapped);
        EXPECT_EQ(ctx->slave(4).al.state, AlState::safeop);
        cycles(5);
        EXPECT_EQ(ctx->group(0).dc_time.slaves, 0);
        EXPECT_LE(std::abs(ahead_ns(4, 5)), 2'000);
    }
}

TEST_F(Fork, AReferenceWithoutAClockIsRefused) {
    bring_up_fork();
    supervision.cancel();
    cycles(1);
    ctx->group(0).config.dc_reference = 2;
    EXPECT_EQ(config_map(*ctx, image).error().code, Errc::invalid_argument);
    EXPECT_FALSE(ctx->group(0).mapped);
    for (std::uint16_t n = 3; n <= 5; ++n) EXPECT_FALSE(ctx->slave(n).takes_part) << n;
    ctx->group(0).config.dc_reference = 4;
    EXPECT_EQ(config_map(*ctx, image).error().code, Errc::clock_before_reference);
    for (std::uint16_t n = 3; n <= 5; ++n) EXPECT_FALSE(ctx->slave(n).takes_part) << n;
}

// The way of the frames has changed during operation. The delays are measured again.
TEST_F(Sync, DelaysAreMeasuredAgain) {
    add_line(3);
    start();
    ClockSettings settings = kFewFrames;
    settings.delay_interval = 50ms;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    run();
    cycles(100);
    const auto right = clock(3).delay_ns;
    constexpr std::array<std::byte, 4> kWrong{std::byte{1}, std::byte{2}};
    ASSERT_TRUE(write_register(*ctx, 3, wire::reg::kSystemTimeDelay.address, kWrong).ok());
    cycles(150);
    EXPECT_NEAR(static_cast<double>(register_of<std::uint32_t>(3, wire::reg::kSystemTimeDelay)),
                static_cast<double>(right), 2);
    cycles(1000);
    EXPECT_LE(greatest_error_ns(3), 100);
}

TEST_F(Sync, TheApplicationMayChooseTheStartTime) {
    add_line(2);
    start();
    struct Choice {
        std::uint64_t proposed = 0;
        std::int64_t by = 250'000;
    } choice;
    ClockSettings settings = kFewFrames;
    settings.start_time_user = &choice;
    settings.start_time = [](std::uint16_t slave, std::uint64_t proposed, void* user) {
        auto& mine = *static_cast<Choice*>(user);
        mine.proposed = proposed;
        return slave == 2 ? proposed + static_cast<std::uint64_t>(mine.by) : proposed;
    };
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    ASSERT_TRUE(dcsync0(*ctx, 2, true, 1ms).ok());
    EXPECT_EQ(choice.proposed % 1'000'000, 0U);
    EXPECT_EQ(clock(2).sync_start_ns, choice.proposed + 250'000);
    const std::uint64_t active = clock(2).sync_start_ns;
    choice.by = -1'000'000'000;
    EXPECT_EQ(words(dcsync0(*ctx, 2, true, 1ms).error()),
              "slave 2: activating SYNC: argument out of range: ClockSettings::start_time has returned a time that has "
              "passed");
    EXPECT_TRUE(clock(2).sync_active) << "nothing starts, and nothing ends";
    EXPECT_EQ(clock(2).sync_start_ns, active);
    EXPECT_TRUE(dcsync0(*ctx, 1, true, 1ms).ok());
}

// While the cycle runs, each register is written with another cycle: the start passes before the signals are active.
TEST_F(Sync, AStartThatPassesBeforeTheSlaveActivatesItIsTriedAgain) {
    add_line(2);
    start();
    ClockSettings settings = kFewFrames;
    settings.start_delay = Duration{0};
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    SyncRequest request;
    request_while_the_cycle_runs(request);
    ASSERT_EQ(request.error().code, Errc::none) << words(request.error());
    EXPECT_TRUE(clock(2).sync_active);
    const std::uint64_t before = pulses(2);
    cycles(100);
    EXPECT_GE(pulses(2) - before, 99U);
}

// The start that the application has chosen is too early for a cycle that carries each register.
TEST_F(Sync, AStartThatAlwaysPassesIsAnError) {
    add_line(2);
    start();
    ClockSettings settings = kFewFrames;
    settings.start_time_user = this;
    settings.start_time = [](std::uint16_t, std::uint64_t, void* user) {
        auto& self = *static_cast<Sync*>(user);
        return self.segment.slave(1).clock().copy(self.osal.now()) + 50'000;
    };
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    SyncRequest request;
    request_while_the_cycle_runs(request);
    EXPECT_EQ(words(request.error()),
              "slave 2: activating SYNC: argument out of range: each time the start of SYNC0 has passed before the "
              "slave activated it");
    EXPECT_FALSE(clock(2).sync_active);
}

TEST_F(Sync, ASettingOfDcsync0RemainsAfterAnotherConfigdc) {
    add_line(2);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    ASSERT_TRUE(dcsync0(*ctx, 2, true, 2ms).ok());
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_FALSE(clock(2).sync_active);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_TRUE(clock(2).sync_active);
    EXPECT_EQ(register_of<std::uint32_t>(2, wire::reg::kSync0CycleTime), 2'000'000U);
    // A grid that does not fit is an error, as it is in dcsync0().
    ClockSettings settings = kFewFrames;
    settings.start_grid = 3ms;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    EXPECT_EQ(config_map(*ctx, image).error().detail, static_cast<std::uint32_t>(Argument::sync_grid));
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_FALSE(clock(2).sync_active) << "config_init() forgets it";
}

TEST_F(Sync, ARefusedStartLeavesTheSignalsActive) {
    add_line(2);
    start();
    ClockSettings settings = kFewFrames;
    bool early = false;
    settings.start_time_user = &early;
    settings.start_time = [](std::uint16_t, std::uint64_t proposed, void* user) {
        return *static_cast<bool*>(user) ? proposed - 1'000'000'000 : proposed;
    };
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    ASSERT_TRUE(dcsync0(*ctx, 2, true, 1ms).ok());
    early = true;
    EXPECT_EQ(dcsync0(*ctx, 2, true, 2ms).error().code, Errc::invalid_argument);
    EXPECT_TRUE(clock(2).sync_active);
    osal.advance(200ms);
    const std::uint64_t before = pulses(2);
    osal.advance(100ms);
    EXPECT_EQ(pulses(2) - before, 100U) << "each millisecond as before";
}

// Without these bits of AssignActivate, the chip makes no signal.
TEST(SyncSelection, WithoutASelectedSignalNoneIsActive) {
    for (const std::uint16_t assign : {std::uint16_t{0x0200}, std::uint16_t{0x0100}, std::uint16_t{0x0001}}) {
        SCOPED_TRACE(assign);
        ClockBus bus;
        bus.add_line(1);
        bus.start();
        ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
        SyncRequest request;
        request.slave = 1;
        request.sync = {.source = SyncSettings::Source::application, .assign_activate = assign, .sync0_cycle = 1ms};
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        while (request.busy()) bus.osal.wait(poll(*bus.ctx, bus.osal.now()), -1);
        EXPECT_EQ(request.error().code, Errc::none);
        EXPECT_FALSE(bus.clock(1).sync_active);
        EXPECT_EQ(bus.clock(1).sync_start_ns, 0U);
    }
}

// A new start on this grid would have another phase.
TEST_F(Sync, ACycleThatDoesNotFitTheGridIsRefused) {
    add_line(1);
    start();
    ClockSettings settings = kFewFrames;
    settings.start_grid = 8ms;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    EXPECT_EQ(
        words(dcsync0(*ctx, 1, true, 3ms).error()),
        "slave 1: activating SYNC: argument out of range: ClockSettings::start_grid must be a whole multiple of the "
        "SYNC cycle");
    EXPECT_TRUE(dcsync0(*ctx, 1, true, 4ms).ok());
}

// The offset of one clock changes by 50 µs, as if another program had written it. The clock is reported and comes back
// into sync. The other clocks and their SYNC0 are not affected.
TEST_F(Sync, AClockThatJumpsIsReportedAndComesBack) {
    bring_up(3);
    run();
    cycles(300);
    (void)events();
    const std::uint64_t before = pulses(2);
    const Time begin = osal.now();
    std::array<std::byte, 8> offset{};
    store_le<std::uint64_t>(offset, 0, clock(3).offset_ns + 50'000);
    ASSERT_TRUE(write_register(*ctx, 3, wire::reg::kSystemTimeOffset.address, offset).ok());
    cycles(3000);
    const auto all = events();
    EXPECT_GE(told(all, "slave 3: clock out of sync"), 1) << joined(all);
    EXPECT_EQ(told(all, "slave 1: clock"), 0) << joined(all);
    EXPECT_EQ(told(all, "slave 2: clock"), 0) << joined(all);
    EXPECT_TRUE(clock(3).in_sync);
    EXPECT_LE(greatest_error_ns(3), 100);
    EXPECT_NEAR(static_cast<double>(pulses(2) - before), static_cast<double>((osal.now() - begin) / 1ms), 2);
}

// The first slave of a line, with the reference clock, loses its power. No other clock can become the reference,
// because all of them are behind this slave. When the slave is back, its clock has started again, and the other clocks
// have not. The system time continues.
TEST_F(Sync, TheReferenceOfALineComesBackWithTheOldTime) {
    bring_up(3);
    run();
    cycles(500);
    (void)events();
    const auto shown = [this] { return segment.slave(2).clock().copy(osal.now()); };
    const std::uint64_t before = shown();
    const Time begin = osal.now();
    power(0, false);
    cycles(100);
    power(0, true);
    ASSERT_TRUE(until([&] { return all_in_op(); }, 3000)) << joined(events());
    cycles(2000);
    EXPECT_LE(greatest_error_ns(3), 100) << joined(events());
    EXPECT_EQ(phase_ns(1), 0U);
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_TRUE(clock(n).in_sync) << n;
    EXPECT_NEAR(static_cast<double>(shown() - before), static_cast<double>((osal.now() - begin).count()), 500'000);
}

TEST_F(Sync, TheOnlyClockComesBackWithTheOldTime) {
    bring_up(1);
    run();
    cycles(500);
    const auto shown = [this] { return segment.slave(0).clock().copy(osal.now()); };
    const std::uint64_t before = shown();
    const Time begin = osal.now();
    power(0, false);
    cycles(100);
    power(0, true);
    ASSERT_TRUE(until([&] { return all_in_op(); }, 3000)) << joined(events());
    cycles(500);
    EXPECT_NEAR(static_cast<double>(shown() - before), static_cast<double>((osal.now() - begin).count()), 500'000);
    EXPECT_EQ(phase_ns(1), 0U);
}

// Clocks of 32 bits wrap every 4.29 s, also the reference. No clock exceeds the limit, and SYNC0 continues.
TEST_F(Sync, TimesThatWrap) {
    add({.unit = DcUnit::bits32});
    add({.drift_ppb = 20'000, .start_ns = 0xFFFF'FF00'0000'0000});
    add({.drift_ppb = -20'000, .start_ns = 0xF000'0000, .unit = DcUnit::bits32});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t n = 1; n <= 3; ++n) ctx->slave(n).config.setup = &every_ms;
    run();
    cycles(300);
    (void)events();
    const std::array before{pulses(1), pulses(2), pulses(3)};
    const auto system = clock_status(*ctx, osal.now()).system_time_ns;
    const Time begin = osal.now();
    cycles(9000);
    const auto all = events();
    EXPECT_EQ(told(all, "clock"), 0) << joined(all);
    const auto wanted = static_cast<double>((osal.now() - begin) / 1ms);
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_NEAR(static_cast<double>(pulses(n) - before[n - 1U]), wanted, 2) << n;
    const ClockStatus status = clock_status(*ctx, osal.now());
    EXPECT_TRUE(status.in_sync);
    EXPECT_EQ(status.reference, 1);
    EXPECT_LE(status.greatest_ns, 200U);
    EXPECT_NEAR(static_cast<double>(status.system_time_ns - system), static_cast<double>((osal.now() - begin).count()),
                5000)
        << "64 bits, also from a clock of 32";
}

// Operation mode 1 of the DC category: SYNC0 with twice the cycle, shifted by 25 µs; SYNC1 with every second SYNC0.
TEST_F(Sync, AsTheSiiSays) {
    const std::array<wire::sii::DcOpMode, 2> modes{wire::sii::DcOpMode{.assign_activate = 0x0100},
                                                   wire::sii::DcOpMode{.sync0_shift_time_ns = 25'000,
                                                                       .sync1_shift_time_ns = 40'000,
                                                                       .sync1_cycle_factor = 2,
                                                                       .assign_activate = 0x0730,
                                                                       .sync0_cycle_factor = 2}};
    segment.add(clocked({}, modes).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    SlaveSetup setup{.dc = {.source = SyncSettings::Source::sii, .sii_mode = 1}};
    ctx->slave(1).config.setup = &setup;
    const auto mapped = config_map(*ctx, image);
    ASSERT_TRUE(mapped.ok()) << words(mapped.error());
    EXPECT_EQ(register_of<std::uint16_t>(1, wire::reg::kCyclicUnitControl), 0x0730);
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync0CycleTime), 2'000'000U);
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync1CycleTime), 2'040'000U);
    EXPECT_EQ(clock(1).sync_start_ns % 4'000'000, 25'000U) << "both signals together repeat after two SYNC0";
    setup.dc.sii_mode = 2;
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 1: activating SYNC: not supported by the slave (its SII has no DC operation mode 2)");
    // A SyncRequest may name the mode, too. Without a cycle, it is ClockSettings::cycle.
    const auto request = [this](const SyncSettings& wanted) {
        SyncRequest sync;
        sync.slave = 1;
        sync.sync = wanted;
        EXPECT_TRUE(submit(*ctx, sync).ok());
        while (sync.busy()) osal.wait(poll(*ctx, osal.now()), -1);
        return words(sync.error());
    };
    EXPECT_EQ(request(setup.dc),
              "slave 1: activating SYNC: not supported by the slave (its SII has no DC operation mode 2)");
    EXPECT_EQ(request({.source = SyncSettings::Source::application}), "no error");
    EXPECT_EQ(register_of<std::uint16_t>(1, wire::reg::kCyclicUnitControl), 0x0300);
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync0CycleTime), 1'000'000U);
    setup.dc.sii_mode = 1;
    EXPECT_EQ(request(setup.dc), "no error");
    EXPECT_EQ(register_of<std::uint16_t>(1, wire::reg::kCyclicUnitControl), 0x0730);
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync0CycleTime), 2'000'000U);
}

// A SYNC1 with a negative shift comes after the previous SYNC0. A SYNC1 that is earlier by a whole cycle is refused. A
// slave without SYNC1 is not affected.
TEST_F(Sync, ASync1BeforeItsSync0) {
    constexpr std::array<wire::sii::DcOpMode, 5> kModes{
        wire::sii::DcOpMode{.sync1_shift_time_ns = -40'000, .sync1_cycle_factor = 1, .assign_activate = 0x0700},
        {.sync1_shift_time_ns = -40'000, .sync1_cycle_factor = 2, .assign_activate = 0x0700},
        {.sync1_shift_time_ns = -40'000, .assign_activate = 0x0700},
        {.sync1_shift_time_ns = -1'000'000, .sync1_cycle_factor = 2, .assign_activate = 0x0700},
        {.sync1_shift_time_ns = -1'000'000, .assign_activate = 0x0300}};
    segment.add(clocked({}, kModes).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    SlaveSetup setup{.dc = {.source = SyncSettings::Source::sii}};
    ctx->slave(1).config.setup = &setup;
    constexpr std::array<std::uint32_t, 5> kSync1{960'000, 1'960'000, 960'000, 0, 0};
    for (std::uint8_t mode = 0; mode < 5; ++mode) {
        SCOPED_TRACE(mode);
        setup.dc.sii_mode = mode;
        const auto mapped = config_map(*ctx, image);
        EXPECT_EQ(mapped.ok(), mode != 3);
        if (!mapped)
            EXPECT_EQ(words(mapped.error()),
                      "slave 1: activating SYNC: argument out of range: a SYNC cycle must be 0 to 4.29 s, "
                      "and SYNC1 less than a SYNC0 cycle before its SYNC0");
        else
            EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync1CycleTime), kSync1.at(mode));
    }
}

}  // namespace
}  // namespace margay
