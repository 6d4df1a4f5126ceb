// A branch with the reference clock is lost and comes back, while another branch runs.
#include "clock/late_clocks_bus.hpp"

namespace margay {
namespace {

// A junction with slaves 2 to 5 at one port and slaves 6 and 7 at the other port. Slave 2 has the reference clock. The
// cycles are up to 10 µs late.
struct LostBranch : LateClocksBus {
    static constexpr std::array<std::uint16_t, 2> kOthers{6, 7};
    static constexpr sim::PortRef kBranch{1, 0};
    std::uint32_t random = 1;
    std::int64_t most_ns = 0;
    unsigned out = 0;

    void add_slave(sim::PortRef at, const ClockOf& clock) {
        ExpectedSlave slave;
        slave.number = static_cast<std::uint16_t>(wanted.size() + 1);
        wanted.push_back(slave);
        const auto n = segment.add(clocked(clock).assemble());
        EXPECT_TRUE(segment.connect(at, {n, 0}, kCable));
    }
    void bring_up_branches(const ClockSettings& settings = kFewFrames) {
        hang(0, {.unit = sim::DcUnit::receive_times});
        add_slave({0, 3}, {.drift_ppb = 50'000, .start_ns = 123});
        for (const std::uint32_t n : {1U, 2U, 3U}) add_slave({n, 1}, {.drift_ppb = 40'000, .start_ns = n});
        add_slave({0, 1}, {.drift_ppb = -50'000, .start_ns = 1234});
        add_slave({5, 1}, {.drift_ppb = -30'000, .start_ns = 12345});
        bring_up(settings, {});
        ASSERT_EQ(reference_clock(*ctx), 2);
    }
    // The branch is away for 1.5 s. Then it has been back for `since`.
    void bring_branch_back(Duration cycle, Duration since) {
        period = cycle;
        bring_up_branches();
        segment.set_cable(kBranch, false);
        run_late(1500ms);
        segment.set_cable(kBranch, true);
        run_late(since);
    }
    // Each cycle is sent up to 10 µs after it was due.
    void run_late(Duration how_long) {
        Duration late{};
        for (Duration passed{}; passed < how_long; passed += period) {
            random = random * 1'664'525 + 1'013'904'223;
            const Duration now(random % 10'000);
            step(period + now - late);
            late = now;
            most_ns = std::max(most_ns, std::abs(ahead_ns(7, 6)));
            for (const std::uint16_t n : kOthers) out += clock(n).in_sync ? 0U : 1U;
        }
    }
};

// The last frame of a lost reference brings the next reference a wrong time: by the jitter of the cycle, and by the way
// to the branch.
TEST(LostBranch, TheOtherBranchStaysInSync) {
    for (const Duration cycle : {1ms, 4ms, 10ms}) {
        SCOPED_TRACE(cycle / 1ms);
        LostBranch bus;
        bus.period = cycle;
        bus.bring_up_branches();
        for (int times = 0; times < 3; ++times) {
            bus.segment.set_cable(LostBranch::kBranch, false);
            bus.run_late(1500ms);
            EXPECT_EQ(reference_clock(*bus.ctx), 6);
            EXPECT_EQ(bus.out, 0U) << bus.joined(bus.events());
            EXPECT_LE(bus.most_ns, 250);
            bus.segment.set_cable(LostBranch::kBranch, true);
            bus.run_late(6s);
            EXPECT_EQ(reference_clock(*bus.ctx), 2);
            // With cycles of 10 ms, the clocks are not compared for up to a second when the branch is back.
            EXPECT_LE(bus.out, cycle < 10ms ? 0U : 200U) << bus.joined(bus.events());
            EXPECT_LE(bus.most_ns, 250);
            bus.most_ns = bus.out = 0;
        }
    }
}

// The clocks are compared after the last frame of the lost reference, before the supervision notices the loss.
TEST(LostBranch, IsNoReasonForAnotherClockToBeOutOfSync) {
    for (unsigned moment = 0; moment < 30; ++moment) {
        SCOPED_TRACE(moment);
        LostBranch bus;
        bus.bring_up_branches();
        bus.run_late(moment * 1ms);
        bus.random += moment;
        bus.segment.set_cable(LostBranch::kBranch, false);
        bus.run_late(300ms);
        EXPECT_EQ(bus.out, 0U) << bus.joined(bus.events());
        EXPECT_LE(bus.most_ns, 250);
    }
}

// For some cycles the branch with the reference does not answer. The cycle carries the time of another clock, and the
// reference gets the time that the master sends, before the supervision has noticed anything.
TEST(LostBranch, AnInstantMovesNoClock) {
    for (const int gone : {1, 2, 3, 5, 8}) {
        SCOPED_TRACE(gone);
        LostBranch bus;
        bus.bring_up_branches();
        for (int times = 0; times < 5; ++times) {
            bus.segment.set_cable(LostBranch::kBranch, false);
            bus.steps(gone);
            bus.segment.set_cable(LostBranch::kBranch, true);
            std::int64_t most = 0;
            for (int n = 0; n < 1503; ++n) {
                bus.step();
                most = std::max(most, bus.greatest_error_ns(7));
            }
            EXPECT_LE(most, 600) << bus.joined(bus.events());
            EXPECT_EQ(reference_clock(*bus.ctx), 2);
            EXPECT_TRUE(clock_status(*bus.ctx, bus.osal.now()).in_sync);
        }
    }
}

// The first slave of the branch becomes the reference, and the slaves behind it follow it.
TEST(LostBranch, IsBackWithinASecond) {
    for (const bool power : {false, true}) {
        SCOPED_TRACE(power);
        LostBranch bus;
        bus.bring_up_branches();
        for (std::uint32_t n = 1; n <= 4; ++n)
            if (power) bus.power(n, false);
        if (!power) bus.segment.set_cable(LostBranch::kBranch, false);
        bus.run_late(2s);
        for (std::uint32_t n = 1; n <= 4; ++n)
            if (power) bus.power(n, true);
        if (!power) bus.segment.set_cable(LostBranch::kBranch, true);
        (void)bus.events();
        bus.run_late(1s);
        EXPECT_EQ(reference_clock(*bus.ctx), 2);
        EXPECT_EQ(bus.told(bus.events(), "is the reference clock now"), 1);
        EXPECT_TRUE(clock_status(*bus.ctx, bus.osal.now()).in_sync);
        for (std::uint16_t n = 2; n <= 7; ++n) EXPECT_TRUE(bus.clock(n).in_sync && bus.in_op(n)) << n;
        EXPECT_LE(bus.greatest_error_ns(7), 200);
        EXPECT_EQ(bus.out, 0U);
    }
}

// After each measurement of delays the supervision continues at once, also if clocks are compared only once a second.
TEST(LostBranch, ASlaveIsReportedLostWhileDelaysAreMeasured) {
    for (const Duration since : {1900ms, 2050ms, 2200ms, 2500ms, 4100ms}) {
        SCOPED_TRACE(testing::Message() << since / 1ms << " ms");
        LostBranch bus;
        bus.period = 1ms;
        ClockSettings settings = kFewFrames;
        settings.watch_interval = 1s;
        settings.delay_interval = 2s;
        bus.bring_up_branches(settings);
        bus.run_late(since);
        bus.segment.set_cable({6, 0}, false);
        bus.run_late(100ms);
        EXPECT_EQ(bus.ctx->slave(7).al.state, AlState::none);
    }
}

// With long cycles the slave learns the rate for seconds. Meanwhile the supervision continues.
TEST(LostBranch, ASlaveThatIsCutOffWhileTheBranchReturnsIsReportedLost) {
    for (const Duration cycle : {1ms, 4ms, 10ms}) {
        for (const Duration since : {0ms, 300ms, 500ms, 1000ms, 2000ms}) {
            SCOPED_TRACE(testing::Message() << cycle / 1ms << " ms, " << since / 1ms << " ms after it was back");
            LostBranch bus;
            bus.bring_branch_back(cycle, since);
            bus.segment.set_cable({6, 0}, false);
            bus.run_late(100ms);
            EXPECT_EQ(bus.ctx->slave(7).al.state, AlState::none);
            // The return continues, or starts again.
            bus.run_late(7s);
            EXPECT_EQ(reference_clock(*bus.ctx), 2) << bus.joined(bus.events());
            for (std::uint16_t n = 2; n <= 6; ++n) EXPECT_TRUE(bus.in_op(n) && bus.clock(n).in_sync) << n;
        }
    }
}

// The same for the slave that learns, and for the reference from which it learns.
TEST(LostBranch, TheSlaveThatLearnsAndItsReferenceAreReportedLost) {
    for (const Duration cycle : {1ms, 4ms, 10ms}) {
        for (const bool learner : {true, false}) {
            for (const Duration since : {300ms, 500ms, 1000ms}) {
                SCOPED_TRACE(testing::Message() << cycle / 1ms << " ms, " << since / 1ms << " ms after it was back, "
                                                << (learner ? "the slave" : "its reference"));
                LostBranch bus;
                bus.bring_branch_back(cycle, since);
                const sim::PortRef cut = learner ? LostBranch::kBranch : sim::PortRef{5, 0};
                bus.segment.set_cable(cut, false);
                bus.run_late(100ms);
                EXPECT_EQ(bus.ctx->slave(learner ? 2 : 6).al.state, AlState::none);
                bus.segment.set_cable(cut, true);
                bus.run_late(10s);
                EXPECT_EQ(reference_clock(*bus.ctx), 2) << bus.joined(bus.events());
                for (std::uint16_t n = 2; n <= 7; ++n) EXPECT_TRUE(bus.in_op(n) && bus.clock(n).in_sync) << n;
            }
        }
    }
}

// The reference is lost before the slave of the branch is in step with it. Meanwhile no cycle carries the time of this
// slave, because this time would change the rate of the reference. Then the slave would learn a wrong rate, for up to
// 13 s.
TEST(LostBranch, TheReferenceThatIsLostAtOnceKeepsItsRate) {
    for (const Duration since : {0ms, 20ms, 60ms, 100ms}) {
        SCOPED_TRACE(testing::Message() << since / 1ms << " ms after it was back");
        LostBranch bus;
        bus.bring_branch_back(10ms, since);
        bus.segment.set_cable({5, 0}, false);
        bus.run_late(100ms);
        bus.segment.set_cable({5, 0}, true);
        bus.run_late(10s);
        EXPECT_EQ(reference_clock(*bus.ctx), 2) << bus.joined(bus.events());
        for (std::uint16_t n = 2; n <= 7; ++n) EXPECT_TRUE(bus.in_op(n) && bus.clock(n).in_sync) << n;
    }
}

// A junction without a clock and slaves 2 to 4 at its ports. Slave 2 becomes the reference again, and the cycles carry
// no time. In this moment all slaves are lost. Slave 2 does not come back.
TEST(LostBranch, TheTimeIsCarriedAgainAfterALossOfAllSlavesInAReturn) {
    for (const int moment : {1, 5, 10, 20, 30, 40}) {
        SCOPED_TRACE(moment);
        LateClocksBus bus;
        bus.hang(0, {.unit = sim::DcUnit::receive_times});
        bus.hang(3, {.drift_ppb = 50'000, .start_ns = 123}, true);
        bus.hang(1, {.drift_ppb = -50'000, .start_ns = 1234});
        bus.hang(2, {.drift_ppb = 20'000, .start_ns = 12345});
        bus.bring_up(kFewFrames, {});
        ASSERT_EQ(reference_clock(*bus.ctx), 2);
        bus.power(1, false);
        bus.steps(1000);
        ASSERT_EQ(reference_clock(*bus.ctx), 3);
        const RegisterReading& time = bus.ctx->group(0).dc_time;
        ASSERT_EQ(time.slaves, 2);
        bus.power(1, true);
        int waited = 0;
        for (; waited < 2000 && time.slaves != 0; ++waited) bus.step();
        ASSERT_LT(waited, 2000);
        bus.steps(moment);
        bus.segment.set_cable({0, 0}, false);
        bus.steps(100);
        bus.power(1, false);
        bus.steps(1400);
        bus.segment.set_cable({0, 0}, true);
        bus.steps(2000);
        EXPECT_EQ(reference_clock(*bus.ctx), 3);
        EXPECT_EQ(time.slaves, 2);
        EXPECT_LE(std::abs(bus.ahead_ns(4, 3)), 200);
        EXPECT_TRUE(clock_status(*bus.ctx, bus.osal.now()).in_sync);
    }
}

}  // namespace
}  // namespace margay
