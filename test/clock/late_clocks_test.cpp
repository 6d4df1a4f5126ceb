// Clocks that come while other clocks are in operation: with long cycles, while the chosen reference is lost, and after
// the reference was reset.
#include "clock/late_clocks_bus.hpp"

#include <margay/master_clock.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct LateClocks : testing::Test, LateClocksBus {};

// The cycle carries no time while the new reference learns its rate. Separate frames bring the time to the other
// clocks.
TEST(LateReference, LearnsWithLongCyclesWhileTheOthersStayInSync) {
    for (const Duration cycle : {1ms, 4ms, 10ms}) {
        SCOPED_TRACE(cycle / 1ms);
        LateClocksBus bus;
        bus.period = cycle;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = -90'000, .start_ns = 12345}, true);
        bus.hang(1, {.drift_ppb = 20'000, .start_ns = 1234});
        bus.hang(2, {.drift_ppb = 70'000, .start_ns = 123});
        bus.setup = {};
        bus.bring_up(kFewFrames, {1});
        ASSERT_EQ(reference_clock(*bus.ctx), 3);
        bus.power(1, true);
        bool configured = false;
        std::int64_t most = 0;
        unsigned out = 0;
        for (Duration passed{}; passed < 15s; passed += cycle) {
            bus.step();
            if (!configured && bus.ctx->slave(2).al.state == AlState::preop)
                configured = config_map(*bus.ctx, bus.image).ok();
            out += bus.clock(3).in_sync && bus.clock(4).in_sync ? 0U : 1U;
            most = std::max(most, std::abs(bus.ahead_ns(4, 3)));
        }
        EXPECT_EQ(reference_clock(*bus.ctx), 2);
        EXPECT_TRUE(bus.clock(2).in_sync);
        // A rate within 2.5 ppm exceeds the limit only if the clocks are compared every 10 ms.
        EXPECT_LE(out, cycle < 10ms ? 0U : 150U) << bus.joined(bus.events());
        EXPECT_LE(most, 300);
    }
}

// Another program writes the offset of the slave that has become the reference meanwhile.
TEST_F(LateClocks, AReferenceReturnsToClocksThatWereMoved) {
    for (const std::int64_t jump_ns : {500'000, -150'000, 50'000}) {
        SCOPED_TRACE(jump_ns);
        LateClocksBus bus;
        bus.hang(0, {.drift_ppb = 40'000, .start_ns = 99});
        bus.hang(1, {.drift_ppb = -30'000, .start_ns = 0x7'1234'5678});
        bus.bring_up(kFewFrames, {});
        bus.power(0, false);
        bus.power(0, true);
        bus.steps(21);
        ASSERT_EQ(reference_clock(*bus.ctx), 2);
        std::array<std::byte, 8> offset{};
        store_le<std::uint64_t>(offset, 0, bus.clock(2).offset_ns + static_cast<std::uint64_t>(jump_ns));
        RegisterWriteRequest write;
        write.slave = 2;
        write.address = wire::reg::kSystemTimeOffset.address;
        write.data = offset;
        ASSERT_TRUE(submit(*bus.ctx, write).ok());
        for (int n = 0; write.busy() && n < 100; ++n) bus.step();
        ASSERT_EQ(write.error().code, Errc::none);
        bus.steps(5000);
        EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::op) << bus.joined(bus.events());
        EXPECT_LE(bus.greatest_error_ns(2), 200);
    }
}

// The reference gets the time that the other clocks have kept, and not the time of the master.
TEST_F(LateClocks, AReferenceThatReturnsMakesNoStep) {
    hang(0, {.drift_ppb = 50'000, .start_ns = 0x1234'5678'9ABCULL});
    hang(3, {.drift_ppb = 20'000, .start_ns = 7});
    hang(1, {.drift_ppb = -20'000, .start_ns = 77});
    setup = {};
    ClockSettings settings = kFewFrames;
    settings.replace_lost_reference = false;
    bring_up(settings, {});
    for (int times = 0; times < 3; ++times) {
        power(0, false);
        steps(40);
        power(0, true);
        std::int64_t most = 0;
        bool seen_lost = false;
        for (int n = 0; n < 4000; ++n) {
            step();
            seen_lost |= !in_op(1);
            if (seen_lost && in_op(1)) most = std::max(most, std::abs(ahead_ns(2)));
        }
        EXPECT_TRUE(seen_lost && all_in_op()) << joined(events());
        EXPECT_LE(most, 250) << joined(events());
    }
}

// A clock of 32 bits wraps every 4.29 s, so it would start the signal whole wraps too early.
TEST_F(LateClocks, AStartThatAClockOf32BitsCannotWaitForIsRefused) {
    add({});
    add({.start_ns = 77, .unit = sim::DcUnit::bits32});
    start();
    ClockSettings settings = kFewFrames;
    settings.start_delay = 5s;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    EXPECT_TRUE(dcsync0(*ctx, 1, true, 1ms).ok());
    const auto refused = dcsync0(*ctx, 2, true, 1ms);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, Errc::invalid_argument);
    EXPECT_NE(words(refused.error()).find("more than 4.29 s ahead, and the clock of the slave has 32 bits"),
              std::string::npos)
        << words(refused.error());
    EXPECT_FALSE(clock(2).sync_active);
}

// The library knows the cycle of the bus if MasterClock keeps the cycle in step.
TEST_F(LateClocks, SyncThatIsNoMultipleOfTheCycleIsNamed) {
    for (int n = 0; n < 4; ++n) add({.start_ns = 77});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    constexpr Duration kCycles[] = {1ms, 1500us, 250us, 3ms};
    for (std::uint16_t n = 1; n <= 4; ++n) EXPECT_TRUE(dcsync0(*ctx, n, true, kCycles[n - 1]).ok());
    MasterClock master({.set_value = -200us, .phase = {.cycle = 1ms}});
    int left = 5000;
    const auto work = [&](const CycleInfo&) { return --left > 0; };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
    ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
    const std::string told = joined(errors());
    EXPECT_NE(told.find("slave 2: "), std::string::npos) << told;
    EXPECT_NE(told.find("SYNC0 each 1500000 ns is neither a whole multiple nor a whole part of the cycle of 1000000"),
              std::string::npos)
        << told;
    for (const int right : {1, 3, 4}) EXPECT_EQ(told.find("slave " + std::to_string(right)), std::string::npos) << told;
}

// The cycle of MasterClock is known exactly, at any time while it is in sync.
TEST_F(LateClocks, SyncThatComesLaterOrDiffersLittleIsNamed) {
    for (int n = 0; n < 4; ++n) add({.start_ns = 77});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    EXPECT_TRUE(dcsync0(*ctx, 1, true, Duration(1'000'001)).ok());
    EXPECT_TRUE(dcsync0(*ctx, 2, true, Duration(10'000'010)).ok());
    MasterClock master({.set_value = -200us, .phase = {.cycle = 1ms}});
    int left = 5000;
    const auto work = [&](const CycleInfo&) { return --left > 0; };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
    ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
    const auto first = errors();
    EXPECT_EQ(told(first, "slave 1: activating SYNC: argument out of range: SYNC0 each 1000001 ns"), 1)
        << joined(first);
    EXPECT_EQ(told(first, "slave 2: "), 1) << joined(first);
    EXPECT_TRUE(dcsync0(*ctx, 3, true, 1500us).ok());
    EXPECT_TRUE(dcsync0(*ctx, 4, true, 3ms).ok());
    left = 500;
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
    const auto then = errors();
    EXPECT_EQ(told(then, "slave 3: activating SYNC: argument out of range: SYNC0 each 1500000 ns"), 1) << joined(then);
    EXPECT_EQ(then.size(), 1U) << joined(then);
}

// The application stops for an odd time between two calls, for example from reach() to run_cycle().
TEST_F(LateClocks, TheCycleKeepsItsPhaseFromCallToCall) {
    add({});
    add({.drift_ppb = 30'000, .start_ns = 0x1234'5678'9ABCULL});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    MasterClock master({.set_value = -200us, .phase = {.cycle = 1ms}});
    int left = 0;
    const auto work = [&](const CycleInfo&) { return --left > 0; };
    left = 5000;
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
    ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
    for (const Duration pause : {0us, 370us, 3370us, 90'910us}) {
        osal.advance(pause);
        master.reset_statistics();
        left = 200;
        ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
        EXPECT_EQ(master.state(), PhaseState::in_sync) << pause / 1us;
        EXPECT_LE(master.most_ns(), 5000U) << pause / 1us;
    }
}

// The SYNC signals of this slave would drift away. The error says that the reference is lost, and not that the slave is
// before the reference.
TEST_F(LateClocks, ASlaveWithSyncFirstSeenWhileTheChosenReferenceIsLost) {
    hang(0, {.drift_ppb = 50'000});
    hang(3, {.drift_ppb = 20'000, .start_ns = 7}, true);
    hang(1, {.drift_ppb = -20'000, .start_ns = 77}, true);
    hang(2, {.drift_ppb = -70'000, .start_ns = 777});
    setup = {.dc = {.source = SyncSettings::Source::application, .assign_activate = 0x0300, .sync0_cycle = 1ms}};
    ClockSettings settings = kFewFrames;
    settings.reference = 2;
    settings.replace_lost_reference = false;
    bring_up(settings, {2});
    power(1, false);
    steps(1000);
    power(2, true);
    steps(1500);
    (void)config_map(*ctx, image);
    steps(2000);
    const std::string told = joined(events());
    EXPECT_NE(told.find("slave 3: activating SYNC: the reference clock does not synchronise the clock (lost: slave 2)"),
              std::string::npos)
        << told;
    power(1, true);
    steps(5000);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::op) << joined(events());
    EXPECT_TRUE(clock(3).in_sync && clock(3).sync_active);
}

// With a long cycle there is no time for all comparisons.
TEST_F(LateClocks, AClockThatIsWithinTheLimitBesideALongCycleIsInSync) {
    for (const int drift : {0, 5000, 10000}) add({.drift_ppb = drift});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    for (const Duration cycle : {4ms, 60ms, 100ms}) {
        ClockRequest request;
        request.settings = kFewFrames;
        request.settings.limit_ns = 10'000;
        ASSERT_TRUE(submit(*ctx, request).ok());
        for (Duration passed{}; passed < 30s && request.busy(); passed += cycle) {
            osal.advance(cycle);
            (void)send_processdata(*ctx, 0);
            (void)receive_processdata(*ctx, 300us, 0);
            (void)poll(*ctx, osal.now());
        }
        EXPECT_EQ(request.state(), RequestState::success) << cycle / 1ms << ": " << words(request.error());
    }
}

// The cycle before the pause began late. Its delay does not count as phase.
TEST_F(LateClocks, TheCycleKeepsItsPhaseAfterALateCycle) {
    add({});
    add({.drift_ppb = 30'000, .start_ns = 0x1234'5678'9ABCULL});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    MasterClock master({.set_value = -200us, .phase = {.cycle = 1ms}});
    for (const Duration late : {0us, 100us, 400us, 800us}) {
        int left = 5000;
        const auto work = [&](const CycleInfo&) {
            if (--left == 1) osal.advance(900us + late);
            return left > 0;
        };
        ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, work).ok());
        osal.advance(370us);
        master.reset_statistics();
        left = 200;
        const auto on_time = [&](const CycleInfo&) { return --left > 0; };
        ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &master}, on_time).ok());
        EXPECT_EQ(master.state(), PhaseState::in_sync) << late / 1us;
        EXPECT_LE(master.most_ns(), 5000U) << late / 1us;
    }
}

// The difference between the new slave and the chosen reference is not known before the reference is back.
TEST_F(LateClocks, AClockFirstSeenWhileTheChosenReferenceIsLost) {
    hang(0, {.drift_ppb = 50'000});
    hang(3, {.drift_ppb = 20'000, .start_ns = 7}, true);
    hang(1, {.drift_ppb = -20'000, .start_ns = 77}, true);
    hang(2, {.drift_ppb = -70'000, .start_ns = 777});
    setup = {};
    ClockSettings settings = kFewFrames;
    settings.reference = 2;
    bring_up(settings, {2});
    power(1, false);
    steps(1000);
    power(2, true);
    steps(1500);
    (void)config_map(*ctx, image);
    steps(2000);
    power(1, true);
    steps(5000);
    const std::string told = joined(events());
    EXPECT_EQ(told.find("slave 3: its clock is not synchronised"), std::string::npos) << told;
    EXPECT_TRUE(clock(3).synchronised && clock(3).in_sync) << told;
    EXPECT_LE(std::abs(ahead_ns(3, 4)), 300) << told;
}

// No other clock becomes the reference. A slave that was reset meanwhile has its own time until the reference is back.
TEST_F(LateClocks, ASlaveThatIsResetWhileTheReferenceIsLost) {
    hang(0, {.drift_ppb = 50'000});
    hang(3, {.drift_ppb = 20'000, .start_ns = 7});
    hang(1, {.drift_ppb = -20'000, .start_ns = 77});
    ClockSettings settings = kFewFrames;
    settings.reference = 2;
    settings.replace_lost_reference = false;
    setup = {};
    bring_up(settings, {});
    power(1, false);
    steps(1000);
    EXPECT_TRUE(clock(3).synchronised) << "it goes on at its rate";
    power(2, false);
    steps(100);
    power(2, true);
    steps(3000);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::op) << joined(events());
    EXPECT_FALSE(clock(3).synchronised || clock(3).in_sync || clock(3).sync_active) << "it has its own time";
    power(1, true);
    steps(5000);
    EXPECT_TRUE(clock(3).synchronised && clock(3).in_sync) << joined(events());
    EXPECT_LE(std::abs(ahead_ns(3, 2)), 300);
}

// The first reference has 64 bits and the next reference 32 bits, or the other way round. The time continues above 32
// bits.
TEST_F(LateClocks, AReferenceWithAnotherWidthKeepsThePhase) {
    for (const bool wide_first : {true, false}) {
        SCOPED_TRACE(wide_first);
        LateClocksBus bus;
        const auto unit = [wide_first](bool first) {
            return first == wide_first ? sim::DcUnit::bits64 : sim::DcUnit::bits32;
        };
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 10'000, .start_ns = 7, .unit = unit(true)});
        bus.hang(1, {.drift_ppb = 30'000, .start_ns = 77, .unit = unit(false)});
        bus.hang(2, {.drift_ppb = -20'000, .start_ns = 777});
        bus.osal.advance(6s);  // more than 32 bits
        bus.bring_up(kFewFrames, {});
        MasterClock master({.set_value = -500us, .phase = {.cycle = 1ms}});
        int left = 0;
        ClockRecord last;
        unsigned steps = 0;
        const auto work = [&](const CycleInfo&) {
            const ClockRecord now = master.record();
            if (!now.read) return --left > 0;
            const auto passed = static_cast<std::int64_t>(now.bus_time_ns - last.bus_time_ns);
            steps += last.read && std::abs(passed - (now.at - last.at).count()) > 50'000 ? 1U : 0U;
            last = now;
            return --left > 0;
        };
        const auto run_for = [&](int count) {
            left = count;
            last = {};
            return run_cycle(*bus.ctx, {.period = 1ms, .clock = &master}, work).ok();
        };
        ASSERT_TRUE(run_for(4000));
        ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
        const auto phase_ns = [&bus] {  // of SYNC0 of slave 4, in true time
            bus.segment.advance(bus.osal.now());
            return (bus.segment.slave(3).sync().next() - bus.osal.now()).count();
        };
        const auto before = phase_ns();
        bus.power(1, false);
        ASSERT_TRUE(run_for(5000));
        EXPECT_EQ(reference_clock(*bus.ctx), 3) << bus.joined(bus.events());
        EXPECT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
        EXPECT_NEAR(static_cast<double>(phase_ns()), static_cast<double>(before), 5000);
        EXPECT_EQ(master.record().bus_time_ns >> 32, clock_status(*bus.ctx, bus.osal.now()).system_time_ns >> 32);
        bus.power(1, true);
        ASSERT_TRUE(run_for(12'000));
        EXPECT_EQ(reference_clock(*bus.ctx), 2) << bus.joined(bus.events());
        EXPECT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
        EXPECT_NEAR(static_cast<double>(phase_ns()), static_cast<double>(before), 5000);
        EXPECT_EQ(steps, 0U) << "the time has no steps";
    }
}

// With cycles of 20 ms the lessons end before the slave has learned the rate, so it becomes the reference with another
// rate. A clock that learns this rate is not in sync.
TEST(LateReference, WithAnotherRateEndsTheSyncOfTheOthers) {
    LateClocksBus bus;
    bus.period = 20ms;
    bus.nic_options.round_trip = 20us;  // each frame of a lesson takes a cycle
    bus.hang(0, {.unit = sim::DcUnit::receive_times});
    bus.hang(3, {.drift_ppb = -90'000, .start_ns = 12345}, true);
    bus.hang(1, {.drift_ppb = 20'000, .start_ns = 1234});
    bus.hang(2, {.drift_ppb = 70'000, .start_ns = 123});
    bus.setup = {};
    bus.bring_up(kFewFrames, {1});
    ASSERT_EQ(reference_clock(*bus.ctx), 3);
    bus.power(1, true);
    bool configured = false;
    unsigned untrue = 0;
    unsigned in_sync = 0;  // cycles behind the change
    for (Duration passed{}; passed < 60s; passed += bus.period) {
        bus.step();
        if (!configured && bus.ctx->slave(2).al.state == AlState::preop)
            configured = config_map(*bus.ctx, bus.image).ok();
        for (const std::uint16_t slave : {std::uint16_t{3}, std::uint16_t{4}}) {
            const bool away = std::abs(bus.ahead_ns(slave, reference_clock(*bus.ctx))) > 1000;
            untrue += bus.clock(slave).in_sync && away ? 1U : 0U;
            in_sync += bus.clock(slave).in_sync && reference_clock(*bus.ctx) == 2 ? 1U : 0U;
        }
    }
    EXPECT_EQ(reference_clock(*bus.ctx), 2);
    EXPECT_GT(in_sync, 200U) << "they have learned it";
    EXPECT_EQ(untrue, 0U) << bus.joined(bus.events());
}

// The same for a slave that has kept its clock, and whose oscillator changes.
TEST(LateReference, ThatRunsAtAnotherRateEndsTheSyncOfTheOthers) {
    LateClocksBus bus;
    bus.period = 20ms;
    bus.nic_options.round_trip = 20us;
    bus.hang(0, {.unit = sim::DcUnit::receive_times});
    bus.hang(3, {.drift_ppb = -30'000, .start_ns = 12345});
    bus.hang(1, {.drift_ppb = 20'000, .start_ns = 1234});
    bus.hang(2, {.drift_ppb = 70'000, .start_ns = 123});
    bus.setup = {};
    bus.bring_up(kFewFrames, {});
    ASSERT_EQ(reference_clock(*bus.ctx), 2);
    bus.segment.disconnect({0, 3});
    bus.steps(200);
    ASSERT_EQ(reference_clock(*bus.ctx), 3);
    ASSERT_TRUE(bus.segment.connect({0, 3}, {1, 0}, LateClocksBus::kCable));
    unsigned untrue = 0;
    unsigned in_sync = 0;  // cycles before the change
    unsigned returned = 0;
    for (int n = 0; n < 2000; ++n) {
        bus.step();
        if (n == 5) bus.segment.slave(1).set_drift(100'000, bus.osal.now());
        const std::uint16_t reference = reference_clock(*bus.ctx);
        returned += reference == 2 ? 1U : 0U;
        for (const std::uint16_t slave : {std::uint16_t{3}, std::uint16_t{4}}) {
            in_sync += bus.clock(slave).in_sync && returned == 0 ? 1U : 0U;
            untrue += bus.clock(slave).in_sync && std::abs(bus.ahead_ns(slave, reference)) > 1000 ? 1U : 0U;
        }
    }
    EXPECT_GT(in_sync, 300U);
    EXPECT_GT(returned, 1000U);
    EXPECT_EQ(untrue, 0U) << bus.joined(bus.events());
}

// A reference that has taken over runs at the rate of another oscillator. When it loses its power and is back before
// another clock has taken over, it has its own rate, and the other clocks do not have this rate.
TEST(LateReference, ThatHasForgottenTheRateEndsTheSyncOfTheOthers) {
    for (const int off : {5, 20, 35, 60, 80}) {
        SCOPED_TRACE(off);
        LateClocksBus bus;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 90'000, .start_ns = 123});
        bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
        bus.hang(2, {.drift_ppb = -30'000, .start_ns = 12345});
        bus.bring_up({.watch_interval = 100ms}, {});
        bus.power(1, false);
        bus.steps(2000 + off);
        ASSERT_EQ(reference_clock(*bus.ctx), 3);
        ASSERT_TRUE(bus.clock(4).in_sync);
        ASSERT_LE(std::abs(bus.ahead_ns(4, 3)), 200);
        (void)bus.events();
        bus.power(2, false);
        bus.steps(3);
        bus.power(2, true);
        bool seen = false;
        unsigned untrue = 0;
        for (int n = 0; n < 3000; ++n) {
            bus.step();
            seen |= !bus.in_op(3);
            const std::uint16_t reference = reference_clock(*bus.ctx);
            const bool away = std::abs(bus.ahead_ns(4, reference)) > 1000;
            untrue += seen && bus.in_op(reference) && bus.clock(4).in_sync && away ? 1U : 0U;
        }
        EXPECT_TRUE(bus.clock(4).in_sync);
        EXPECT_EQ(untrue, 0U) << bus.joined(bus.events());
    }
}

// The master writes its time to the reference, so that a reference which has come back leaves the time of the other
// clocks. With cycles of 10 ms, 32 comparisons take 320 ms.
TEST(LateReference, ThatIsLedAwayEndsTheSyncOfTheOthersSoon) {
    LateClocksBus bus;
    bus.period = 10ms;
    bus.hang(0, {.unit = sim::DcUnit::receive_times});
    bus.hang(3, {.drift_ppb = 50'000, .start_ns = 123});
    bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
    bus.hang(2, {.drift_ppb = -30'000, .start_ns = 12345});
    bus.bring_up({}, {});
    MasterClock master(
        {.mode = MasterClock::Mode::master_reference, .set_value = -5ms, .phase = {.cycle = bus.period}});
    unsigned longest = 0;
    unsigned untrue = 0;
    unsigned in_sync = 0;
    const auto cycles = [&](int count) {
        for (int n = 0; n < count; ++n) {
            bus.step();
            (void)master.update(*bus.ctx, 0ms);
            const std::uint16_t reference = reference_clock(*bus.ctx);
            bool wrong = false;
            for (std::uint16_t slave = 2; slave <= 4; ++slave) {
                const bool told = bus.in_op(reference) && bus.in_op(slave) && bus.clock(slave).in_sync;
                in_sync += told ? 1U : 0U;
                wrong |= told && std::abs(bus.ahead_ns(slave, reference)) > 1000;
            }
            longest = std::max(longest, untrue = wrong ? untrue + 1 : 0U);
        }
    };
    cycles(1500);
    for (int times = 0; times < 3; ++times) {
        bus.power(1, false);
        cycles(150);
        bus.power(1, true);
        cycles(1500);
    }
    EXPECT_GT(in_sync, 3000U);
    EXPECT_LE(longest, 6U) << "of about 10 ms each";
}

// A slave that has come back is set by the reference. Before this, the library reads whether the reference was reset.
// With long cycles, a lost frame is repeated much later.
TEST(LateReference, IsNotSetAgainWhereAFrameIsLost) {
    for (const Duration cycle : {1ms, 4ms, 30ms, 95ms}) {
        SCOPED_TRACE(cycle / 1ms);
        LateClocksBus bus;
        bus.period = cycle;
        bus.nic_options.round_trip = 20us;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 50'000, .start_ns = 12345});
        bus.hang(1, {.drift_ppb = -20'000, .start_ns = 1234});
        bus.bring_up(kFewFrames, {});
        ASSERT_EQ(reference_clock(*bus.ctx), 2);
        const std::uint64_t offset = bus.clock(2).offset_ns;
        bus.segment.set_noise({.lost = 0.05, .seed = 7});
        unsigned back = 0;
        for (unsigned times = 0; times < 20; ++times) {
            bus.power(2, false);
            bus.steps(20);
            bus.power(2, true);
            for (unsigned n = 0; n < 2000 && bus.in_op(3); ++n) bus.step();
            for (unsigned n = 0; n < 4000 && !bus.in_op(3); ++n) bus.step();
            back += bus.in_op(3) ? 1U : 0U;
            ASSERT_EQ(reference_clock(*bus.ctx), 2);
            ASSERT_EQ(bus.clock(2).offset_ns, offset) << bus.joined(bus.events());
        }
        EXPECT_GE(back, 15U);
    }
}

// No clock is compared with the register of the reference, so the reference does not wait for 32 frames with its own
// time.
TEST(LateReference, IsInSyncWhenItsSlaveIsBack) {
    LateClocksBus bus;
    bus.period = 10ms;
    bus.hang(0, {.unit = sim::DcUnit::receive_times});
    bus.hang(3, {.drift_ppb = 50'000, .start_ns = 123});
    bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
    bus.bring_up({}, {});
    ASSERT_EQ(reference_clock(*bus.ctx), 2);
    bus.power(1, false);
    bus.steps(50);
    ASSERT_EQ(reference_clock(*bus.ctx), 3);
    bus.power(1, true);
    for (unsigned n = 0; n < 200 && !bus.in_op(2); ++n) bus.step();
    bus.steps(3);
    EXPECT_EQ(reference_clock(*bus.ctx), 2);
    EXPECT_TRUE(bus.in_op(2) && bus.clock(2).in_sync) << bus.joined(bus.events());
    EXPECT_LE(std::abs(bus.ahead_ns(3, 2)), 200);
}

// A slave that was power-cycled is back within its limit in less than a second. Its SYNC signals start at the first
// attempt, although the library needs several cycles to write their registers.
TEST(LateReference, WithLongCyclesIsBackWithinASecond) {
    for (const int off : {5, 50, 200}) {
        SCOPED_TRACE(off);
        LateClocksBus bus;
        bus.period = 10ms;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 50'000, .start_ns = 123});
        bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
        bus.hang(2, {.drift_ppb = -30'000, .start_ns = 12345});
        bus.bring_up({}, {});
        bus.power(1, false);
        bus.steps(off);
        bus.power(1, true);
        bus.steps(1);
        const Time back = bus.osal.now();
        while (!(bus.in_op(2) && bus.clock(2).in_sync) && bus.osal.now() < back + 3s) bus.step();
        EXPECT_EQ(reference_clock(*bus.ctx), 2);
        EXPECT_LE((bus.osal.now() - back) / 1ms, 930) << bus.joined(bus.events());
    }
}

// The earlier reference returns while the bus is shifted at the rate of its drift. It learns this rate before it is the
// reference again. The system time is right meanwhile, also where the next cycle is under way when poll() finds the
// replies of the last one.
TEST(LateReference, OfAShiftedBusIsBackWithinASecond) {
    for (const bool sends_first : {true, false}) {
        SCOPED_TRACE(sends_first);
        LateClocksBus bus;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 91'000, .start_ns = 123});
        bus.hang(1, {.drift_ppb = 3'000, .start_ns = 1234});
        bus.bring_up({}, {});
        MasterClock master({.mode = MasterClock::Mode::bus_shift, .set_value = -500us, .phase = {.cycle = 1ms}});
        Time due = bus.osal.now();
        std::int64_t most = 0;
        const auto step = [&] {
            bus.osal.wait(due += 1ms, -1);
            if (sends_first) (void)send_processdata(*bus.ctx);
            (void)receive_processdata(*bus.ctx, 300us);
            (void)master.update(*bus.ctx, 0ms);
            if (!sends_first) (void)send_processdata(*bus.ctx);
            (void)poll(*bus.ctx, bus.osal.now());
            const std::uint16_t reference = reference_clock(*bus.ctx);
            const Time now = bus.osal.now();
            const std::uint64_t right = bus.segment.slave(reference - 1U).clock().copy(now);
            if (bus.in_op(reference) && bus.is_powered(reference))
                most = std::max(
                    most, std::abs(static_cast<std::int64_t>(clock_status(*bus.ctx, now).system_time_ns - right)));
        };
        for (int n = 0; n < 6000; ++n) step();
        ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
        bus.power(1, false);
        for (int n = 0; n < 500; ++n) step();
        ASSERT_EQ(reference_clock(*bus.ctx), 3);
        bus.power(1, true);
        int passed = 0;
        for (; passed < 3000 && !(bus.in_op(2) && bus.clock(2).in_sync); ++passed) step();
        EXPECT_EQ(reference_clock(*bus.ctx), 2);
        EXPECT_LE(passed, sends_first ? 1000 : 1500) << bus.joined(bus.events());
        for (int n = 0; n < 500; ++n) step();
        EXPECT_LE(most, 150'000);
    }
}

}  // namespace
}  // namespace margay
