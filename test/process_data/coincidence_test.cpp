// Working counters that have the accepted value by coincidence: one slave has left the exchange, and another slave with
// the same share has joined it.
#include "process_data/plant.hpp"

#include <margay/run.hpp>
#include <margay/supervision.hpp>

#include <array>
#include <chrono>

namespace margay {
namespace {

struct Line : Bus {
    std::vector<std::byte> image = std::vector<std::byte>(64);

    void bring_up(std::size_t slaves, std::uint8_t in_flight = 1) {
        for (std::size_t n = 0; n < slaves; ++n) add(16, 16);
        start();
        ctx->group(0).config.cycles_in_flight = in_flight;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_EQ(to_op().state, AlState::op);
    }
    // A cycle without a following poll(), so that no sequence continues after its datagram.
    Result<std::uint32_t> cycle_alone() {
        osal.advance(std::chrono::milliseconds(1));
        EXPECT_TRUE(send_processdata(*ctx).ok());
        return receive_processdata(*ctx, reply_timeout);
    }
};

struct Coincidences : Line, testing::Test {
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

// The cycle was sent while the slave was still present. When the cycle is received, the slave is known to have left.
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

// Slave 3 has kept its power and its FMMUs while its cable was unplugged, and is known to be lost.
struct Replugged : Line {
    explicit Replugged(std::uint8_t in_flight) {
        bring_up(3, in_flight);
        EXPECT_TRUE(submit(*ctx, supervision).ok());
        for (int n = 0; n < 10; ++n) (void)cycle();
        segment.disconnect({1, 1});
        segment.reconsider();
        for (int n = 0; n < 100 && (n < 20 || !inputs_fresh(*ctx, 2)); ++n) (void)cycle();
        EXPECT_TRUE(inputs_fresh(*ctx, 2));
    }
    SuperviseRequest supervision;
    int left_in = 0;      // the first cycle of the start-up of slave 2 without slave 2
    bool hidden = false;  // the sum had the expected value while slave 3 answered in place of slave 2
    // Connects the cable before cycle `when` of the start-up of slave 2.
    void start_up(int when) {
        ReconfigRequest again;
        again.slave = 2;
        EXPECT_TRUE(submit(*ctx, again).ok());
        for (int n = 0; again.busy() && n < 10000; ++n) {
            if (n == when) {
                EXPECT_TRUE(segment.connect({1, 1}, {2, 0}));
                segment.reconsider();
            }
            const bool answers = segment.slave(1).registers().get<std::uint8_t>(0x060C) != 0;  // its first FMMU is on
            if (!answers && left_in == 0) left_in = n;
            (void)cycle_alone();
            EXPECT_FALSE(!answers && inputs_fresh(*ctx, 2)) << "cable in cycle " << when << ", now cycle " << n;
            const DatagramStatus& sum = ctx->group(0).datagrams[0];
            hidden |= !answers && n >= when && sum.came && sum.got == 6 && sum.got == sum.accepted;
            if (n % 4 != 3) (void)poll(*ctx, osal.now());
        }
        EXPECT_EQ(again.state(), RequestState::success);
    }
};

class Replug : public testing::TestWithParam<std::uint8_t> {};

TEST_P(Replug, ASlaveThatIsConfiguredHidesNoneBehindItsCable) {
    Replugged first(GetParam());
    first.start_up(-1);
    bool hidden = false;
    for (int when = first.left_in - 4; when < first.left_in + 4; ++when) {
        Replugged line(GetParam());
        line.start_up(when);
        hidden |= line.hidden;
    }
    EXPECT_TRUE(hidden) << "the sum was right once";
}

INSTANTIATE_TEST_SUITE_P(InFlight, Replug, testing::Values(std::uint8_t{1}, std::uint8_t{3}));

// ------------------------------------------------------------------ the limit: an equal change between two cycles

// Three slaves at the ports of the first slave. The second and the third slave have the same share of the working
// counter.
struct Star : Plant {
    std::array<std::uint32_t, 3> at{};
    explicit Star(bool supervised) {
        for (std::uint32_t n = 0; n < at.size(); ++n) at[n] = make({.product = 0x100 + n});
        EXPECT_TRUE(segment.connect_master({at[0], 0}));
        plug({at[0], 1}, at[1]);
        plug({at[0], 2}, at[2]);
        EXPECT_TRUE(bring_up({}).empty());
        EXPECT_TRUE(config_map(*ctx, image).ok());
        EXPECT_TRUE(reach(*ctx, AlState::op, std::chrono::seconds(1)).ok());
        if (supervised) {
            EXPECT_TRUE(submit(*ctx, supervision).ok());
        }
        cycles(50);
        // The third slave is disconnected, keeps its power, and is known to be lost.
        pull(at[2]);
        segment.reconsider();
        (void)cycle();
        if (!supervised) {
            EXPECT_TRUE(readstate(*ctx).ok());
        }
        cycles(20);
        EXPECT_EQ(ctx->slave(3).al.state, AlState::none);
        EXPECT_TRUE(inputs_fresh(*ctx, 2));
    }
    // Between two cycles the second slave leaves and the third slave comes.
    void change() {
        pull(at[1]);
        plug({at[0], 2}, at[2]);
        segment.reconsider();
    }
};

TEST(EqualChange, IsSeenByASupervisionWithinItsInterval) {
    Star plant(true);
    plant.change();
    int wrong = 0;
    while (wrong < 1000 && plant.ctx->slave(2).al.state != AlState::none) {
        (void)plant.cycle();
        ++wrong;
    }
    EXPECT_LE(wrong, 15) << "10 ms and some cycles";
    EXPECT_FALSE(inputs_fresh(*plant.ctx, 2));
    EXPECT_FALSE(all_right(*plant.ctx));
    EXPECT_TRUE(plant.until([&] { return plant.in_op(3) && inputs_fresh(*plant.ctx, 3); }));
}

// Meanwhile the NIC has no link and refuses the frames of a cycle, and the application does not receive this cycle.
TEST(EqualChange, IsSeenAtOnceBesideARefusedCycle) {
    for (const bool supervised : {false, true}) {
        SCOPED_TRACE(supervised);
        Star plant(supervised);
        plant.segment.set_master_cable(0, false);
        plant.osal.advance(std::chrono::milliseconds(1));
        EXPECT_FALSE(send_processdata(*plant.ctx).ok());
        plant.change();
        plant.segment.set_master_cable(0, true);
        for (int n = 0; n < 5; ++n) {
            plant.osal.advance(std::chrono::milliseconds(1));
            EXPECT_TRUE(send_processdata(*plant.ctx).ok());
            EXPECT_FALSE(receive_processdata(*plant.ctx, std::chrono::microseconds(500)).ok());
            const DatagramStatus& sum = plant.ctx->group(0).datagrams[0];
            EXPECT_EQ(sum.got, sum.accepted) << "the sum is right";
            EXPECT_FALSE(inputs_fresh(*plant.ctx, 2)) << n;
        }
    }
}

TEST(EqualChange, IsSeenByReadstateWithoutASupervision) {
    Star plant(false);
    plant.change();
    plant.cycles(20);
    EXPECT_TRUE(inputs_fresh(*plant.ctx, 2)) << "the limit that receive_processdata() names";
    ASSERT_TRUE(readstate(*plant.ctx).ok());
    EXPECT_FALSE(inputs_fresh(*plant.ctx, 2));
    (void)plant.cycle();
    EXPECT_FALSE(inputs_fresh(*plant.ctx, 2));
    EXPECT_FALSE(inputs_fresh(*plant.ctx, 3)) << "its identity was not compared, or it is not started";
    EXPECT_FALSE(all_right(*plant.ctx));
}

}  // namespace
}  // namespace margay
