// Disturbances of running clocks: slaves that are lost while delays are measured, times that another program writes,
// exact cycles, and a clock that comes back far away.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

struct ClockHarm : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};

    void bring_up(const ClockSettings& settings = kFewFrames) {
        const auto slaves = static_cast<std::uint16_t>(segment.size());
        start();
        const auto reference = configdc(*ctx, settings);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        for (std::uint16_t n = 1; n <= slaves; ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        cycles(300);
        (void)events();
    }
};

// A port behind which no slave answers keeps the receive time of an earlier frame.
TEST_F(ClockHarm, DelaysAreRightWhileASlaveIsLost) {
    add_line(4);
    ClockSettings settings = kFewFrames;
    settings.delay_interval = 20ms;
    bring_up(settings);
    for (int n = 0; n < 3; ++n) {
        power(3, false);
        for (int k = 0; k < 400; ++k) {
            cycles(1);
            ASSERT_NEAR(static_cast<double>(clock(2).delay_ns), static_cast<double>(kHop_ns), 5) << k;
            ASSERT_NEAR(static_cast<double>(clock(3).delay_ns), 2.0 * kHop_ns, 5) << k;
        }
        power(3, true);
        ASSERT_TRUE(until([&] { return all_in_op() && clock(4).in_sync; })) << joined(events());
    }
    EXPECT_NEAR(static_cast<double>(clock(4).delay_ns), 3.0 * kHop_ns, 5);
    cycles(1000);
    EXPECT_LE(greatest_error_ns(4), 100);
}

// The frames pass the branch with slaves 2 and 3 on their way to slave 4. When the branch is lost, the delay of slave 4
// is measured again, and once more when the branch is back.
TEST_F(ClockHarm, TheDelaysFollowABranchThatIsLost) {
    const auto junction = [this](std::int32_t drift) {
        auto made = clocked({.drift_ppb = drift, .start_ns = segment.size() * 12345});
        made.chip.ports = sim::junction().ports;
        return segment.add(std::move(made).assemble());
    };
    ASSERT_TRUE(segment.connect_master({junction(0), 0}));
    ASSERT_TRUE(segment.connect({0, 3}, {junction(30'000), 0}, kCable));  // slave 2
    ASSERT_TRUE(segment.connect({1, 1}, {junction(-70'000), 0}, kCable));
    ASSERT_TRUE(segment.connect({0, 1}, {junction(90'000), 0}, kCable));  // slave 4
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    cycles(3000);
    const auto delay = clock(4).delay_ns;
    const auto until_measured = [this](unsigned most) {
        unsigned wrong = 0;  // cycles in succession: until the loss is known, and while the difference passes zero
        for (unsigned n = 0; n < most; ++n) {
            cycles(1);
            wrong = clock(4).in_sync && std::abs(ahead_ns(4)) > 400 ? wrong + 1 : 0;
            ASSERT_LE(wrong, 60U) << ahead_ns(4) << " ns ahead, cycle " << n;
        }
    };
    segment.set_cable({1, 0}, false);
    until_measured(2000);
    EXPECT_LT(clock(4).delay_ns + 500, delay);
    EXPECT_TRUE(clock(4).in_sync);
    EXPECT_LE(std::abs(ahead_ns(4)), 100);
    segment.set_cable({1, 0}, true);
    until_measured(3000);
    EXPECT_NEAR(static_cast<double>(clock(4).delay_ns), static_cast<double>(delay), 3);
    for (std::uint16_t s = 1; s <= 4; ++s) EXPECT_TRUE(clock(s).in_sync && std::abs(ahead_ns(s)) <= 100) << s;
}

// A slave that is found after configdc(), in a segment with four expected slaves.
struct LateClock : ClockHarm {
    std::array<ExpectedSlave, 4> four{};

    // Each slave is a different product, so that the master can identify the missing slave.
    void hang(sim::PortRef at, std::int32_t drift_ppb) {
        auto& wanted = four[segment.size()].product;
        wanted = 0x0200 + static_cast<std::uint32_t>(segment.size());
        auto made = clocked({.drift_ppb = drift_ppb, .start_ns = 12345}, kOneMode, {.product = *wanted});
        const auto n = segment.add(std::move(made).assemble());
        ASSERT_TRUE(segment.connect(at, {n, 0}, kCable));
    }
    void bring_up_without(std::uint32_t late) {
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        power(late, false);
        for (std::size_t n = 0; n < four.size(); ++n) four[n].number = static_cast<std::uint16_t>(n + 1);
        ASSERT_TRUE(expect(*ctx, four).ok());
        EXPECT_EQ(config_init(*ctx).error().code, four[late].optional ? Errc::none : Errc::missing_slave);
        ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
        for (std::uint16_t n = 1; n <= 4; ++n) ctx->slave(n).config.setup = &every_ms;
    }
    void map_and_supervise() {
        (void)config_map(*ctx, image);
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(500);
    }
    void switch_on(std::uint16_t slave) {
        power(slave - 1U, true);
        ASSERT_TRUE(until([&] { return ctx->slave(slave).al.state == AlState::preop; }, 6000)) << joined(events());
    }
};

// When the delays were measured, the neighbour of the slave had no receive time for the port to the slave.
TEST_F(LateClock, ItsDelayIsMeasured) {
    add_line(4);
    bring_up_without(3);
    map_and_supervise();
    switch_on(4);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    cycles(2000);
    EXPECT_NEAR(static_cast<double>(clock(4).delay_ns), 3.0 * kHop_ns, 5);
    EXPECT_LE(greatest_error_ns(4), 100);
}

// In PREOP the slave has another time than the other slaves. It does not hide their differences.
TEST_F(LateClock, BeforeItIsStartedTheDifferenceIsThatOfTheOthers) {
    add_line(4);
    bring_up_without(3);
    map_and_supervise();
    switch_on(4);
    cycles(300);
    EXPECT_EQ(ctx->slave(4).al.state, AlState::preop);
    EXPECT_FALSE(clock(4).synchronised);
    EXPECT_GT(std::abs(ahead_ns(4)), 1'000'000);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    EXPECT_LE(clock_status(*ctx, osal.now()).greatest_ns, 200U);
}

// The slave is before the reference and becomes the reference. The other clocks run at the rate of the previous
// reference, and this rate must not change.
TEST_F(LateClock, BeforeTheReferenceItLearnsItsRate) {
    auto root = clocked({.unit = sim::DcUnit::receive_times});
    root.chip.ports = sim::junction().ports;
    segment.add(std::move(root).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    hang({0, 3}, -90'000);  // slave 2: 110 ppm slower than the reference
    hang({0, 1}, 20'000);
    hang({2, 1}, 70'000);
    four[1].optional = true;
    bring_up_without(1);
    ctx->slave(1).config.setup = nullptr;
    map_and_supervise();
    ASSERT_EQ(reference_clock(*ctx), 3);
    (void)events();
    const auto watch = [this] {
        std::int64_t most = 0;
        for (int n = 0; n < 2000; ++n) {
            cycles(1);
            most = std::max(most, std::abs(ahead_ns(4, 3)));
        }
        EXPECT_LE(most, 100) << "between the others";
        EXPECT_EQ(reference_clock(*ctx), 2);
        EXPECT_LE(std::abs(ahead_ns(3, 2)), 100);
        EXPECT_LE(std::abs(ahead_ns(4, 2)), 100);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
        const auto all = events();
        EXPECT_EQ(told(all, "clock out of sync"), 0) << joined(all);
    };
    switch_on(2);
    const auto mapped = config_map(*ctx, image);
    ASSERT_TRUE(mapped.ok()) << words(mapped.error());
    watch();
    power(1, false);
    cycles(1000);
    power(1, true);
    ASSERT_TRUE(until([&] { return in_op(2); }, 900)) << "within a second: " << joined(events());
    watch();
}

// In exact cycles the reference shows exactly the expected time. When another slave is lost, the reference must not
// count as lost.
TEST_F(ClockHarm, AnExactCycleDoesNotLoseTheReference) {
    for (unsigned n = 0; n < 4; ++n) add({.start_ns = n * 77});
    bring_up();
    for (int n = 0; n < 4; ++n) {
        power(3, false);
        for (int k = 0; k < 50; ++k) {
            cycles(1);
            ASSERT_TRUE(ctx->group(0).dc_time.slaves != 0 || !ctx->group(0).dc_time.came) << n << " " << k;
        }
        power(3, true);
        ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    }
    EXPECT_EQ(register_of<std::uint32_t>(1, wire::reg::kSystemTimeDifference), 0U) << "nobody has written a time to it";
}

// Another program has written a time to the reference clock. Without a correction its rate would stay wrong, because
// the reference follows no other clock.
TEST_F(ClockHarm, AReferenceThatWasDisturbedRunsAtItsOwnRateAgain) {
    add_line(3);
    bring_up();
    const auto rate_of = [this] {
        const auto before = segment.slave(0).clock().copy(osal.now());
        const Time begin = osal.now();
        cycles(1000);
        const auto passed = static_cast<double>(segment.slave(0).clock().copy(osal.now()) - before);
        return passed / static_cast<double>((osal.now() - begin).count());
    };
    const double rate = rate_of();
    std::array<std::byte, 8> wrong{};
    store_le<std::uint64_t>(wrong, 0, segment.slave(0).clock().copy(osal.now()) + 5'000'000);
    ASSERT_TRUE(write_register(*ctx, 1, wire::reg::kSystemTime.address, wrong).ok());
    cycles(3000);
    EXPECT_NEAR(rate_of(), rate, 1e-6);
    EXPECT_LE(greatest_error_ns(3), 100);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync) << joined(events());
}

// The branch was disconnected and kept its power, and its clock is 9 ms away. Its control loop would need a minute. The
// slave is started again, and its clock is set.
TEST_F(ClockHarm, AClockThatComesBackFarAwayIsSet) {
    add_line(3);
    bring_up();
    segment.set_cable({2, 0}, false);
    segment.slave(2).set_drift(3'000'000, osal.now());
    cycles(3000);
    segment.slave(2).set_drift(10'000, osal.now());
    EXPECT_GT(std::abs(ahead_ns(3)), 5'000'000);
    segment.set_cable({2, 0}, true);
    ASSERT_TRUE(until([&] { return all_in_op() && clock(3).in_sync; }, 4000)) << joined(events());
    EXPECT_LE(greatest_error_ns(3), 200);
    cycles(300);
    const auto start = register_of<std::uint64_t>(3, wire::reg::kSyncStartTime);
    EXPECT_EQ(start % 1'000'000, 0U);
    EXPECT_LE(std::abs(static_cast<std::int64_t>(start - segment.slave(2).clock().copy(osal.now()))), 2'000'000)
        << "SYNC0 goes on";
}

// The cable is unplugged for some milliseconds. All clocks stay close, and both reports agree.
TEST_F(ClockHarm, AClockThatComesBackInStepIsInSync) {
    add_line(4);
    bring_up();
    for (const int out_ms : {5, 50, 500}) {
        SCOPED_TRACE(out_ms);
        cycles(5000);
        segment.set_cable({3, 0}, false);
        cycles(out_ms);
        segment.set_cable({3, 0}, true);
        bool differs = false;
        for (int n = 0; n < 5000; ++n) {
            cycles(1);
            bool all = true;
            for (std::uint16_t s = 1; s <= 4; ++s) all &= clock(s).in_sync || ctx->slave(s).al.state == AlState::none;
            differs |= n > 100 && all != clock_status(*ctx, osal.now()).in_sync;
        }
        EXPECT_FALSE(differs) << "ClockStatus::in_sync and SlaveClock::in_sync";
        EXPECT_TRUE(clock(4).in_sync);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
        EXPECT_LE(greatest_error_ns(4), 200);
    }
}

// Slave 1 with the reference clock is bridged, and for a while no frame comes back. Later it is connected again. No
// clock gets a time from before the silence.
TEST_F(ClockHarm, TheNextReferenceTakesOverAfterASilence) {
    add_line(5);
    bring_up();
    cycles(5000);
    const auto most_apart = [this](int count) {
        std::int64_t most = 0;
        for (int n = 0; n < count; ++n) {
            cycles(1);
            for (std::uint16_t s = 3; s <= 5; ++s) most = std::max(most, std::abs(ahead_ns(s, 2)));
        }
        return most;
    };
    segment.disconnect({0, 0});
    segment.disconnect({0, 1});
    EXPECT_LE(most_apart(100), 200);
    ASSERT_TRUE(segment.connect_master({1, 0}));
    segment.reconsider();
    EXPECT_LE(most_apart(1500), 200) << joined(events());
    EXPECT_EQ(reference_clock(*ctx), 2);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    segment.disconnect({1, 0});
    EXPECT_LE(most_apart(100), 200);
    ASSERT_TRUE(segment.connect_master({0, 0}));
    ASSERT_TRUE(segment.connect({0, 1}, {1, 0}, kCable));
    segment.reconsider();
    ASSERT_TRUE(until([&] { return all_in_op() && reference_clock(*ctx) == 1; }, 2000)) << joined(events());
    EXPECT_LE(most_apart(1000), 200) << joined(events());
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    for (std::uint16_t s = 1; s <= 5; ++s) EXPECT_TRUE(clock(s).in_sync) << s;
    EXPECT_LE(greatest_error_ns(5), 200);
    (void)events();
    cycles(3000);
    EXPECT_EQ(joined(events()), "");
}

// A scan deletes the facts about the clocks. It does not delete them while a supervision compares the clocks, and
// deletes them as soon as the supervision has ended.
TEST_F(ClockHarm, AScanAtAnyMomentOfAComparison) {
    add_line(4);
    ClockSettings settings = kFewFrames;
    settings.watch_interval = 1ms;
    settings.delay_interval = 3ms;
    bring_up(settings);
    for (int moment = 0; moment < 120; ++moment) {
        const int polls = moment * 5;
        for (int n = 0; n < polls; ++n) {
            osal.advance(7us);
            (void)poll(*ctx, osal.now());
            if (n % 100 == 99) (void)cycle();
        }
        ScanRequest refused;
        EXPECT_EQ(submit(*ctx, refused).error().code, Errc::busy) << "the supervision uses the slaves";
        refused.cancel();
        if (moment % 2 == 0) supervision.cancel();
        ScanRequest scan;
        if (moment % 2 == 0) (void)submit(*ctx, scan);
        for (int n = 0; n < 3000 && (scan.busy() || (moment % 2 == 0 && supervision.busy())); ++n) {
            osal.advance(20us);
            (void)poll(*ctx, osal.now());
        }
        if (moment % 2 != 0) continue;
        ASSERT_FALSE(scan.busy()) << moment;
        ASSERT_TRUE(scan.state() == RequestState::success || config_init(*ctx).ok()) << moment;
        EXPECT_EQ(clock(2).kind, ClockKind::unknown);
        ASSERT_TRUE(configdc(*ctx, settings).ok());
        for (std::uint16_t n = 1; n <= 4; ++n) ctx->slave(n).config.setup = &every_ms;
        const auto mapped = config_map(*ctx, image);
        ASSERT_TRUE(mapped.ok()) << moment << ": " << words(mapped.error());
        ASSERT_TRUE(submit(*ctx, supervision).ok()) << moment;
        cycles(100);
    }
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    cycles(500);
    EXPECT_LE(greatest_error_ns(4), 100);
}

}  // namespace
}  // namespace margay
