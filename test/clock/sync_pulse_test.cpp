// The length of SYNC pulses (ESC register 0x0982, from the SII), and a SYNC0 that does not fit the cycle without a
// MasterClock.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

struct SyncPulse : testing::Test, ClockBus {
    // Adds a slave with this length of its pulses in the SII, in 10 ns.
    void add_with(std::uint16_t length, const ClockOf& of = {}) {
        using L = wire::sii::ConfigurationLayout;
        auto made = clocked(of);
        L::sync_pulse_length::store(made.sii, length);
        L::checksum::store(made.sii, wire::sii::checksum(made.sii));
        const auto n = segment.add(std::move(made).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}, kCable));
    }
};

TEST_F(SyncPulse, ItsLengthIsKnown) {
    add_with(1000);
    add_with(0);
    add_with(65535);
    add({.unit = sim::DcUnit::none});
    start();
    EXPECT_EQ(clock(1).pulse_ns, -1) << "configdc() has not looked";
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_EQ(clock(1).pulse_ns, 10'000);
    EXPECT_EQ(clock(2).pulse_ns, 0) << "until it is acknowledged";
    EXPECT_EQ(clock(3).pulse_ns, 655'350);
    EXPECT_EQ(clock(4).pulse_ns, -1);
}

// A signal whose pulses touch each other has no edges.
TEST_F(SyncPulse, ACycleThatIsNotLongerIsRefused) {
    add_with(1000);
    add_with(0);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (const Duration cycle : {5us, 10us}) {
        const auto refused = dcsync0(*ctx, 1, true, cycle);
        EXPECT_EQ(words(refused.error()),
                  "slave 1: activating SYNC: argument out of range: a cycle of " + std::to_string(cycle.count()) +
                      " ns, and a pulse of 10000 ns (ESC register 0x0982, from the SII): the cycle of a SYNC signal "
                      "must be longer than its pulse");
        EXPECT_FALSE(clock(1).sync_active);
        EXPECT_TRUE(dcsync0(*ctx, 2, true, cycle).ok()) << "it ends by an acknowledge";
    }
    EXPECT_TRUE(dcsync0(*ctx, 1, true, 10'010ns).ok());
    EXPECT_TRUE(dcsync0(*ctx, 1, true, 0ns).ok()) << "a single pulse";
    EXPECT_TRUE(dcsync01(*ctx, 1, true, 20us, 5us).ok());
    EXPECT_FALSE(dcsync01(*ctx, 1, true, 8us, 100us).ok());
    SlaveSetup only_sync1{.dc = {.source = SyncSettings::Source::application,
                                 .assign_activate = 0x0500,
                                 .sync0_cycle = 8us,
                                 .sync1_cycle = 100us}};
    ctx->slave(1).config.setup = &only_sync1;
    EXPECT_TRUE(config_map(*ctx, image).ok()) << "SYNC1 follows each 13th SYNC0";
    EXPECT_TRUE(clock(1).sync_active);
}

TEST_F(SyncPulse, TheSlaveStaysInPreopWithTheWords) {
    add_with(65535);
    add({});
    SlaveSetup every_half{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 500us}};
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (const std::uint16_t n : {std::uint16_t{1}, std::uint16_t{2}}) ctx->slave(n).config.setup = &every_half;
    const auto mapped = config_map(*ctx, image);
    EXPECT_NE(words(mapped.error())
                  .find("slave 1: activating SYNC: argument out of range: a cycle of 500000 ns, and a pulse of 655350"),
              std::string::npos)
        << words(mapped.error());
    EXPECT_EQ(ctx->slave(1).al.state, AlState::preop);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::safeop);
}

// Neither MasterClock nor run_cycle() is used. The supervision measures the cycle.
TEST_F(SyncPulse, SyncThatDoesNotFitACycleOfTheApplicationIsNamedOnce) {
    for (int n = 0; n < 5; ++n) add({.drift_ppb = 90'000, .start_ns = 77});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    constexpr Duration kCycles[] = {1ms, 1500us, 250us, 3ms, 700us};
    for (std::uint16_t n = 1; n <= 5; ++n) EXPECT_TRUE(dcsync0(*ctx, n, true, kCycles[n - 1]).ok());
    (void)errors();
    const auto run_for = [this](int count, Duration period) {
        Time next = osal.now();
        for (int n = 0; n < count; ++n) {
            next += period;
            while (osal.now() < next) {
                osal.advance(std::min<Duration>(next - osal.now(), 100us));
                (void)poll(*ctx, osal.now());
            }
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, 300us);
        }
    };
    run_for(1500, 1ms);
    EXPECT_TRUE(errors().empty()) << "too early";
    run_for(9000, 1ms);
    const auto all = errors();
    EXPECT_EQ(told(all,
                   "slave 2: activating SYNC: argument out of range: SYNC0 each 1500000 ns is neither a whole multiple "
                   "nor a whole part of the cycle of 100"),
              1)
        << joined(all);
    EXPECT_EQ(told(all, "slave 5: "), 1) << joined(all);
    EXPECT_EQ(all.size(), 2U) << joined(all);
    // The application changes to another cycle.
    run_for(3000, 2ms);
    const auto then = errors();
    EXPECT_EQ(told(then, "slave 4: "), 1) << joined(then);
    EXPECT_EQ(then.size(), 1U) << joined(then);
}

// The mean cycle of some seconds differs from the cycle of the application, because the application has stopped for a
// moment or leaves out cycles.
TEST_F(SyncPulse, AnApplicationThatStopsForAMomentIsNotBlamed) {
    for (int n = 0; n < 3; ++n) add({.drift_ppb = 9000, .start_ns = 77});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_TRUE(dcsync0(*ctx, n, true, 1ms).ok());
    (void)errors();
    const auto run_with = [this](Duration stall, int each) {
        Time next = osal.now();
        for (int n = 0; n < 5000; ++n) {
            next += n % each == each - 1 ? 1ms + stall : Duration(1ms);
            while (osal.now() < next) {
                osal.advance(std::min<Duration>(next - osal.now(), 100us));
                if (stall <= 1ms || next - osal.now() < 1ms) (void)poll(*ctx, osal.now());
            }
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, 300us);
        }
        return joined(errors());
    };
    EXPECT_EQ(told(std::vector{run_with(60ms, 2500)}, "SYNC0"), 0);
    EXPECT_EQ(told(std::vector{run_with(100ms, 1700)}, "SYNC0"), 0);
    EXPECT_EQ(told(std::vector{run_with(1ms, 25)}, "SYNC0"), 0);
    EXPECT_TRUE(dcsync0(*ctx, 3, true, 1500us).ok());
    EXPECT_EQ(told(std::vector{run_with(60ms, 4500)}, "slave 3: "), 1) << "and a wrong cycle is named";
}

// There are more than 65 535 cycles between two comparisons.
TEST_F(SyncPulse, FastOverlappingCyclesAreCounted) {
    for (int n = 0; n < 2; ++n) add({.start_ns = 77});
    limits.process_frames = 8;
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    ctx->group(0).config.cycles_in_flight = 2;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    for (std::uint16_t n = 1; n <= 2; ++n) EXPECT_TRUE(dcsync0(*ctx, n, true, n * 30us).ok());
    (void)errors();
    const auto run_for = [this](int count) {
        Time next = osal.now();
        for (int n = 0; n < count; ++n) {
            next += 20us;
            osal.advance(next - osal.now());
            (void)send_processdata(*ctx);
            if (n > 0) (void)receive_processdata(*ctx, 10us);
            if (n % 10 == 0) (void)poll(*ctx, osal.now());
        }
    };
    run_for(115'000);
    const auto all = errors();
    EXPECT_EQ(told(all, "slave 1: activating SYNC: argument out of range: SYNC0 each 30000 ns"), 1) << joined(all);
    EXPECT_EQ(told(all, "slave 2: "), 0) << joined(all);
    EXPECT_EQ(told(all, "the cycle of 20"), 1) << joined(all);
}

// Active SYNC signals continue when other signals are refused.
TEST_F(SyncPulse, ARefusedCycleChangesNothing) {
    add_with(100);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    ASSERT_TRUE(dcsync0(*ctx, 1, true, 1ms).ok());
    EXPECT_EQ(dcsync0(*ctx, 1, true, 1us).error().code, Errc::invalid_argument);
    EXPECT_TRUE(clock(1).sync_active);
    EXPECT_NE(clock(1).sync_start_ns, 0U);
    EXPECT_EQ(register_of<std::uint8_t>(1, wire::reg::kSyncActivation), 3);
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSync0CycleTime), 1'000'000U);
    EXPECT_TRUE(dcsync0(*ctx, 1, false, 0ms).ok());
    EXPECT_FALSE(clock(1).sync_active);
}

// Without an answer the library does not know whether the register exists, so it does not report it as missing.
TEST_F(SyncPulse, ASlaveThatDoesNotAnswerKeepsItsLength) {
    add({});
    add_with(1000);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    power(1, false);
    EXPECT_FALSE(dcsync0(*ctx, 2, true, 1ms).ok());
    EXPECT_EQ(clock(2).pulse_ns, 10'000);
}

}  // namespace
}  // namespace margay
