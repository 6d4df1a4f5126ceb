// The state after a break is restored by the library, or when the application requests it.
#include "redundancy/ring_bus.hpp"

namespace margay {
namespace {

struct RingRestoring : testing::Test, RingBus {
    // Slaves 4 and 5 stay between two breaks until their watchdogs have expired.
    void lose_two() {
        build_line(8);
        start();
        run();
        ASSERT_FALSE(status().restoring_waits);
    }
    void break_twice() {
        cable(ring_cables[3], false);
        (void)stale_cycles(5);
        cable(ring_cables[5], false);
        (void)stale_cycles(500);
        ASSERT_EQ(ctx->slave(4).al.state, AlState::none);
    }
    void heal() {
        cable(ring_cables[3], true);
        (void)stale_cycles(5);
        cable(ring_cables[5], true);
    }
};

TEST_F(RingRestoring, IsAutomatic) {
    lose_two();
    break_twice();
    heal();
    EXPECT_TRUE(until_all_in_op()) << joined(events());
    EXPECT_FALSE(status().restoring_waits);
}

TEST_F(RingRestoring, WaitsForTheApplication) {
    lose_two();
    set_automatic_restoring(*ctx, false);
    EXPECT_FALSE(status().restoring_waits) << "nothing has changed since";
    break_twice();
    EXPECT_TRUE(status().restoring_waits);
    heal();
    (void)stale_cycles(3000);
    EXPECT_EQ(status().ring, RingState::whole);
    EXPECT_TRUE(status().restoring_waits);
    const auto told = joined(events());
    EXPECT_NE(told.find("slave 4: found again"), std::string::npos) << told;
    for (const std::size_t n : {4U, 5U}) {
        EXPECT_NE(ctx->slave(n).al.state, AlState::none) << n;
        EXPECT_NE(ctx->slave(n).al, (AlStatus{AlState::op, false, 0})) << n;
    }
    for (const std::size_t n : {1U, 2U, 3U, 6U, 7U, 8U}) EXPECT_EQ(ctx->slave(n).al.state, AlState::op) << n;
    restore_ring(*ctx);
    EXPECT_TRUE(until_all_in_op()) << joined(events());
    EXPECT_FALSE(status().restoring_waits);
}

TEST_F(RingRestoring, SwitchingOnRestoresWhatWaits) {
    lose_two();
    set_automatic_restoring(*ctx, false);
    break_twice();
    heal();
    (void)stale_cycles(1000);
    EXPECT_FALSE(all_in_op());
    set_automatic_restoring(*ctx, true);
    EXPECT_TRUE(until_all_in_op()) << joined(events());
}

// After a break between slaves of a whole ring, no slave has to be started.
TEST_F(RingRestoring, ASimpleBreakNeedsNone) {
    lose_two();
    set_automatic_restoring(*ctx, false);
    cable(ring_cables[3], false);
    EXPECT_EQ(stale_cycles(500), 0U);
    cable(ring_cables[3], true);
    EXPECT_EQ(stale_cycles(500), 0U);
    EXPECT_TRUE(all_in_op());
}

// With one NIC both calls have no effect.
TEST(RingRestoringOfOneNic, HasNoEffect) {
    VirtualOsal osal;
    sim::Segment segment;
    const auto n = segment.add(RingBus::io_device().assemble());
    ASSERT_TRUE(segment.connect_master({n, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx(Limits{.slaves = 4});
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    set_automatic_restoring(ctx, false);
    restore_ring(ctx);
    EXPECT_FALSE(redundancy(ctx).restoring_waits);
    EXPECT_TRUE(config_init(ctx).ok());
}

// The places that were read when the ring became whole belonged to three slaves.
TEST_F(RingRestoring, WhileASlaveComesBackTheOthersKeepTheirPlaces) {
    build_line(4);
    start();
    run();
    for (unsigned round = 0; round < 5; ++round) {
        segment.set_power(1, false, osal.now());
        (void)stale_cycles(500);
        ASSERT_EQ(ctx->slave(2).al.state, AlState::none);
        (void)stale_cycles(round);  // at other moments of a round of the supervision
        segment.set_power(1, true, osal.now());
        for (unsigned n = 0; n < 4000 && !all_in_op(); ++n) {
            (void)cycle();
            for (const std::size_t other : {1U, 3U, 4U})
                ASSERT_NE(ctx->slave(other).ring_position, 0) << other << ", round " << round << ", cycle " << n;
        }
        ASSERT_TRUE(all_in_op()) << joined(events());
    }
}

}  // namespace
}  // namespace margay
