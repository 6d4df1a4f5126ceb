// The fact "in sync" and the time that the cycles carry: when frames are lost, when no time arrives, and when the
// supervision ends.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

struct TimesThatStop : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};

    void begin(unsigned slaves, Duration watch_interval = 10ms) {
        add_line(slaves);
        start();
        const auto reference = configdc(*ctx, {.burst_frames = 2000, .watch_interval = watch_interval});
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        for (std::uint16_t n = 1; n <= slaves; ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        cycles(3000);
        ASSERT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    }
    // run_cycle() also receives the cycles that the NIC has refused to send. Returns the number of its cycles in which
    // the clocks were not in sync.
    unsigned run_for(Duration time, Duration period) {
        unsigned out = 0;
        const Time end = osal.now() + time;
        const auto each = [&](const CycleInfo&) {
            out += clock_status(*ctx, osal.now()).in_sync ? 0U : 1U;
            return osal.now() < end;
        };
        EXPECT_TRUE(run_cycle(*ctx, {.period = period}, each).ok());
        return out;
    }
    void lose(unsigned count) {
        for (unsigned n = 0; n < count; ++n) {
            segment.lose_next({0, 0});
            cycles(1);
        }
    }
    // Slave 1 is not connected, and the master is connected to slave 2.
    void bridge_first() {
        segment.disconnect({0, 0});
        segment.disconnect({0, 1});
        ASSERT_TRUE(segment.connect_master({1, 0}));
        segment.reconsider();
    }
    void restore_first() {
        segment.disconnect({1, 0});
        ASSERT_TRUE(segment.connect_master({0, 0}));
        ASSERT_TRUE(segment.connect({0, 1}, {1, 0}, kCable));
        segment.reconsider();
    }
    // The first clock becomes the reference again. For some rounds the cycles carry no time. Returns during these
    // rounds.
    void begin_return() {
        begin(5);
        bridge_first();
        segment.slave(0).set_drift(-100'000 + 20'000, osal.now());
        cycles(3000);
        ASSERT_EQ(reference_clock(*ctx), 2);
        segment.slave(0).set_drift(-100'000, osal.now());
        restore_first();
        unsigned pause = 0;
        for (unsigned n = 0; n < 3000 && pause < 30; ++n) {
            cycles(1);
            pause = ctx->group(0).dc_time.came && ctx->group(0).dc_time.slaves == 0 && all_in_op() ? pause + 1 : 0;
        }
        ASSERT_EQ(pause, 30U);
    }
};

// A frame that only reads the reference is lost, too. The readings before and after it do not give the next time.
TEST_F(TimesThatStop, OnlyTwoAnswersInSuccessionTellATime) {
    begin(5);
    lose(1);
    cycles(1);
    lose(10);
    cycles(1);
    bridge_first();
    for (unsigned n = 0; n < 500; ++n) {
        cycles(1);
        for (std::uint16_t s = 3; s <= 5; ++s) ASSERT_LE(std::abs(ahead_ns(s, 2)), 200) << s << ", cycle " << n;
    }
}

// After a lost frame, two answers of the reference give the next time. By chance the reference shows exactly the time
// that the next frame carries. The time is 64 ns more than expected, so that this is rare.
TEST_F(TimesThatStop, ATimeThatIsShownByChanceStopsNoTime) {
    begin(5);
    unsigned longest = 0;
    for (const std::int32_t faster : {63'200, 63'600, 64'000, 64'400, 64'800}) {
        lose(1);
        cycles(2);
        segment.slave(0).set_drift(-100'000 + faster, osal.now());
        for (unsigned n = 0, pause = 0; n < 300; ++n) {
            cycles(1);
            pause = ctx->group(0).dc_time.slaves == 5 ? 0 : pause + 1;
            longest = std::max(longest, pause);
        }
        segment.slave(0).set_drift(-100'000, osal.now());
        cycles(2000);
    }
    EXPECT_EQ(longest, 0U);
}

// The first frame after the pause carries the time of the last cycle before it, and all clocks follow this time. The
// library does not report them in sync while they recover.
TEST_F(TimesThatStop, AReferenceThatIsLostInAPause) {
    constexpr unsigned kUntilItIsKnown = 60;
    for (const auto pause : {20ms, 80ms, 2000ms}) {
        SCOPED_TRACE(pause.count());
        if (segment.size() == 0) begin(5);
        osal.advance(pause);
        segment.advance(osal.now());
        bridge_first();
        for (unsigned n = 0; n < 3000; ++n) {
            cycles(1);
            for (std::uint16_t s = 3; s <= 5 && n > kUntilItIsKnown; ++s)
                ASSERT_TRUE(!clock(s).in_sync || std::abs(ahead_ns(s, 2)) <= 400) << s << ", cycle " << n;
        }
        restore_first();
        cycles(5000);
        ASSERT_TRUE(clock_status(*ctx, osal.now()).in_sync) << joined(events());
    }
}

// Group 1 was exchanged for a while and is not exchanged any more. The first clock is back and learns the rate from
// datagrams in the frames of group 0. Some of these frames are lost.
TEST_F(TimesThatStop, AGroupThatIsNotExchangedAnyMore) {
    add_line(5);
    start();
    ctx->group(1).config.acyclic_bytes = 1498;
    ctx->slave(5).config.group = 1;
    ASSERT_TRUE(configdc(*ctx, {.burst_frames = 2000}).ok());
    (void)config_map(*ctx, image, 0);
    (void)config_map(*ctx, MutableBytes(image).subspan(512), 1);
    for (unsigned n = 0; n < 10; ++n) {
        cycles(1);
        ASSERT_TRUE(send_processdata(*ctx, 1));
        ASSERT_TRUE(receive_processdata(*ctx, 500us, 1).ok());
    }
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(3000);
    bridge_first();
    segment.slave(0).set_drift(-60'000, osal.now());  // it was -100 ppm
    cycles(3000);
    ASSERT_EQ(reference_clock(*ctx), 2);
    restore_first();
    segment.set_noise({.lost = 0.02, .seed = 5});
    std::int64_t most = 0;
    for (unsigned n = 0; n < 6000; ++n) {
        cycles(1);
        for (std::uint16_t s = 3; s <= 4; ++s) most = std::max(most, std::abs(ahead_ns(s, 2)));
    }
    EXPECT_LE(most, 200);
    EXPECT_EQ(reference_clock(*ctx), 1);
    for (std::uint16_t s = 1; s <= 4; ++s) EXPECT_TRUE(clock(s).in_sync && std::abs(ahead_ns(s)) <= 200) << s;
}

TEST_F(TimesThatStop, InSyncEndsInSilence) {
    begin(4);
    segment.set_cable({0, 0}, false);
    cycles(500);
    EXPECT_TRUE(clock(4).in_sync) << "it goes on at its rate";
    cycles(800);
    EXPECT_FALSE(clock_status(*ctx, osal.now()).in_sync);
    for (std::uint16_t s = 2; s <= 4; ++s) EXPECT_FALSE(clock(s).in_sync) << s;
    segment.set_cable({0, 0}, true);
    cycles(2000);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// After a silence the cycles carry no time until the library knows that the reference is the same. An oscillator whose
// rate changes by 15 ppm meanwhile is 450 ns ahead after 30 ms.
TEST_F(TimesThatStop, AfterASilenceTheTimeIsBackSoonWhereTheWatchIsSlow) {
    begin(4, 1s);
    segment.set_cable({0, 0}, false);
    cycles(1500);
    segment.set_cable({0, 0}, true);
    segment.slave(2).set_drift(75'000, osal.now());  // it was 60 ppm
    std::int64_t most = 0;
    for (unsigned n = 0; n < 5000; ++n) {
        cycles(1);
        most = std::max(most, std::abs(ahead_ns(3)));
    }
    EXPECT_GT(most, 200) << "the rate has changed";
    EXPECT_LE(most, 800);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// The registers of the reference show that it is the same clock.
TEST_F(TimesThatStop, AfterASilenceTheTimeIsBackAtOnce) {
    begin(4);
    for (const unsigned silent : {15U, 50U, 300U, 900U}) {
        SCOPED_TRACE(silent);
        segment.set_cable({0, 0}, false);
        cycles(static_cast<int>(silent));
        segment.set_cable({0, 0}, true);
        unsigned without = 0;
        for (; without < 1000 && ctx->group(0).dc_time.slaves != 4; ++without) cycles(1);
        EXPECT_LE(without, 50U);
        for (unsigned n = 0; n < 2000; ++n) {
            cycles(1);
            ASSERT_TRUE(clock_status(*ctx, osal.now()).in_sync) << n;
        }
    }
}

// Each cycle that the NIC has refused to send is lost once.
TEST_F(TimesThatStop, AfterASilenceInWhichTheNicSendsNothingTheClocksStayInSync) {
    begin(4);
    segment.set_master_cable(0, false);
    (void)run_for(900ms, 1ms);
    segment.set_master_cable(0, true);
    (void)run_for(50ms, 1ms);
    EXPECT_EQ(run_for(2s, 1ms), 0U) << "cycles out of sync";
}

// Two answers in succession give the next time. With these cycles, the watch makes several rounds between them.
TEST_F(TimesThatStop, AfterASilenceTheTimeIsBackWhereCyclesAreLong) {
    begin(4);
    for (const auto period : {12ms, 20ms, 50ms}) {
        SCOPED_TRACE(period.count());
        segment.set_master_cable(0, false);
        (void)run_for(600ms, period);
        segment.set_master_cable(0, true);
        (void)run_for(10 * period, period);
        EXPECT_EQ(ctx->group(0).dc_time.slaves, 4);
        (void)run_for(10s, period);
        EXPECT_EQ(run_for(1s, period), 0U) << "cycles out of sync";
    }
}

// Group::dc_time belongs to the cycle that was received last, while the next cycle is on the wire.
TEST_F(TimesThatStop, TheSystemTimeIsRightWhileACycleIsUnderWay) {
    begin(4);
    const auto exchange = [this] {
        for (unsigned n = 0; n < 300; ++n) {
            osal.advance(1ms);
            (void)receive_processdata(*ctx, 0ms);
            ASSERT_TRUE(send_processdata(*ctx));
            (void)poll(*ctx, osal.now());
            const auto away = static_cast<std::int64_t>(clock_status(*ctx, osal.now()).system_time_ns -
                                                        segment.slave(0).clock().copy(osal.now()));
            ASSERT_LE(std::abs(away), 50'000) << n;
        }
    };
    exchange();
    supervision.cancel();
    exchange();
}

// A clock leaves the limit between the reading of all clocks and the reading of this clock.
TEST_F(TimesThatStop, AllClocksAreInSyncOnlyWhileEachOneIs) {
    begin(4);
    unsigned out = 0;
    for (unsigned n = 0; n < 30'000; ++n) {
        if (n % 500 == 0) {
            const std::int32_t by = static_cast<std::int32_t>(n / 500 % 7 + 4) * (n % 1000 == 0 ? 1'500 : -1'500);
            for (std::uint32_t s = 1; s <= 3; ++s) segment.slave(s).set_drift(by, osal.now());
        }
        cycles(1);
        const bool each = clock(2).in_sync && clock(3).in_sync && clock(4).in_sync;
        ASSERT_TRUE(each || !clock_status(*ctx, osal.now()).in_sync) << n;
        if (!each) ++out;
    }
    EXPECT_GT(out, 100U);
}

// The order of calls in programs for IgH: a frame is on the wire whenever the library can work.
TEST_F(TimesThatStop, ALoopThatSendsBeforeItPollsGetsItsTimeBack) {
    begin(5);
    const auto exchange = [this](unsigned count) {
        for (unsigned n = 0; n < count; ++n) {
            osal.advance(1ms);
            (void)receive_processdata(*ctx, 0ms);
            (void)send_processdata(*ctx);
            (void)poll(*ctx, osal.now());
        }
    };
    exchange(100);
    segment.set_cable({0, 0}, false);
    exchange(600);
    segment.set_cable({0, 0}, true);
    exchange(4000);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync) << "after a silence";
    for (std::uint16_t s = 2; s <= 5; ++s) EXPECT_LE(std::abs(ahead_ns(s)), 100) << s;
    bridge_first();
    exchange(4000);
    EXPECT_EQ(reference_clock(*ctx), 2);
    for (std::uint16_t s = 3; s <= 5; ++s) EXPECT_TRUE(clock(s).in_sync && std::abs(ahead_ns(s, 2)) <= 100) << s;
    restore_first();
    exchange(10'000);
    EXPECT_EQ(reference_clock(*ctx), 1);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync) << "the first clock is back";
    for (std::uint16_t s = 2; s <= 5; ++s) EXPECT_LE(std::abs(ahead_ns(s)), 100) << s;
}

// The frames with the time came before the silence, and the supervision begins during the silence.
TEST_F(TimesThatStop, TimesThatCameBeforeASilenceAreOld) {
    begin(4);
    supervision.cancel();
    cycles(500);
    segment.set_cable({0, 0}, false);
    cycles(2000);
    EXPECT_TRUE(submit(*ctx, supervision).ok());
    cycles(30);
    for (std::uint16_t s = 2; s <= 4; ++s) EXPECT_FALSE(clock(s).in_sync) << s;
}

// After a silence only times that have arrived since are used. The register still contains the value from before the
// silence.
TEST_F(TimesThatStop, AfterASilenceNoClockIsInSyncBeforeItIsCompared) {
    begin(4);
    segment.set_cable({0, 0}, false);
    segment.slave(2).set_drift(80'000, osal.now());  // it was 60 ppm
    cycles(3000);
    segment.set_cable({0, 0}, true);
    for (unsigned n = 0; n < 3000; ++n) {
        cycles(1);
        ASSERT_TRUE(!clock(3).in_sync || std::abs(ahead_ns(3)) <= 400) << ahead_ns(3) << " ns, cycle " << n;
    }
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// Rounds of the watch that come earlier because of a silence do not count as intervals. The clocks continue at their
// rates.
TEST_F(TimesThatStop, AShortSilenceEndsNoSyncWhereTheWatchIsSlow) {
    begin(4, 100ms);
    segment.set_cable({0, 0}, false);
    for (unsigned n = 0; n < 600; ++n) {
        cycles(1);
        ASSERT_TRUE(clock_status(*ctx, osal.now()).in_sync) << n;
    }
    segment.set_cable({0, 0}, true);
    for (unsigned n = 0; n < 1000; ++n) {
        cycles(1);
        ASSERT_TRUE(clock(4).in_sync) << n;
    }
}

// A frame carries the time after two answers in succession. If every second or third frame is lost, no frame carries
// the time.
TEST_F(TimesThatStop, InSyncEndsWhereOnlyFramesWithoutTimeComeBack) {
    for (const unsigned period : {2U, 3U}) {
        SCOPED_TRACE(period);
        if (segment.size() == 0) begin(4);
        for (unsigned n = 0; n < 1400; ++n) n % period == 0 ? lose(1) : cycles(1);
        EXPECT_FALSE(clock_status(*ctx, osal.now()).in_sync);
        for (std::uint16_t s = 2; s <= 4; ++s) EXPECT_FALSE(clock(s).in_sync) << s;
        cycles(2000);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    }
}

TEST_F(TimesThatStop, InSyncStaysWhereEveryFifthFrameIsLost) {
    begin(4);
    for (unsigned n = 0; n < 3000; ++n) {
        n % 5 == 0 ? lose(1) : cycles(1);
        for (std::uint16_t s = 2; s <= 4; ++s) ASSERT_TRUE(clock(s).in_sync && std::abs(ahead_ns(s)) <= 100) << s << n;
    }
}

TEST_F(TimesThatStop, InSyncEndsWithoutCycles) {
    begin(4);
    for (unsigned n = 0; n < 1500; ++n) {
        osal.advance(1ms);
        (void)poll(*ctx, osal.now());
    }
    EXPECT_FALSE(clock_status(*ctx, osal.now()).in_sync);
    for (std::uint16_t s = 2; s <= 4; ++s) EXPECT_FALSE(clock(s).in_sync) << s;
    cycles(1000);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// Slave 1 is moved to the time of the reference in small steps. Meanwhile no time is carried.
TEST_F(TimesThatStop, TheTimeIsCarriedWhenTheSupervisionEnds) {
    begin_return();
    supervision.cancel();
    cycles(10);
    EXPECT_NE(ctx->group(0).dc_time.slaves, 0);
    cycles(1000);
    for (std::uint16_t s = 3; s <= 5; ++s) EXPECT_LE(std::abs(ahead_ns(s, 2)), 100) << s;
}

// The same when the application ends the supervision while a frame is on the wire.
TEST_F(TimesThatStop, TheTimeIsCarriedBehindAFrameOnTheWire) {
    begin_return();
    (void)send_processdata(*ctx, osal.now());
    supervision.cancel();
    cycles(20);
    EXPECT_NE(ctx->group(0).dc_time.slaves, 0);
}

// Nothing reads the differences. A clock of a slave that was away is compared when the slave is back, and is not in
// sync.
TEST_F(TimesThatStop, WithoutAWatchASlaveThatWasAwayIsNotInSync) {
    begin(3, 0ms);
    segment.set_cable({2, 0}, false);
    segment.slave(2).set_drift(0, osal.now());
    cycles(5000);
    EXPECT_FALSE(clock(3).in_sync);
    EXPECT_GT(std::abs(ahead_ns(3)), 100'000);
    segment.set_cable({2, 0}, true);
    cycles(3000);
    EXPECT_FALSE(clock(3).in_sync);
    EXPECT_TRUE(all_in_op());
    EXPECT_LE(std::abs(ahead_ns(3)), 10'000) << "it was started again with the time of the reference";
}

}  // namespace
}  // namespace margay
