// Compares the found slaves with the expected slaves.
#include "process_data/plant.hpp"

#include <margay/supervision.hpp>

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
        const auto found = config_init(ctx());
        const auto all = bus.errors();
        EXPECT_EQ(found.ok(), all.empty());
        return all;
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
    const ExpectedSlave expected[] = {
        {.number = 1, .vendor = 0x4D47, .product = 0x100}, {.number = 2, .config = &config}, {.number = 3}};
    EXPECT_EQ(scan(expected), Words());
    EXPECT_EQ(*config_map(ctx(), image, 1), 4U);
    EXPECT_EQ(bus.errors(), Words());
    EXPECT_EQ(ctx().slave(2).al.state, AlState::safeop);
    EXPECT_EQ(ctx().slave(1).al.state, AlState::preop);
}

TEST_F(ExpectationTest, WhatIsNotIsNamedAndTheOthersGoOn) {
    const ExpectedSlave expected[] = {
        {.number = 1, .product = 0x101}, {.number = 2, .vendor = 0x4D47, .serial = 7}, {.number = 4}};
    EXPECT_EQ(scan(expected),
              (Words{"slave 1: comparing with what is expected: another slave than expected (expected "
                     "product 0x00000101, got 0x00000100 of vendor 0x00004d47)",
                     "slave 2: comparing with what is expected: another slave than expected (expected "
                     "serial number 0x00000007, got 0x00000000 of vendor 0x00004d47)",
                     "slave 3: comparing with what is expected: the slave is not in the list of expected slaves",
                     "slave 4: comparing with what is expected: the slave is missing"}));
    EXPECT_EQ(config_map(ctx(), image).error().slave, 1);
    EXPECT_EQ(writestate(ctx(), 0, AlState::op).error().slave, 1);
    for (std::size_t n = 1; n <= 3; ++n)
        EXPECT_EQ(ctx().slave(n).al.state, AlState::init) << "held: they have no mailbox";
    // The application decides to continue.
    ASSERT_TRUE(tolerate(ctx(), {.other_slaves = true, .unexpected_slaves = true, .missing_slaves = true}));
    ASSERT_TRUE(config_map(ctx(), image).ok());
    (void)bus.to_op();
    for (std::size_t n = 1; n <= 3; ++n) EXPECT_EQ(ctx().slave(n).al.state, AlState::op);
    EXPECT_EQ(*bus.cycle(), 9U);
}

// No value that was read shows that the device is another slave.
TEST_F(ExpectationTest, AnIdentityThatCouldNotBeReadIsNotCalledAnother) {
    bus.segment.slave(1).sii().fail_next(100'000);
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x100}, {.number = 3}};
    const Words told = scan(expected);
    ASSERT_FALSE(told.empty());
    for (const auto& text : told) EXPECT_EQ(text.find("another slave"), std::string::npos) << text;
    EXPECT_EQ(ctx().slave(2).error.code, Errc::sii_nack);
    const auto mapped = config_map(ctx(), image);
    EXPECT_EQ(mapped.error().slave, 2) << "it gets no outputs";
    EXPECT_EQ(mapped.error().code, Errc::sii_nack) << "the cause, and not that a place is missing";
    for (const auto& text : bus.errors()) EXPECT_EQ(text.find("no place"), std::string::npos) << text;
}

// Slave 2 cannot be read by the scan.
class UnreadExpected : public ExpectationTest {
  protected:
    const ExpectedSlave expected[3] = {{.number = 1}, {.number = 2, .product = 0x100}, {.number = 3}};
    SuperviseRequest supervision;
    void scan_in_vain() {
        bus.segment.slave(1).sii().fail_next(100'000);
        ASSERT_FALSE(scan(expected).empty());
        ASSERT_TRUE(ctx().slave(2).held);
    }
    void expect_op() {
        ASSERT_TRUE(config_map(ctx(), image).ok());
        EXPECT_FALSE(ctx().slave(2).held);
        EXPECT_TRUE(reach(ctx(), AlState::op, std::chrono::seconds(2)).ok());
        EXPECT_EQ(ctx().slave(2).al.state, AlState::op);
        EXPECT_TRUE(all_right(ctx()));
    }
};

TEST_F(UnreadExpected, IsReadByTheNextMapping) {
    scan_in_vain();
    bus.segment.slave(1).sii().fail_next(0);
    expect_op();
}

TEST_F(UnreadExpected, IsReadByTheSupervision) {
    scan_in_vain();
    ASSERT_FALSE(config_map(ctx(), image).ok());
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    EXPECT_EQ(reach(ctx(), AlState::op, std::chrono::seconds(1)).error().code, Errc::sii_nack);
    EXPECT_TRUE(ctx().slave(2).held);
    const auto outputs = bus.device(2).outputs();
    EXPECT_TRUE(outputs.empty() || outputs[0] == std::byte{0});
    bus.segment.slave(1).sii().fail_next(0);
    EXPECT_EQ(reach(ctx(), AlState::op, std::chrono::seconds(2)).error().code, Errc::no_place) << "and is asked to map";
    expect_op();
}

// There is no moment without the error, also while the slave is read again.
TEST_F(UnreadExpected, IsNeverWithoutAnErrorUntilItIsRead) {
    scan_in_vain();
    unsigned silent = 0;
    unsigned polls = 0;
    const auto go_while = [&](auto holds) {
        for (int n = 0; n < 20'000 && holds(); ++n, ++polls) {
            bus.osal.advance(std::chrono::microseconds(50));
            (void)poll(ctx(), bus.osal.now());
            silent += ctx().slave(2).error.code == Errc::none ? 1 : 0;
        }
    };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(ctx(), map).ok());
    go_while([&] { return map.busy(); });
    EXPECT_EQ(map.error().code, Errc::sii_nack);
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    go_while([] { return true; });
    EXPECT_EQ(silent, 0U) << "of " << polls;
    bus.segment.slave(1).sii().fail_next(0);
    go_while([&] { return !ctx().slave(2).seen; });
    EXPECT_TRUE(ctx().slave(2).seen) << "the supervision reads it again";
}

TEST_F(UnreadExpected, IsAnotherOneIfItsEepromSaysSo) {
    const ExpectedSlave other[] = {{.number = 1}, {.number = 2, .product = 0x999}, {.number = 3}};
    bus.segment.slave(1).sii().fail_next(100'000);
    ASSERT_FALSE(scan(other).empty());
    bus.segment.slave(1).sii().fail_next(0);
    EXPECT_EQ(config_map(ctx(), image).error().code, Errc::other_slave);
    EXPECT_TRUE(ctx().slave(2).held);
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    EXPECT_EQ(reach(ctx(), AlState::op, std::chrono::seconds(2)).error().code, Errc::other_slave);
    EXPECT_EQ(ctx().slave(2).al.state, AlState::init);
}

// The configuration reserves the places, so no other mapping is needed.
TEST_F(UnreadExpected, WithAPlaceGoesToOpWithoutAnotherMapping) {
    SlaveConfiguration config;
    config.source = ConfigurationSource::application;
    config.add({0, Direction::outputs, 0x64, 0x1100, 16});
    config.add({1, Direction::inputs, 0x20, 0x2000, 16});
    const ExpectedSlave placed[] = {{.number = 1}, {.number = 2, .product = 0x100, .config = &config}, {.number = 3}};
    bus.segment.slave(1).sii().fail_next(100'000);
    ASSERT_FALSE(scan(placed).empty());
    ASSERT_FALSE(config_map(ctx(), image).ok());
    bus.segment.slave(1).sii().fail_next(0);
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    EXPECT_TRUE(reach(ctx(), AlState::op, std::chrono::seconds(3)).ok());
    EXPECT_EQ(ctx().slave(2).al.state, AlState::op);
}

TEST_F(ExpectationTest, AliasFindsItWhereverItIs) {
    bus.segment.slave(1).registers().set<std::uint16_t>(0x0012, 0x0321);
    SlaveConfiguration config;
    config.block_lrw = true;
    const ExpectedSlave expected[] = {
        {.number = 1}, {.alias = std::uint16_t{0x0321}, .config = &config}, {.number = 2}};
    EXPECT_EQ(scan(expected), Words());
    EXPECT_TRUE(ctx().slave(3).config.block_lrw) << "behind the line, whose numbers do not count it";
    EXPECT_EQ(ctx().slave(3).ring_position, 2);
    EXPECT_EQ(ctx().slave(3).parent, 1);
    EXPECT_EQ(ctx().slave(2).parent, 3) << "the tree is told in the same numbers";
    EXPECT_EQ(bus.segment.slave(1).station(), 0x1003);
    EXPECT_EQ(bus.segment.slave(2).station(), 0x1002);
    const ExpectedSlave other[] = {{.number = 1}, {.number = 2}, {.alias = std::uint16_t{0x0999}}, {.number = 3}};
    EXPECT_EQ(scan(other), (Words{"slave 4: comparing with what is expected: the slave is missing (alias 0x0999)"}));
}

TEST_F(ExpectationTest, OptionalOnesMayBeMissingAndLeave) {
    const ExpectedSlave expected[] = {
        {.number = 1}, {.number = 2}, {.number = 3, .optional = true}, {.number = 4, .optional = true}};
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

// The list declares the slave optional, whatever the application writes into the configuration of the slave.
TEST_F(ExpectationTest, OptionalOnesStaySoWhenTheApplicationConfiguresThem) {
    const ExpectedSlave expected[] = {
        {.number = 1}, {.number = 2}, {.number = 3}, {.number = 4, .optional = true}, {.alias = 9, .hot_connect = 1}};
    EXPECT_EQ(scan(expected), Words());
    SlaveConfiguration configuration{.source = ConfigurationSource::application};
    ASSERT_TRUE(
        configuration.add({.number = 2, .direction = Direction::outputs, .control = 0x64, .start = 0x1000, .bits = 8}));
    ctx().slave(4).config = configuration;
    ctx().slave(5).config = configuration;
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_TRUE(reach(ctx(), AlState::op, std::chrono::seconds(3)).ok());
    EXPECT_EQ(ctx().group(0).expected_wkc, 9U);
    for (int n = 0; n < 5; ++n) EXPECT_TRUE(bus.cycle().ok());
}

// ------------------------------------------------------------------ explicit device id

class DeviceIdTest : public testing::Test, protected Plant {
  protected:
    static constexpr std::uint8_t kByAlStatus = wire::sii::general_flag::kIdentAlStatus;
    static constexpr std::uint8_t kByMemory = wire::sii::general_flag::kIdentMemory;
    std::uint32_t first = make({});
    std::uint32_t by_status = make({.flags = kByAlStatus});
    std::uint32_t by_memory = make({.flags = kByMemory, .identification_address = 0x0F18});
    void SetUp() override {
        ASSERT_TRUE(segment.connect_master({first, 0}));
        ASSERT_TRUE(segment.connect({first, 1}, {by_status, 0}));
        ASSERT_TRUE(segment.connect({by_status, 1}, {by_memory, 0}));
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ctx = std::make_unique<HostContext>(Limits{.slaves = 32});
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        program(by_status).set_device_id(0x0234);
        segment.slave(by_memory).registers().set<std::uint16_t>(0x0F18, 0x0055);
    }
};

TEST_F(DeviceIdTest, IsReadTheWayTheSiiSays) {
    const ExpectedSlave expected[] = {
        {.number = 1}, {.device_id = std::uint16_t{0x0055}}, {.device_id = std::uint16_t{0x0234}}};
    EXPECT_EQ(bring_up(expected), Words());
    EXPECT_EQ(ctx->slave(2).ring_position, 3);
    EXPECT_EQ(ctx->slave(2).device_id, 0x0055);
    EXPECT_EQ(ctx->slave(3).ring_position, 2);
    EXPECT_EQ(ctx->slave(3).device_id, 0x0234);
    EXPECT_FALSE(ctx->slave(1).device_id.has_value());
    run();
    EXPECT_EQ(segment.slave(by_status).registers().get<std::uint16_t>(0x0130), 0x0008)
        << "the request is over: the status is a status again";
    EXPECT_EQ(segment.slave(by_status).registers().get<std::uint16_t>(0x0134), 0x0000);
}

TEST_F(DeviceIdTest, NobodyIsAskedWhoNeedNotBe) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3}};
    EXPECT_EQ(bring_up(expected), Words());
    EXPECT_FALSE(ctx->slave(2).device_id.has_value());
}

TEST_F(DeviceIdTest, IsComparedAtItsPosition) {
    const ExpectedSlave expected[] = {{.number = 1, .device_id = std::uint16_t{1}},
                                      {.number = 2, .device_id = std::uint16_t{0x0235}},
                                      {.number = 3, .device_id = std::uint16_t{0x0055}},
                                      {.device_id = std::uint16_t{0x0777}}};
    EXPECT_EQ(
        bring_up(expected),
        (Words{
            "slave 1: comparing with what is expected: not supported by the slave (an explicit device id)",
            "slave 2: comparing with what is expected: another slave than expected (expected device id 0x00000235, got "
            "0x00000234 of vendor 0x00004d47)",
            "slave 4: comparing with what is expected: the slave is missing (device id 0x0777)"}));
}

// A slave without a program copies AL control to AL status. The copy of the request is not an answer.
TEST_F(DeviceIdTest, AMirrorHasNoId) {
    const auto mirror = make({.emulation = true});
    plug({by_memory, 1}, mirror);
    power(mirror, true);
    const ExpectedSlave expected[] = {
        {.number = 1}, {.number = 2}, {.number = 3}, {.number = 4, .device_id = std::uint16_t{0}}};
    (void)bring_up(expected);
    EXPECT_TRUE(ctx->slave(4).device_emulation);
    EXPECT_FALSE(ctx->slave(4).device_id.has_value());
    EXPECT_TRUE(ctx->slave(4).held) << "it is not known to be the one that is wanted";
    EXPECT_EQ(ctx->slave(4).al.state, AlState::init);
}

// One of two slaves returns at another place and is recognised. A slave whose ID switch was changed is not the expected
// slave.
TEST_F(DeviceIdTest, KnowsWhoComesBack) {
    const ExpectedSlave expected[] = {
        {.number = 1}, {.device_id = std::uint16_t{0x0234}, .optional = true}, {.device_id = std::uint16_t{0x0055}}};
    EXPECT_EQ(bring_up(expected), Words());
    run();
    pull(by_memory);
    pull(by_status);
    cycles(20);
    plug({first, 2}, by_status);
    plug({first, 3}, by_memory);
    for (const auto number : {by_status, by_memory}) {
        power(number, false);
        power(number, true);
    }
    segment.slave(by_memory).registers().set<std::uint16_t>(0x0F18, 0x0056);
    ASSERT_TRUE(until([&] { return in_op(2); })) << joined(events());
    cycles(1000);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::none);
    EXPECT_EQ(told(events(), "an unexpected slave"), 1);
    segment.slave(by_memory).registers().set<std::uint16_t>(0x0F18, 0x0055);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    expect_exchanged(2, by_status);
    expect_exchanged(3, by_memory);
}

TEST_F(ExpectationTest, ListsThatContradictThemselvesAreRefused) {
    const auto refused_at = [&](std::initializer_list<ExpectedSlave> list) {
        const std::vector<ExpectedSlave> all(list);
        const auto done = expect(ctx(), all);
        EXPECT_TRUE(done.ok() || done.error().code == Errc::invalid_argument);
        return done.error().actual;
    };
    const ExpectedSlave head{.alias = std::uint16_t{5}, .hot_connect = 1};
    EXPECT_EQ(refused_at({{.number = 1}, {.number = 2}, {.number = 1}}), 3U) << "twice at one place";
    EXPECT_EQ(refused_at({{.hot_connect = 1}}), 1U) << "a head that nothing is known of";
    EXPECT_EQ(refused_at({head, {.number = 4, .hot_connect = 1}}), 2U) << "a member has no number";
    EXPECT_EQ(refused_at({head, {.number = 1}, head}), 3U) << "a group torn apart";
    EXPECT_EQ(refused_at({head, {.hot_connect = 1}, {.number = 1}}), 0U);
    EXPECT_EQ(refused_at({{.number = 1, .station_address = 7}, {.number = 2}, {.number = 3, .station_address = 7}}),
              3U);
    EXPECT_EQ(refused_at({{.number = 1, .station_address = 0x0FFF}}), 1U) << "an address of unknown slaves";
    EXPECT_EQ(refused_at({{.number = 1, .station_address = 0x0C00}}), 1U);
    EXPECT_EQ(refused_at({{.number = 1, .station_address = 0x0BFF}, {.number = 2, .station_address = 0x1000}}), 0U);
    // A number above the limit.
    const ExpectedSlave far[] = {{.number = 1000}};
    ASSERT_TRUE(expect(ctx(), far).ok());
    const auto scanned = config_init(ctx());
    EXPECT_EQ(scanned.error().code, Errc::capacity);
    EXPECT_EQ(scanned.error().expected, 1000U);
    EXPECT_EQ(ctx().errors().take(), scanned.error());
    EXPECT_EQ(scan({}), Words()) << "usable afterwards";
}

TEST_F(ExpectationTest, WrongCallsAreRefused) {
    HostContext fresh;
    EXPECT_EQ(expect(fresh, {}).error().code, Errc::wrong_state);
    const ExpectedSlave nowhere[] = {{.number = 1}, {}};
    const auto refused = expect(ctx(), nowhere);
    EXPECT_EQ(refused.error().code, Errc::invalid_argument);
    EXPECT_EQ(refused.error().actual, 2U);
    EXPECT_EQ(scan({}), Words()) << "whatever is there";
}

}  // namespace
}  // namespace margay
