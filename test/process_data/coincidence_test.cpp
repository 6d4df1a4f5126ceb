// Working counters that are the accepted ones by coincidence: one slave has left the exchange, and another one with the
// same share has come.
#include "process_data/bus.hpp"

#include <margay/supervision.hpp>

namespace margay {
namespace {

struct Coincidences : Bus, testing::Test {
    std::vector<std::byte> image = std::vector<std::byte>(64);

    void bring_up(std::size_t slaves, std::uint8_t in_flight = 1) {
        for (std::size_t n = 0; n < slaves; ++n) add(16, 16);
        start();
        ctx->group(0).config.cycles_in_flight = in_flight;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_EQ(to_op().state, AlState::op);
    }
    // A cycle after which poll() is not called, thus without what a sequence does after its datagram.
    Result<std::uint32_t> cycle_alone() {
        osal.advance(std::chrono::milliseconds(1));
        EXPECT_TRUE(send_processdata(*ctx).ok());
        return receive_processdata(*ctx, reply_timeout);
    }
    void expect_not_fresh(const Result<std::uint32_t>& cycle) {
        ASSERT_FALSE(cycle.ok());
        EXPECT_EQ(cycle.error().code, Errc::working_counter);
        EXPECT_EQ(cycle.error().detail & Error::kOthersFresh, 0U);
        EXPECT_FALSE(inputs_fresh(*ctx, 2));
        EXPECT_FALSE(all_right(*ctx));
    }
};

TEST_F(Coincidences, ASlaveWhoseStateIsRequestedHidesNoneThatComesBack) {
    bring_up(3);
    segment.disconnect({1, 1});
    segment.reconsider();
    EXPECT_FALSE(cycle().ok());
    ASSERT_TRUE(readstate(*ctx).ok());
    EXPECT_EQ(cycle().error().detail, Error::kOthersFresh);
    EXPECT_TRUE(inputs_fresh(*ctx, 2));
    ASSERT_TRUE(writestate(*ctx, 2, AlState::preop).ok());
    for (int n = 0; n < 5; ++n) expect_not_fresh(cycle());
    ASSERT_TRUE(segment.connect({1, 1}, {2, 0}));
    segment.reconsider();
    for (int n = 0; n < 5; ++n) {
        const auto ended = cycle();
        EXPECT_EQ(ctx->group(0).datagrams[0].got, ctx->group(0).datagrams[0].accepted) << "the sum is right";
        expect_not_fresh(ended);
    }
}

TEST_F(Coincidences, ASlaveThatIsConfiguredHidesNoneWithoutPower) {
    bring_up(2);
    segment.set_power(1, false, osal.now());
    for (int n = 0; n < 3; ++n) expect_not_fresh(cycle());
    ReconfigRequest again;
    again.slave = 1;
    ASSERT_TRUE(submit(*ctx, again).ok());
    bool hidden = false;
    for (int n = 0; again.busy() && n < 10000; ++n) {
        for (int alone = 0; alone < 2; ++alone) {
            const auto ended = cycle_alone();
            const DatagramStatus& sum = ctx->group(0).datagrams[0];
            hidden |= sum.came && sum.got != 0 && sum.got == sum.accepted;
            expect_not_fresh(ended);
        }
        (void)poll(*ctx, osal.now());
    }
    EXPECT_EQ(again.state(), RequestState::success);
    EXPECT_TRUE(hidden) << "the sum was right once";
    expect_not_fresh(cycle());
}

// The cycle was sent while the slave was still there, and is received when it is known to have left.
TEST_F(Coincidences, ASlaveThatHasLeftHidesNoneWithoutPower) {
    bring_up(2, 3);
    for (int n = 0; n < 2; ++n) EXPECT_TRUE(send_processdata(*ctx).ok());
    segment.set_power(1, false, osal.now());
    for (int n = 0; n < 5; ++n) (void)cycle();
    ReconfigRequest again;
    again.slave = 1;
    ASSERT_TRUE(submit(*ctx, again).ok());
    bool hidden = false;
    for (int n = 0; again.busy() && n < 10000; ++n) {
        const auto ended = cycle();
        const DatagramStatus& sum = ctx->group(0).datagrams[0];
        hidden |= sum.came && sum.got != 0 && sum.got == sum.accepted;
        expect_not_fresh(ended);
    }
    EXPECT_EQ(again.state(), RequestState::success);
    EXPECT_TRUE(hidden) << "the sum was right once";
}

}  // namespace
}  // namespace margay
