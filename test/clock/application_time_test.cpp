// Clocks that follow the time of the application.
#include "clock/late_clocks_bus.hpp"

#include <margay/application_time.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kYear2026_ns = 820'000'000'000'000'000;  // since 2000

struct ApplicationTimeTest : testing::Test, ClockBus {
    std::unique_ptr<ApplicationTime> time;

    std::uint64_t mine() { return kYear2026_ns + static_cast<std::uint64_t>(osal.now().time_since_epoch().count()); }
    // No cycle of a group carries the time.
    void bring_up(sim::DcUnit unit = sim::DcUnit::bits64) {
        add({.drift_ppb = 70'000, .start_ns = 5, .unit = unit});
        add({.drift_ppb = -30'000});
        add({.drift_ppb = 20'000, .start_ns = 0x1'2345'6789});
        start();
        time = std::make_unique<ApplicationTime>(*ctx);
        EXPECT_EQ(words(time->sync_reference_clock().error()),
                  "synchronising the clocks: not possible in this state (call ApplicationTime::set() before)");
        time->set(mine(), osal.now());
        ClockSettings settings = kFewFrames;
        settings.system_time_at_zero = time->at_zero();
        settings.group = 1;  // group 1 is not mapped
        ASSERT_TRUE(configdc(*ctx, settings).ok());
        ASSERT_TRUE(config_map(*ctx, image).ok());
    }
    template <class Work>
    void run_cycles(int count, Work work) {
        for (int n = 0; n < count; ++n) {
            osal.advance(1ms);
            (void)receive_processdata(*ctx, 0us);
            (void)poll(*ctx, osal.now());
            time->set(mine(), osal.now());
            work();
            (void)poll(*ctx, osal.now());
            ASSERT_TRUE(send_processdata(*ctx).ok());
        }
        (void)receive_processdata(*ctx, reply_timeout);
        (void)poll(*ctx, osal.now());
    }
    std::uint64_t shown(std::uint32_t slave) { return segment.slave(slave).clock().copy(osal.now()); }
};

TEST_F(ApplicationTimeTest, IsTheTimeOfTheReferenceClock) {
    bring_up();
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 0);
    EXPECT_NEAR(static_cast<double>(shown(0) - mine()), 0, 200'000) << "from configdc() on";
    run_cycles(5000, [this] {
        (void)time->sync_reference_clock();
        (void)time->sync_slave_clocks();
        (void)time->queue_sync_monitor();
    });
    const std::uint64_t begun = shown(0) - mine();
    run_cycles(5000, [this] {
        const auto begun_sync = time->sync_reference_clock();
        ASSERT_TRUE(begun_sync.ok()) << words(begun_sync.error());
        EXPECT_TRUE(time->sync_slave_clocks().ok());
        EXPECT_TRUE(time->queue_sync_monitor().ok());
    });
    // Without control, the reference drifts by 70 ppm: 350 µs in 5 s.
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(shown(0) - mine() - begun)), 0, 200);
    EXPECT_LE(greatest_error_ns(3), 200);
    const auto wide = time->reference_clock_time64();
    ASSERT_TRUE(wide.ok()) << words(wide.error());
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(*wide - mine())), 0, 2'500'000);
    EXPECT_EQ(*time->reference_clock_time(), static_cast<std::uint32_t>(*wide));
    const auto most = time->process_sync_monitor();
    ASSERT_TRUE(most.ok()) << words(most.error());
    EXPECT_LE(*most, 400U);
    const ClockStatus status = clock_status(*ctx, osal.now());
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(status.system_time_ns - mine())), 0, 200'000);
}

TEST_F(ApplicationTimeTest, WithoutItTheReferenceClockDrifts) {
    bring_up();
    const std::uint64_t begun = shown(0) - mine();
    run_cycles(2000, [this] { (void)time->sync_slave_clocks(); });
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(shown(0) - mine() - begun)), 140'000, 1'000) << "70 ppm";
    EXPECT_LE(greatest_error_ns(3), 200) << "and the other clocks follow it";
}

// poll() queues the datagram behind a cycle, and the next cycle takes it along.
TEST_F(ApplicationTimeTest, TheSystemTimeIsRightWhereTheDatagramWaitsForTheNextCycle) {
    bring_up();
    for (int n = 0; n < 1000; ++n) {
        osal.advance(1ms);
        ASSERT_TRUE(send_processdata(*ctx).ok());
        (void)receive_processdata(*ctx, reply_timeout);
        (void)poll(*ctx, osal.now());
        (void)time->sync_slave_clocks();
        (void)poll(*ctx, osal.now());
        const std::uint64_t known = clock_status(*ctx, osal.now()).system_time_ns;
        ASSERT_NEAR(static_cast<double>(static_cast<std::int64_t>(known - shown(0))), 0, 50'000) << n;
    }
}

// The clocks follow the time of a third clock, which is 50 ppm slower than the clock of the application.
TEST_F(ApplicationTimeTest, OrAnyTimeThatIsGiven) {
    bring_up();
    const auto third = [this, begin = mine()] { return mine() - (mine() - begin) / 20'000; };
    const auto follow = [&] {
        EXPECT_TRUE(time->sync_reference_clock_to(third()).ok());
        EXPECT_TRUE(time->sync_slave_clocks().ok());
    };
    run_cycles(5000, follow);
    const std::uint64_t begun = shown(0) - third();
    run_cycles(5000, follow);
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(shown(0) - third() - begun)), 0, 500);
    EXPECT_LE(greatest_error_ns(3), 200);
}

TEST_F(ApplicationTimeTest, Of32BitsHasItsUpperHalfFromTheMaster) {
    bring_up(sim::DcUnit::bits32);
    run_cycles(6000, [this] { EXPECT_TRUE(time->sync_slave_clocks().ok()); });  // wraps
    const auto wide = time->reference_clock_time64();
    ASSERT_TRUE(wide.ok());
    EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(*wide - mine())), 0, 3'000'000);
}

// A missing result has an error, and no call returns an old result.
TEST_F(ApplicationTimeTest, ErrorsAreSaid) {
    add_line(2);
    start();
    time = std::make_unique<ApplicationTime>(*ctx);
    EXPECT_EQ(words(time->process_sync_monitor().error()),
              "synchronising the clocks: not possible in this state (the datagram was not sent, or is not back yet)");
    EXPECT_EQ(time->sync_slave_clocks().error().code, Errc::no_clock) << "configdc() was not called";
    EXPECT_EQ(words(time->sync_slave_clocks().error()), "synchronising the clocks: no clock that runs");
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    ASSERT_TRUE(time->sync_slave_clocks().ok());
    EXPECT_EQ(time->sync_slave_clocks().error().code, Errc::busy);
    EXPECT_EQ(time->reference_clock_time().error().code, Errc::wrong_state) << "on its way";
    ASSERT_TRUE(time->queue_sync_monitor().ok());
    for (int n = 0; n < 3; ++n) {
        (void)poll(*ctx, osal.now());
        osal.advance(1ms);
    }
    EXPECT_TRUE(time->reference_clock_time().ok());
    EXPECT_TRUE(time->process_sync_monitor().ok());
    segment.set_noise({.lost = 1.0, .seed = 1});
    ASSERT_TRUE(time->sync_slave_clocks().ok());
    for (int n = 0; n < 300; ++n) {
        (void)poll(*ctx, osal.now());
        osal.advance(1ms);
    }
    EXPECT_EQ(time->reference_clock_time().error().code, Errc::no_frame);
}

// The slave with the reference clock is switched off, and the frame comes back from the other slaves. Their clocks
// continue, and their time does not count as the time of the reference clock.
TEST_F(ApplicationTimeTest, AReferenceThatIsLostIsSaid) {
    auto root = clocked({.unit = sim::DcUnit::none});
    root.chip.ports = sim::junction().ports;
    segment.add(std::move(root).assemble());
    segment.add(clocked({.drift_ppb = 20'000}).assemble());
    segment.add(clocked({.drift_ppb = -20'000, .start_ns = 5}).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    ASSERT_TRUE(segment.connect({0, 3}, {1, 0}, kCable));
    ASSERT_TRUE(segment.connect({0, 1}, {2, 0}, kCable));
    start();
    ASSERT_EQ(*configdc(*ctx, kFewFrames), 2);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    time = std::make_unique<ApplicationTime>(*ctx);
    run_cycles(500, [this] { EXPECT_TRUE(time->sync_slave_clocks().ok()); });
    ASSERT_TRUE(time->reference_clock_time().ok());
    power(1, false);
    const std::uint64_t before = segment.slave(2).clock().copy(osal.now());
    const Time begin = osal.now();
    run_cycles(500, [this] { EXPECT_TRUE(time->sync_slave_clocks().ok()); });
    EXPECT_EQ(words(time->reference_clock_time().error()), "slave 2: synchronising the clocks: the slave is missing");
    EXPECT_NEAR(static_cast<double>(segment.slave(2).clock().copy(osal.now()) - before),
                static_cast<double>((osal.now() - begin).count()), 50'000);
}

// A program distributes the time in each cycle. While the reference is lost, the request would bring the clocks a time
// that the master has predicted; while the reference is back and not set, a time of its own; while the reference learns
// the rate, a time that disturbs the lesson. So it is not sent, and the reference is back as soon as without it.
TEST(TimeThatIsDistributed, WaitsForTheReference) {
    for (const Duration cycle : {1ms, 10ms}) {
        for (const int off : {1, 2, 3, 5, 50}) {
            SCOPED_TRACE(testing::Message() << cycle / 1ms << " ms, " << off);
            LateClocksBus bus;
            bus.period = cycle;
            bus.nic_options.round_trip = 20us;
            bus.hang(0, {.unit = sim::DcUnit::receive_times});
            bus.hang(3, {.drift_ppb = 90'000, .start_ns = 123});
            bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
            bus.hang(2, {.drift_ppb = -30'000, .start_ns = 12345});
            bus.bring_up({}, {});
            ASSERT_EQ(reference_clock(*bus.ctx), 2);
            ClockDatagramRequest distribute;
            std::array<unsigned, 3> ends{};  // success, missing_slave, busy
            unsigned untrue = 0;
            bool unseen = false;  // the loss of the reference is not known yet
            const auto step = [&] {
                if (!distribute.busy()) {
                    ends[0] += distribute.state() == RequestState::success ? 1U : 0U;
                    ends[1] += distribute.error().code == Errc::missing_slave ? 1U : 0U;
                    ends[2] += distribute.error().code == Errc::busy ? 1U : 0U;
                    (void)submit(*bus.ctx, distribute);
                }
                bus.step();
                const std::uint16_t reference = reference_clock(*bus.ctx);
                unseen = unseen && bus.in_op(2);
                for (const std::uint16_t slave : {std::uint16_t{3}, std::uint16_t{4}})
                    untrue += !unseen && bus.in_op(reference) && bus.clock(slave).in_sync &&
                                      std::abs(bus.ahead_ns(slave, reference)) > 1000
                                  ? 1U
                                  : 0U;
            };
            for (int n = 0; n < 1000; ++n) step();
            EXPECT_GE(ends[0], 450U);
            EXPECT_EQ(ends[1] + ends[2], 0U);
            bus.power(1, false);
            unseen = true;
            for (int n = 0; n < off; ++n) step();
            bus.power(1, true);
            step();
            const Time back = bus.osal.now();
            for (unsigned n = 0; n < 20 && bus.in_op(2); ++n) step();
            while (!(bus.in_op(2) && bus.clock(2).in_sync) && bus.osal.now() < back + 20s) step();
            EXPECT_EQ(reference_clock(*bus.ctx), 2);
            EXPECT_LE((bus.osal.now() - back) / 1ms, 930);
            EXPECT_GE(ends[1], 1U);
            EXPECT_EQ(untrue, 0U);
        }
    }
}

}  // namespace
}  // namespace margay
