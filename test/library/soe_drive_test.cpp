// The SoE drive, used as a master uses it: parameters, control and status words, procedure commands. IEC 61800-7-204.
#include "hand.hpp"

#include "wire/soe.hpp"

#include <cstdlib>

namespace margay::sim::test {
namespace {

using Octets = std::vector<std::byte>;
namespace soe = wire::soe;

constexpr std::int32_t kTurn = 1 << 20;

class SoeDriveTest : public testing::Test {
  protected:
    Hand hand{"soe_drive"};

    Octets octets(std::initializer_list<unsigned> values) {
        Octets out;
        for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
        return out;
    }
    Octets ask(soe::Opcode opcode, unsigned axis, Idn idn, unsigned element, const Octets& data = {}) {
        Octets message(soe::kHeaderBytes);
        soe::store_header(message, {.opcode = opcode,
                                    .drive = static_cast<std::uint8_t>(axis),
                                    .elements = static_cast<std::uint8_t>(element),
                                    .number = idn.value});
        message.insert(message.end(), data.begin(), data.end());
        EXPECT_TRUE(hand.put(wire::MailboxType::soe, message));
        Octets reply = next();
        for (; !reply.empty() && (reply[0] & std::byte{7}) > std::byte{4}; reply = next()) told.push_back(reply);
        if (reply.size() < soe::kHeaderBytes) return ADD_FAILURE() << "no reply", Octets{};
        const auto header = soe::load_header(reply);
        EXPECT_EQ(header.idn(), idn);
        EXPECT_FALSE(header.incomplete);
        reply.erase(reply.begin(), reply.begin() + soe::kHeaderBytes);
        last = header.error ? load_le<soe::ErrorCode>(reply) : soe::ErrorCode::none;
        return header.error ? Octets{} : reply;
    }
    Octets read(unsigned axis, unsigned number, unsigned element = soe_element::kValue) {
        return ask(soe::Opcode::read_request, axis, Idn::standard(number), element);
    }
    std::int64_t number(unsigned axis, unsigned idn) {
        const Octets value = read(axis, idn);
        if (value.size() == 2) return load_le<std::int16_t>(value);
        return value.size() == 4 ? load_le<std::int32_t>(value) : INT64_MIN;
    }
    std::string message(unsigned axis) {
        const Octets list = read(axis, 95);
        std::string out;
        for (std::size_t n = 4; n < list.size(); ++n) out += static_cast<char>(list[n]);
        return out;
    }
    soe::ErrorCode write(unsigned axis, unsigned idn, const Octets& value) {
        (void)ask(soe::Opcode::write_request, axis, Idn::standard(idn), soe_element::kValue, value);
        return last;
    }
    // Default telegram: control word and position command; status word, position, velocity.
    void control(unsigned axis, unsigned word) { hand.out<std::uint16_t>(6 * axis, static_cast<std::uint16_t>(word)); }
    void target(unsigned axis, std::int32_t position) { hand.out<std::int32_t>(6 * axis + 2, position); }
    unsigned status(unsigned axis) { return hand.in<std::uint16_t>(10 * axis); }
    std::int32_t position(unsigned axis) { return hand.in<std::int32_t>(10 * axis + 2); }
    std::int32_t velocity(unsigned axis) { return hand.in<std::int32_t>(10 * axis + 6); }
    void enable(unsigned axis) {
        target(axis, position(axis));
        control(axis, 0xE000);
        hand.cycle(3);
        ASSERT_EQ(status(axis) & 0xC008, 0xC008U);
    }
    // A straight line of set points.
    void move(unsigned axis, std::int32_t by, int cycles) {
        const std::int32_t from = position(axis);
        for (int n = 1; n <= cycles; ++n) {
            target(axis, from + static_cast<std::int32_t>(std::int64_t{by} * n / cycles));
            hand.cycle();
        }
    }
    Octets next(Duration patience = 1s) {
        const auto mail = hand.take(patience);
        return mail ? mail->data : Octets{};
    }
    soe::ErrorCode last{};
    std::vector<Octets> told;  // notifications and emergencies
};

TEST_F(SoeDriveTest, TellsWhatItIs) {
    hand.to(AlState::preop);
    EXPECT_EQ(read(0, 15), octets({7, 0}));
    EXPECT_EQ(read(1, 16), octets({4, 0, 8, 0, 51, 0, 40, 0}));
    EXPECT_EQ(read(1, 24), octets({2, 0, 8, 0, 47, 0}));
    EXPECT_EQ(read(0, 25), octets({4, 0, 4, 0, 99, 0, 148, 0}));
    EXPECT_EQ(read(0, 188), octets({8, 0, 8, 0, 36, 0, 47, 0, 80, 0, 134, 0}));
    EXPECT_EQ(read(0, 51, soe_element::kUnit), octets({3, 0, 3, 0, 'i', 'n', 'c'}));
    (void)read(2, 15);
    EXPECT_EQ(last, soe::ErrorCode::invalid_drive);
    EXPECT_EQ(write(0, 24, octets({2, 0, 0, 0, 51, 0})), soe::ErrorCode::value_invalid);
    EXPECT_EQ(message(0), "ready");
    // A CoE request: the device has no CoE.
    Octets sdo(wire::coe::kSdoBytes);
    wire::coe::store_header(sdo, {0, wire::coe::Service::sdo_request});
    ASSERT_TRUE(hand.put(wire::MailboxType::coe, sdo));
    EXPECT_EQ(hand.take()->header.type, wire::MailboxType::error);
}

TEST_F(SoeDriveTest, FollowsPositionsOnBothAxes) {
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.cycle(2);
    EXPECT_EQ(status(0) & 0xC000, 0x8000U);  // power on, no torque
    EXPECT_EQ(position(1) - position(0), kTurn);
    const std::int32_t from = position(0);
    enable(0);
    move(0, 2 * kTurn, 200);
    hand.cycle(50);
    EXPECT_NEAR(position(0), from + 2 * kTurn, kTurn / 1000);
    EXPECT_EQ(status(1) & 0xC000, 0x8000U);
    EXPECT_EQ(position(1) - from, kTurn);  // the other axis does not move
    hand.keep_cycling = true;
    EXPECT_EQ(write(0, 47, octets({1, 0, 0, 0})), soe::ErrorCode::value_cyclic);
    EXPECT_EQ(write(0, 16, octets({0, 0, 0, 0})), soe::ErrorCode::value_protected);
    EXPECT_EQ(message(0), "torque on");
    // Halt (bit 13 is 0) stops the axis with a ramp. Without "drive on" (bit 15) the axis stops with a ramp, and then
    // has no torque.
    control(0, 0xC000);
    hand.cycle(20);
    EXPECT_EQ(status(0) & 0xC008, 0xC000U);
    control(0, 0x4000);
    hand.cycle(20);
    EXPECT_EQ(status(0) & 0xC000, 0x8000U);
}

TEST_F(SoeDriveTest, ModesAndTelegramsByParameters) {
    hand.to(AlState::preop);
    EXPECT_EQ(write(0, 15, octets({2, 0})), soe::ErrorCode::none);  // velocity command, velocity feedback
    EXPECT_EQ(write(0, 32, octets({2, 0})), soe::ErrorCode::none);
    EXPECT_EQ(write(1, 24, octets({2, 0, 0, 0, 80, 0})), soe::ErrorCode::none);
    EXPECT_EQ(write(1, 16, octets({4, 0, 0, 0, 84, 0, 135, 0})), soe::ErrorCode::none);
    EXPECT_EQ(write(1, 32, octets({1, 0})), soe::ErrorCode::none);
    EXPECT_EQ(write(1, 32, octets({4, 0})), soe::ErrorCode::value_too_large);
    // Axis 0 has 6 octets of outputs and 6 of inputs, axis 1 has 4 and 4. The drive refuses the lengths of the SII.
    EXPECT_EQ(hand.ask(AlState::safeop).state, AlState::preop);
}

TEST_F(SoeDriveTest, HomesAndTellsIt) {
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.keep_cycling = true;
    hand.cycle(2);
    EXPECT_EQ(write(0, 148, octets({3, 0})), soe::ErrorCode::command_not_now);  // without torque
    enable(0);
    EXPECT_EQ(write(0, 148, octets({3, 0})), soe::ErrorCode::none);
    EXPECT_EQ(read(0, 148, soe_element::kDataState), octets({7, 0}));
    EXPECT_EQ(message(0), "homing");
    EXPECT_EQ(next(3s), octets({0x05, 0x01, 148, 0, 3, 0}));  // the notification
    EXPECT_EQ(read(0, 148, soe_element::kDataState), octets({3, 0}));
    hand.cycle(100);
    EXPECT_LT(std::abs(position(0)), kTurn / 10);  // zero is the position of the index pulse
    target(0, position(0));
    hand.cycle(2);
    EXPECT_EQ(write(0, 148, octets({0, 0})), soe::ErrorCode::none);
    hand.cycle(100);
    EXPECT_EQ(status(0) & 0xE000, 0xC000U);
    EXPECT_EQ(message(0), "homed");
}

TEST_F(SoeDriveTest, FaultsAreToldAndReset) {
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.keep_cycling = true;
    hand.cycle(2);
    enable(1);
    target(1, position(1) + 10 * kTurn);  // without a ramp
    EXPECT_EQ(next(2s), octets({0x26, 0x00, 0, 0, 0x00, 0x08}));
    hand.cycle(2);
    EXPECT_EQ(number(1, 11), 0x0800);
    EXPECT_EQ(status(1) & 0x2000, 0x2000U);
    EXPECT_EQ(message(1), "excessive position deviation");
    EXPECT_EQ(number(0, 11), 0);
    control(1, 0);
    hand.cycle(200);
    EXPECT_LT(std::abs(velocity(1)), 200);
    EXPECT_EQ(write(1, 99, octets({3, 0})), soe::ErrorCode::none);
    EXPECT_EQ(number(1, 11), 0);
    EXPECT_EQ(told, (std::vector<Octets>{octets({0x25, 0x01, 99, 0, 3, 0})}));
    hand.cycle(2);
    EXPECT_EQ(status(1) & 0xE000, 0x8000U);
    enable(1);
}

TEST_F(SoeDriveTest, AMasterThatGoesAwayStopsIt) {
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.cycle(2);
    enable(0);
    hand.ask(AlState::safeop);
    EXPECT_EQ(number(0, 11), 0x1000);
    EXPECT_EQ(message(0), "communication lost");
    EXPECT_EQ(told, (std::vector<Octets>{octets({0x06, 0x00, 0, 0, 0x00, 0x10})}));
    EXPECT_EQ(number(1, 11), 0);  // the axis had no torque
}

}  // namespace
}  // namespace margay::sim::test
