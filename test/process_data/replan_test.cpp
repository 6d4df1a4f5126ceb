// The choice of LRW, or LRD and LWR, for a group that is mapped.
#include "process_data/plant.hpp"
#include "sim/devices.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t kLrd = 10;
constexpr std::uint8_t kLwr = 11;
constexpr std::uint8_t kLrw = 12;

class ReplanTest : public testing::Test, protected Bus {
  protected:
    std::vector<std::byte> image = std::vector<std::byte>(8192);

    Result<> use_lrw(bool lrw) {
        ctx->group(0).config.block_lrw = !lrw;
        return replan_processdata(*ctx);
    }
    [[nodiscard]] std::vector<unsigned> commands() const {
        std::vector<unsigned> all;
        for (std::size_t n = 0; n < ctx->group(0).datagrams.size(); ++n)
            all.push_back(process_datagram(*ctx, n).command);
        return all;
    }
    // Checks that the slaves return the values that they received, in a cycle without an error.
    void expect_exchange(std::uint8_t value) {
        for (std::size_t n = 1; n <= segment.size(); ++n)
            ctx->slave(n).image.outputs.bytes[0] = static_cast<std::byte>(value + n);
        for (int n = 0; n < 3; ++n) ASSERT_TRUE(cycle().ok());
        const auto counter = cycle();
        ASSERT_TRUE(counter.ok());
        EXPECT_EQ(*counter, ctx->group(0).expected_wkc);
        for (std::size_t n = 1; n <= segment.size(); ++n) {
            EXPECT_TRUE(inputs_fresh(*ctx, static_cast<std::uint16_t>(n)));
            EXPECT_EQ(device(n).outputs()[0], static_cast<std::byte>(value + n)) << "slave " << n;
        }
    }
};

TEST_F(ReplanTest, TheGroupGoesOnInOp) {
    for (int n = 0; n < 3; ++n) add(16, 16);
    start();
    ctx->group(0).config.dc_reference = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    EXPECT_EQ(commands(), std::vector<unsigned>{kLrw});
    expect_exchange(10);
    const LogicalAddress address = process_datagram(*ctx, 0).address;
    for (const bool lrw : {false, true, false, false, true, true}) {
        ASSERT_TRUE(use_lrw(lrw).ok());
        EXPECT_EQ(commands(), (lrw ? std::vector<unsigned>{kLrw} : std::vector<unsigned>{kLwr, kLrd}));
        EXPECT_EQ(ctx->group(0).expected_wkc, lrw ? 9U : 6U);
        EXPECT_EQ(process_datagram(*ctx, 0).address.value, address.value);
        expect_exchange(lrw ? 20 : 30);
        EXPECT_TRUE(ctx->group(0).dc_time.came);
        EXPECT_EQ(ctx->group(0).dc_time.slaves, 3U);
        for (std::size_t n = 1; n <= 3; ++n) EXPECT_EQ(ctx->slave(n).al.state, AlState::op);
    }
    EXPECT_EQ(errors(), std::vector<std::string>{});
}

TEST_F(ReplanTest, ACycleOnTheWireIsGivenUp) {
    add(16, 16);
    start();
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    ASSERT_TRUE(send_processdata(*ctx).ok());
    ASSERT_TRUE(use_lrw(false).ok());
    EXPECT_EQ(receive_processdata(*ctx, 1ms).error().code, Errc::no_cycle);
    ASSERT_TRUE(cycle().ok());
    expect_exchange(5);
}

TEST_F(ReplanTest, ASlaveThatDoesNotTakePartIsLeftOutAsBefore) {
    for (int n = 0; n < 3; ++n) add(16, 16);
    start();
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    segment.set_power(2, false, osal.now());
    (void)cycle();
    (void)readstate(*ctx);
    ASSERT_EQ(ctx->slave(3).al.state, AlState::none);
    for (const bool lrw : {false, true}) {
        ASSERT_TRUE(use_lrw(lrw).ok());
        for (int n = 0; n < 4; ++n) (void)cycle();  // poll() reads the states of the slaves that take part
        EXPECT_EQ(cycle().error().code, Errc::working_counter);
        for (const DatagramStatus& d : ctx->group(0).datagrams) {
            EXPECT_EQ(d.expected, lrw ? 9U : 3U);
            EXPECT_EQ(d.full, d.expected);
            EXPECT_EQ(d.accepted, lrw ? 6U : 2U);
            EXPECT_EQ(d.got, d.accepted);
        }
        EXPECT_TRUE(inputs_fresh(*ctx, 1));
        EXPECT_TRUE(inputs_fresh(*ctx, 2));
        EXPECT_FALSE(inputs_fresh(*ctx, 3));
    }
    segment.set_power(2, true, osal.now());
    osal.advance(1s);
    ASSERT_TRUE(recover_slave(*ctx, 3).ok());
    ASSERT_TRUE(reconfigure_slave(*ctx, 3).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    expect_exchange(40);
}

// Inputs and outputs at the same addresses need one datagram, or two datagrams that do not fit in one frame.
TEST_F(ReplanTest, WithoutRoomForTheFramesTheOldOnesStay) {
    for (int n = 0; n < 2; ++n) add(700 * 8, 700 * 8);
    start({.slaves = 8, .process_frames = 1});
    ctx->group(0).config.overlapped = true;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    expect_exchange(1);
    EXPECT_EQ(use_lrw(false).error().code, Errc::too_many_frames);
    EXPECT_EQ(commands(), std::vector<unsigned>{kLrw});
    expect_exchange(2);
    ASSERT_TRUE(use_lrw(true).ok());
    expect_exchange(3);
}

TEST_F(ReplanTest, Refusals) {
    add(16, 16);
    start({.slaves = 8, .groups = 2});
    EXPECT_EQ(replan_processdata(*ctx).error().code, Errc::unknown_group);
    EXPECT_EQ(replan_processdata(*ctx, 1).error().code, Errc::unknown_group);
    EXPECT_EQ(replan_processdata(*ctx, 9).error().code, Errc::unknown_group);
    ctx->group(0).config.cycles_in_flight = 2;
    (void)config_map(*ctx, image);
    EXPECT_FALSE(replan_processdata(*ctx).ok());
    ctx->group(0).config.cycles_in_flight = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    ctx->group(0).config.cycles_in_flight = 0;  // no cycle would have a frame
    EXPECT_EQ(replan_processdata(*ctx).error().code, Errc::invalid_argument);
    expect_exchange(4);
    HostContext other({.slaves = 2});
    EXPECT_EQ(replan_processdata(other).error().code, Errc::wrong_state);
}

// Meanwhile the PDOs of a slave that comes back are read again, and they have not changed.
TEST(ReplanBesideARecovery, IsNotRefused) {
    Plant plant;
    const auto first = plant.make({.product = 0x100});
    const auto drive = plant.segment.add(std::move(*sim::make_device("drive")).assemble());
    ASSERT_TRUE(plant.segment.connect_master({first, 0}));
    ASSERT_TRUE(plant.segment.connect({first, 1}, {drive, 0}));
    ASSERT_TRUE(plant.bring_up({}).empty());
    plant.run();
    plant.power(drive, false);
    plant.cycles(100);
    ASSERT_FALSE(plant.ctx->slave(2).takes_part);
    plant.power(drive, true);
    for (int n = 0; n < 30'000 && !plant.in_op(2); ++n) {
        if (n % 10 == 0) (void)plant.cycle();
        plant.osal.advance(100us);
        (void)poll(*plant.ctx, plant.osal.now());
        plant.ctx->group(0).config.block_lrw = n % 2 != 0;
        const auto planned = replan_processdata(*plant.ctx);
        std::array<char, 256> text{};
        ASSERT_TRUE(planned.ok()) << describe(planned.error(), text);
    }
    ASSERT_TRUE(plant.in_op(2)) << Plant::joined(plant.events());
    plant.cycles(3);
    const auto counter = plant.cycle();
    std::array<char, 256> text{};
    ASSERT_TRUE(counter.ok()) << describe(counter.error(), text);
    EXPECT_EQ(*counter, plant.ctx->group(0).expected_wkc);
}

}  // namespace
}  // namespace margay
