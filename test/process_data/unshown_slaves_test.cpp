// There is no supervision. Slave 3, at the end of the line, is exchanged for a device of another product with the
// station address, FMMUs and state of slave 3. No cycle shows the exchange, or slow cycles are lost meanwhile.
// readstate() compares the device.
#include "process_data/silence.hpp"

#include <margay/registers.hpp>

namespace margay {
namespace {

constexpr std::array kMark{std::byte{0x5A}, std::byte{0xA5}};
constexpr std::uint16_t kUserMemory = 0x0F80;

struct UnshownSlaves : Identities {
    std::vector<std::byte> image_of_group_1 = std::vector<std::byte>(256);
    bool group_1 = false;

    void SetUp() override {}
    void TestBody() override {}  // for tests that use several plants
    // Puts slave 3 into its own group.
    void split() {
        ctx->slave(3).config.group = 1;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(config_map(*ctx, image_of_group_1, 1).ok());
        ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok());
        group_1 = true;
    }
    void be_steady() {
        for (const auto device : line) set(device, 0x0420, 0);  // the watchdogs of the devices are off
        run(2500);
        ASSERT_TRUE(readstate(*ctx).ok());
    }
    // Executes cycles of 1 ms. Group 1 has a cycle every two seconds.
    void run(int count) {
        for (int n = 0; n < count; ++n) {
            write_outputs();
            EXPECT_TRUE(cycle().ok());
            if (!group_1 || ++cycles_since_ % 2000 != 0) continue;
            (void)send_processdata(*ctx, 1);
            (void)receive_processdata(*ctx, 1ms, 1);
        }
    }
    void exchange_slave_3(AlState state) {
        make_like_slave_2(tool, state, mapping_of(3));
        set(tool, 0x0010, 0x1003);
        set(tool, 0x0420, 0);
        segment.disconnect({line[2], 0});
        ASSERT_TRUE(segment.connect({line[1], 1}, {tool, 0}));
        segment.reconsider();
    }
    void expect_found() {
        EXPECT_FALSE(readstate(*ctx).ok());
        EXPECT_FALSE(write_register(*ctx, 3, kUserMemory, kMark).ok());
        EXPECT_EQ(segment.slave(tool).peek(kUserMemory, 1)[0], std::byte{0});
        EXPECT_FALSE(inputs_fresh(*ctx, 3));
        EXPECT_FALSE(all_right(*ctx));
    }

  private:
    int cycles_since_ = 0;
};

TEST_F(UnshownSlaves, ASlaveThatRestsInPreopIsCompared) {
    for (const bool has_list : {true, false}) {
        UnshownSlaves plant;
        plant.listed = has_list;
        plant.build();
        plant.ctx->slave(3).config.highest = AlState::preop;
        ASSERT_TRUE(config_map(*plant.ctx, plant.image).ok());
        plant.be_steady();
        plant.exchange_slave_3(AlState::preop);
        plant.run(2000);
        plant.expect_found();
    }
}

TEST_F(UnshownSlaves, ASlaveOfASlowGroupIsCompared) {
    build();
    split();
    be_steady();
    run(1500);
    exchange_slave_3(AlState::op);
    run(2000);
    expect_found();
}

TEST_F(UnshownSlaves, ASlaveOfAGroupThatIsNotExchangedIsCompared) {
    build();
    split();
    group_1 = false;
    ASSERT_TRUE(writestate(*ctx, 3, AlState::safeop).ok());
    be_steady();
    exchange_slave_3(AlState::safeop);
    run(2000);
    expect_found();
}

TEST_F(UnshownSlaves, TheSameSlavesAreNotRefused) {
    build();
    split();
    be_steady();
    for (int n = 0; n < 4; ++n) {
        run(1500);
        ASSERT_TRUE(readstate(*ctx).ok());
        EXPECT_TRUE(write_register(*ctx, 3, kUserMemory, kMark).ok());
    }
}

// The number of lost cycles is smaller than the number that shows a silence of fast cycles.
struct SlowCycles : Silence {
    Error slow_cycle(Duration period) {
        write_outputs();
        (void)send_processdata(*ctx);
        const auto received = receive_processdata(*ctx, 1ms);
        idle(period);
        segment.advance(osal.now());
        return received.error();
    }
};

TEST_F(SlowCycles, ThatAreLostForHalfASecondMayHideAnExchange) {
    for (const auto& [period, lost] : {std::pair{100ms, 5}, std::pair{200ms, 9}, std::pair{500ms, 5}}) {
        SlowCycles plant;
        plant.build();
        for (const auto device : plant.line) plant.set(device, 0x0420, 0);
        for (int n = 0; n < 10; ++n) (void)plant.slow_cycle(period);
        ASSERT_TRUE(readstate(*plant.ctx).ok());
        plant.make_like_slave_2(plant.tool, AlState::op);
        plant.set(plant.tool, 0x0420, 0);
        for (int n = 0; n < 10; ++n) (void)plant.slow_cycle(period);
        plant.begin_silence();
        plant.exchange();
        for (int n = 0; n < lost; ++n) EXPECT_EQ(plant.slow_cycle(period).code, Errc::no_frame);
        plant.end_silence();
        for (int n = 0; n < 5; ++n) (void)plant.slow_cycle(period);
        EXPECT_FALSE(readstate(*plant.ctx).ok()) << lost << " cycles of " << period.count() << " ms";
        EXPECT_FALSE(write_register(*plant.ctx, 2, kUserMemory, kMark).ok());
        EXPECT_NE(plant.slow_cycle(period).code, Errc::none);
        EXPECT_FALSE(inputs_fresh(*plant.ctx, 2));
    }
}

}  // namespace
}  // namespace margay
