// Equal slaves of a line come back in another order than they were lost. No slave is driven as another slave.
#include "process_data/hot_connect.hpp"

namespace margay {
namespace {

// A line of five equal devices. In every cycle each slave gets outputs that contain its number.
class EqualSlaves : public testing::Test, protected Plant {
  protected:
    std::vector<std::uint32_t> line;
    std::vector<ExpectedSlave> wanted;
    unsigned wrong = 0;  // cycles in which a device had the outputs of another slave

    std::uint32_t make_equal(std::uint32_t serial) {
        auto octets = io_image(8, 8, {.product = 0x100});
        store_le<std::uint32_t>(octets, 0x1C, serial);
        auto made = sim::device_from_sii(octets);
        made.chip = sim::junction();
        return segment.add(std::move(made).assemble());
    }
    enum class Serials { none, own, equal };
    static std::uint32_t serial_of(Serials serials, std::uint32_t n) {
        return serials == Serials::own ? 100U + n : (serials == Serials::equal ? 7U : 0U);
    }
    void build(Serials serials) {
        for (std::uint16_t n = 0; n < 5; ++n) {
            line.push_back(make_equal(serial_of(serials, n)));
            wanted.push_back({.number = static_cast<std::uint16_t>(n + 1), .product = 0x100, .optional = n == 1});
        }
        ASSERT_TRUE(segment.connect_master({line[0], 0}));
        put_second_in();
        ASSERT_TRUE(segment.connect({line[2], 1}, {line[3], 0}));
        ASSERT_TRUE(segment.connect({line[3], 1}, {line[4], 0}));
        for (ExpectedSlave& slave : wanted) slave.config = &kIo;
        EXPECT_EQ(bring_up(wanted), Sentences());
        run();
    }
    void put_second_in() {
        ASSERT_TRUE(segment.connect({line[0], 1}, {line[1], 0}));
        ASSERT_TRUE(segment.connect({line[1], 1}, {line[2], 0}));
        segment.reconsider();
    }
    void take_second_out() {
        segment.disconnect({line[1], 0});
        segment.disconnect({line[1], 1});
    }
    void bridge_second() {
        take_second_out();
        drive(300);
        ASSERT_TRUE(segment.connect({line[0], 1}, {line[2], 0}));
        segment.reconsider();
        drive(1500);
        for (const std::size_t n : {1U, 3U, 4U, 5U}) ASSERT_TRUE(in_op(n)) << n;
        (void)events();
    }
    void drive(int count) {
        while (count-- > 0) {
            for (const Slave& slave : ctx->slaves())
                std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0x80 + slave.number));
            (void)cycle();
            for (std::size_t n = 0; n < line.size(); ++n) {
                const auto outputs = program(line[n]).outputs();
                const auto own = static_cast<std::byte>(0x81 + n);
                if (!outputs.empty() && outputs[0] != std::byte{0} && outputs[0] != own) ++wrong;
            }
        }
    }
    void expect_everybody_is_itself() {
        ASSERT_TRUE(until([&] { return all_in_op() && all_right(*ctx); }, 6000)) << joined(events());
        drive(100);
        for (std::size_t n = 0; n < line.size(); ++n) {
            EXPECT_TRUE(in_op(n + 1)) << n + 1;
            EXPECT_EQ(program(line[n]).outputs()[0], static_cast<std::byte>(0x81 + n)) << n + 1;
        }
        EXPECT_EQ(wrong, 0U);
    }
};

// Slave 2 is removed for a repair, and the other slaves continue without it. Slave 3 loses its power for a moment. Now
// the device behind slave 1 may be slave 2 as well as slave 3.
TEST_F(EqualSlaves, BesideABridgedOneNobodyIsGuessed) {
    build(Serials::none);
    bridge_second();
    power(line[2], false);
    drive(300);
    power(line[2], true);
    drive(3000);
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::none);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::none);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 3);
    const auto story = events();
    EXPECT_EQ(told(story, "a device at slave 1 port 1 may be slave 2 or slave 3, which are equal and lost"), 1)
        << joined(story);
    EXPECT_EQ(told(story, "an unexpected slave"), 0) << joined(story);
    // When slave 2 is back, both slaves are identified.
    segment.disconnect({line[2], 0});
    put_second_in();
    power(line[1], false);
    power(line[1], true);
    expect_everybody_is_itself();
}

TEST_F(EqualSlaves, BesideABridgedOneASerialNumberDecides) {
    build(Serials::own);
    bridge_second();
    power(line[2], false);
    drive(300);
    power(line[2], true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    drive(100);
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(program(line[2]).outputs()[0], std::byte{0x83});
}

TEST_F(EqualSlaves, AllLoseTheirPowerBesideABridgedOne) {
    build(Serials::own);
    bridge_second();
    for (const auto device : line) power(device, false);
    drive(300);
    for (const auto device : line) power(device, true);
    ASSERT_TRUE(until([&] { return in_op(1) && in_op(3) && in_op(4) && in_op(5); }, 6000)) << joined(events());
    drive(100);
    EXPECT_EQ(wrong, 0U);
}
TEST_F(EqualSlaves, AllWithoutSerialNumbersLoseTheirPowerBesideABridgedOne) {
    build(Serials::none);
    bridge_second();
    for (const auto device : line) power(device, false);
    drive(300);
    for (const auto device : line) power(device, true);
    drive(4000);
    EXPECT_EQ(wrong, 0U);
    EXPECT_TRUE(in_op(1));
    EXPECT_FALSE(in_op(3));
    EXPECT_FALSE(all_right(*ctx));
    EXPECT_EQ(told(events(), "may be slave 2 or slave 3"), 1);
}

// The slaves boot one after the other, from the end of the line and from its beginning.
TEST_F(EqualSlaves, ThatBootInAnyOrderAreThemselves) {
    build(Serials::none);
    for (const bool backwards : {true, false}) {
        for (const auto device : line) power(device, false);
        drive(300);
        for (std::size_t n = 0; n < line.size(); ++n) {
            power(line[backwards ? line.size() - 1 - n : n], true);
            drive(1200);
        }
        expect_everybody_is_itself();
    }
}

// The bridged slave is connected again while the slaves behind it have no power. All of them appear at the same time,
// and all are identified.
TEST_F(EqualSlaves, ThatComeWithTheBridgedOneAreInTheirOrder) {
    build(Serials::none);
    bridge_second();
    for (std::size_t n = 1; n < line.size(); ++n) power(line[n], false);
    drive(300);
    segment.disconnect({line[2], 0});
    put_second_in();
    for (std::size_t n = 1; n < line.size(); ++n) power(line[n], true);
    expect_everybody_is_itself();
}

// A line of four slaves. Slave 2 is optional and was never present. Slave 4 is of the same kind as slave 2.
class NeverThere : public testing::Test, protected Plant {
  protected:
    std::uint32_t coupler = 0;
    std::uint32_t third = 0;
    std::uint32_t fourth = 0;
    std::uint32_t other = 0;  // of the kind of slaves 2 and 4, not connected
    std::array<ExpectedSlave, 4> wanted{ExpectedSlave{.number = 1, .product = 0x100},
                                        {.number = 2, .product = 0x101, .optional = true, .config = &kIo},
                                        {.number = 3, .product = 0x102},
                                        {.number = 4, .product = 0x101}};

    void build(std::uint16_t alias) {
        coupler = make({.product = 0x100});
        third = make({.product = 0x102});
        fourth = make({.product = 0x101});
        other = make({.product = 0x101, .alias = alias});
        if (alias != 0) wanted[1].alias = alias;
        ASSERT_TRUE(segment.connect_master({coupler, 0}));
        plug({coupler, 1}, third);
        plug({third, 1}, fourth);
        EXPECT_EQ(bring_up(wanted), Sentences());
        run();
    }
    // Slave 3 is removed for a repair, and slave 4 continues at the coupler.
    void bridge_third() {
        segment.disconnect({third, 0});
        segment.disconnect({third, 1});
        cycles(300);
        plug({coupler, 1}, fourth);
        segment.reconsider();
        ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
        cycles(1500);
        (void)events();
    }
    void replace_fourth_by(std::uint32_t device) {
        segment.disconnect({fourth, 0});
        power(fourth, false);
        cycles(300);
        power(device, true);
        plug({coupler, 1}, device);
        segment.reconsider();
    }
    // Writes outputs with the numbers of the slaves. Returns whether the device had the outputs of slave 4.
    bool gets_outputs_of_slave_4(std::uint32_t device, int count) {
        bool any = false;
        for (int n = 0; n < count; ++n) {
            for (const Slave& slave : ctx->slaves())
                std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0x80 + slave.number));
            (void)cycle();
            const auto outputs = program(device).outputs();
            any |= !outputs.empty() && outputs[0] == std::byte{0x84};
        }
        return any;
    }
};

// The device at the coupler may be slave 2, which comes for the first time, or slave 4. A scan would identify it as
// slave 2.
TEST_F(NeverThere, AnOptionalSlaveIsARivalWhereItBelongs) {
    build(0);
    bridge_third();
    replace_fourth_by(other);
    EXPECT_FALSE(gets_outputs_of_slave_4(other, 3000));
    EXPECT_EQ(ctx->slave(4).al.state, AlState::none);
    const auto story = events();
    EXPECT_EQ(told(story, "a device at slave 1 port 1 may be slave 2 or slave 4, which are equal and lost"), 1)
        << joined(story);
}

// The list gives slave 2 its alias, and no entry has the alias of slave 4.
TEST_F(NeverThere, AnOptionalSlaveIsKnownByTheNumberThatTheListGivesIt) {
    build(5);
    bridge_third();
    replace_fourth_by(other);
    EXPECT_FALSE(gets_outputs_of_slave_4(other, 1000));
    EXPECT_TRUE(in_op(2)) << joined(events());
    EXPECT_EQ(ctx->slave(4).al.state, AlState::none);
    EXPECT_EQ(program(other).outputs()[0], std::byte{0x82});
}

// The place of slave 2 is not behind slave 3, so slave 4 comes back as usual.
TEST_F(NeverThere, AnOptionalSlaveIsNoRivalElsewhere) {
    build(0);
    for (const bool all : {false, true}) {
        power(fourth, false);
        if (all) power(third, false);
        cycles(300);
        power(fourth, true);
        power(third, true);
        ASSERT_TRUE(until([&] { return all_in_op() && all_right(*ctx); }, 6000)) << joined(events());
        EXPECT_TRUE(in_op(4));
    }
}

// All devices may have the same serial number in their SII. Then the serial number identifies no device: a new device
// at another place is not the lost slave.
TEST_F(EqualSlaves, ANewDeviceElsewhereIsNotTheLostOneByACommonSerialNumber) {
    build(Serials::equal);
    power(line[4], false);
    drive(500);
    ASSERT_FALSE(in_op(5));
    const auto fresh = make_equal(serial_of(Serials::equal, 0));
    power(fresh, true);
    ASSERT_TRUE(segment.connect({line[0], 3}, {fresh, 0}));
    segment.reconsider();
    (void)events();
    drive(4000);
    const auto outputs = program(fresh).outputs();
    EXPECT_TRUE(outputs.empty() || outputs[0] == std::byte{0});
    EXPECT_FALSE(in_op(5));
    EXPECT_NE(joined(events()).find("is connected to slave 1 port 3"), std::string::npos);
}

// A device was reported as unexpected while slave 5 was present. When slave 5 is lost, this device is not slave 5, also
// if it has the serial number of slave 5.
TEST_F(EqualSlaves, AnUnexpectedDeviceIsNotTheLostOneByItsSerialNumber) {
    build(Serials::own);
    const auto fresh = make_equal(serial_of(Serials::own, 4));
    power(fresh, true);
    ASSERT_TRUE(segment.connect({line[0], 3}, {fresh, 0}));
    segment.reconsider();
    drive(2000);
    ASSERT_NE(joined(events()).find("is connected to slave 1 port 3"), std::string::npos);
    power(line[4], false);
    drive(3000);
    const auto outputs = program(fresh).outputs();
    EXPECT_TRUE(outputs.empty() || outputs[0] == std::byte{0});
    EXPECT_FALSE(in_op(5));
    power(line[4], true);
    expect_everybody_is_itself();
    EXPECT_EQ(wrong, 0U);
}

// A unique serial number identifies a slave, also at another place.
TEST_F(EqualSlaves, ASlaveThatWasMovedIsKnownByItsSerialNumber) {
    build(Serials::own);
    power(line[4], false);
    drive(500);
    segment.disconnect({line[4], 0});
    ASSERT_TRUE(segment.connect({line[0], 3}, {line[4], 0}));
    power(line[4], true);
    segment.reconsider();
    expect_everybody_is_itself();
    EXPECT_EQ(wrong, 0U);
}

}  // namespace
}  // namespace margay
