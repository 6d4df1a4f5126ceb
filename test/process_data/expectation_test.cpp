// Slaves as they are found against slaves as they are expected.
#include "process_data/bus.hpp"

namespace margay {
namespace {

using Words = std::vector<std::string>;

class ExpectationTest : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(256);
    HostContext& ctx() { return *bus.ctx; }
    Words scan(std::span<const ExpectedSlave> expected) {
        EXPECT_TRUE(expect(ctx(), expected).ok());
        EXPECT_TRUE(config_init(ctx()).ok());
        return bus.errors();
    }
    void SetUp() override {
        for (int n = 0; n < 3; ++n) bus.add(16, 16);
        bus.start();
    }
};

TEST_F(ExpectationTest, WhatIsAsExpectedIsConfiguredAsWanted) {
    SlaveConfiguration config;
    config.source = ConfigurationSource::application;
    config.add({0, Direction::outputs, 0x64, 0x1100, 16});
    config.add({1, Direction::inputs, 0x20, 0x2000, 16});
    config.group = 1;
    const ExpectedSlave expected[] = {{.position = 1, .vendor = 0x4D47, .product = 0x100}, {.position = 2, .config = &config}, {.position = 3}};
    EXPECT_EQ(scan(expected), Words());
    EXPECT_EQ(*config_map(ctx(), image, 1), 4U);
    EXPECT_EQ(bus.errors(), Words());
    EXPECT_EQ(ctx().slave(2).al.state, AlState::safeop);
    EXPECT_EQ(ctx().slave(1).al.state, AlState::preop);
}

TEST_F(ExpectationTest, WhatIsNotIsNamedAndTheOthersGoOn) {
    const ExpectedSlave expected[] = {{.position = 1, .product = 0x101}, {.position = 2, .vendor = 0x4D47, .serial = 7}, {.position = 4}};
    EXPECT_EQ(scan(expected),
              (Words{"slave 1: comparing with what is expected: another slave than expected (expected product 0x00000101, got 0x00000100 of vendor "
                     "0x00004d47)",
                     "slave 2: comparing with what is expected: another slave than expected (expected serial number 0x00000007, got 0x00000000 of "
                     "vendor 0x00004d47)",
                     "slave 4: comparing with what is expected: an expected slave is missing",
                     "slave 3: comparing with what is expected: nobody expects this slave"}));
    EXPECT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(bus.to_op().state, AlState::op) << "told, not refused: the application decides";
}

TEST_F(ExpectationTest, AliasFindsItWhereverItIs) {
    bus.segment.slave(1).registers().set<std::uint16_t>(0x0012, 0x0321);
    SlaveConfiguration config;
    config.block_lrw = true;
    const ExpectedSlave expected[] = {{.position = 1}, {.alias = std::uint16_t{0x0321}, .config = &config}, {.position = 3}};
    EXPECT_EQ(scan(expected), Words());
    EXPECT_TRUE(ctx().slave(2).config.block_lrw);
    const ExpectedSlave other[] = {{.position = 1}, {.position = 2}, {.alias = std::uint16_t{0x0999}}, {.position = 3}};
    EXPECT_EQ(scan(other), (Words{"comparing with what is expected: an expected slave is missing (alias 0x0999)"}));
}

TEST_F(ExpectationTest, OptionalOnesMayBeMissingAndLeave) {
    const ExpectedSlave expected[] = {{.position = 1}, {.position = 2}, {.position = 3, .optional = true}, {.position = 4, .optional = true}};
    EXPECT_EQ(scan(expected), Words());
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    for (int n = 0; n < 5; ++n) ASSERT_TRUE(bus.cycle().ok());
    bus.segment.set_power(2, false, bus.osal.now());
    for (int n = 0; n < 5; ++n) (void)bus.cycle();
    const auto without = bus.cycle();
    ASSERT_TRUE(without.ok()) << "the group is right without it";
    EXPECT_EQ(*without, 6U);
    EXPECT_EQ(ctx().group(0).expected_wkc, 6U);
    bus.segment.set_power(2, true, bus.osal.now());
    for (int n = 0; n < 500 && ctx().slave(3).al.state != AlState::op; ++n) (void)bus.cycle();
    EXPECT_EQ(*bus.cycle(), 9U) << "and with it";
}

TEST_F(ExpectationTest, WrongCallsAreRefused) {
    HostContext fresh;
    EXPECT_EQ(expect(fresh, {}).error().code, Errc::wrong_state);
    const ExpectedSlave nowhere[] = {{.position = 1}, {}};
    const auto refused = expect(ctx(), nowhere);
    EXPECT_EQ(refused.error().code, Errc::invalid_argument);
    EXPECT_EQ(refused.error().actual, 2U);
    EXPECT_EQ(scan({}), Words()) << "whatever is there";
}

}  // namespace
}  // namespace margay
