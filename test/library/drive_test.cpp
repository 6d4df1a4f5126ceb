// The drive, used as a master uses it: control word, set points, status word, faults. Bits and codes: IEC 61800-7-201.
#include "hand.hpp"

#include "sim/library/drive.hpp"
#include "sim/library/stack_firmware.hpp"

#include <cmath>

namespace margay::sim::test {
namespace {

constexpr std::int32_t kTurn = 1 << 20;

class DriveTest : public testing::Test {
  protected:
    Hand hand{"drive"};

    void SetUp() override { ASSERT_EQ(hand.to(AlState::op).state, AlState::op); }
    // Outputs: control word, position, speed, torque, mode. Inputs: status word, position, speed, torque, mode, error
    // code.
    void control(unsigned word) { hand.out<std::uint16_t>(0, static_cast<std::uint16_t>(word)); }
    void target(std::int32_t position) { hand.out<std::int32_t>(2, position); }
    void speed(std::int32_t value) { hand.out<std::int32_t>(6, value); }
    void torque(int value) { hand.out<std::int16_t>(10, static_cast<std::int16_t>(value)); }
    void mode(int value) { hand.out<std::int8_t>(12, static_cast<std::int8_t>(value)); }
    unsigned status() { return hand.in<std::uint16_t>(0); }
    std::int32_t position() { return hand.in<std::int32_t>(2); }
    std::int32_t actual_speed() { return hand.in<std::int32_t>(6); }
    int actual_torque() { return hand.in<std::int16_t>(10); }
    int shown_mode() { return hand.in<std::int8_t>(12); }
    unsigned error_code() { return hand.in<std::uint16_t>(14); }
    // The bits of the state (table "State coding").
    unsigned state() { return status() & 0x6F; }

    void command(unsigned word) {
        control(word);
        hand.cycle(2);
    }
    void enable(int in_mode) {
        mode(in_mode);
        hand.cycle(2);
        target(position());
        command(0x06);
        EXPECT_EQ(state(), 0x21u);
        command(0x07);
        EXPECT_EQ(state(), 0x23u);
        command(0x0F);
        ASSERT_EQ(state(), 0x27u);
        EXPECT_EQ(shown_mode(), in_mode);
    }
    // Executes cycles until the bits of the status word are set. Returns their number, or `most`.
    unsigned until(unsigned bits, unsigned most) {
        unsigned n = 0;
        for (; n < most && (status() & bits) != bits; ++n) hand.cycle();
        return n;
    }
};

TEST_F(DriveTest, StateMachineStepByStep) {
    hand.cycle(2);
    EXPECT_EQ(status() & 0x4F, 0x40u);  // switch on disabled
    mode(8);
    target(position());
    command(0x0F);
    EXPECT_EQ(status() & 0x4F, 0x40u) << "only shutdown leads out of it";
    command(0x06);
    EXPECT_EQ(state(), 0x21u);
    command(0x07);
    EXPECT_EQ(state(), 0x23u);
    command(0x0F);
    EXPECT_EQ(state(), 0x27u);
    command(0x07);  // transition 5
    EXPECT_EQ(state(), 0x23u);
    command(0x0F);
    command(0x06);  // transition 8
    EXPECT_EQ(state(), 0x21u);
    command(0x07);
    command(0x0F);
    command(0x00);  // transition 9
    EXPECT_EQ(status() & 0x4F, 0x40u);
}

TEST_F(DriveTest, FollowsPositionsInCsp) {
    enable(8);
    const auto from = position();
    double worst = 0;
    // Two turns in a second along half a cosine wave, with a set point each millisecond.
    for (int ms = 0; ms <= 1000; ++ms) {
        const double way = 2.0 * kTurn * (1 - std::cos(3.14159265358979 * ms / 1000)) / 2;
        target(from + static_cast<std::int32_t>(way));
        hand.cycle();
        worst = std::max(worst, std::abs(from + way - position()));
    }
    hand.cycle(200);
    EXPECT_NEAR(position(), from + 2 * kTurn, 50);
    EXPECT_LT(worst, kTurn / 50) << "a few milliseconds of way at three turns a second";
    EXPECT_EQ(state(), 0x27u);
    EXPECT_EQ(status() & 0x1000, 0x1000u);  // the drive follows
}

TEST_F(DriveTest, HoldsASpeedInCsv) {
    enable(9);
    speed(10 * kTurn);
    hand.cycle(300);
    EXPECT_NEAR(actual_speed(), 10 * kTurn, kTurn / 100);
    const auto before = position();
    hand.cycle(100);
    EXPECT_NEAR(position() - before, kTurn, kTurn / 100);
    speed(0);
    hand.cycle(300);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 1000);
}

TEST_F(DriveTest, SpeedsUpByItsInertiaInCst) {
    enable(10);
    torque(100);
    hand.cycle(3);
    const auto before = actual_speed();
    hand.cycle(20);
    // A tenth of the rated torque: 480 rad/s², 76.4 turns/s², minus a little friction.
    EXPECT_NEAR(actual_speed() - before, 76.4 * 0.020 * kTurn, 0.05 * kTurn);
    EXPECT_EQ(actual_torque(), 100);
}

TEST_F(DriveTest, SpeedLimitHoldsInCst) {
    hand.download(0x6080, 0, 5 * kTurn, 4);
    enable(10);
    torque(500);
    hand.cycle(500);
    EXPECT_NEAR(actual_speed(), 5 * kTurn, kTurn / 10);
    EXPECT_EQ(status() & 0x0800, 0x0800u);  // internal limit active
}

TEST_F(DriveTest, TorqueLimitHoldsInCsv) {
    hand.download(0x6072, 0, 50, 2);
    enable(9);
    speed(50 * kTurn);
    for (int i = 0; i < 50; ++i) {
        hand.cycle();
        EXPECT_LE(std::abs(actual_torque()), 50);
    }
    EXPECT_EQ(status() & 0x0800, 0x0800u);
    EXPECT_LT(actual_speed(), 3 * kTurn);  // 38 turns/s² for 52 ms
}

TEST_F(DriveTest, ProfilePositionWithHandshake) {
    enable(1);
    const auto from = position();
    target(from + 5 * kTurn);
    control(0x1F);
    hand.cycle(2);
    EXPECT_EQ(status() & 0x1000, 0x1000u);  // set point acknowledged
    EXPECT_EQ(status() & 0x0400, 0u);       // target not reached
    control(0x0F);
    hand.cycle(2);
    EXPECT_EQ(status() & 0x1000, 0u);
    // 5 turns at 20 turns/s, with 200 turns/s² in both directions: 0.1 s and one turn each for acceleration and
    // deceleration, 0.15 s for the other three turns, 0.35 s in total.
    const auto cycles = until(0x0400, 2000);
    EXPECT_NEAR(cycles, 350, 25);
    EXPECT_NEAR(position(), from + 5 * kTurn, 1000);
}

TEST_F(DriveTest, ASecondTargetWaitsForTheFirst) {
    enable(1);
    const auto from = position();
    target(from + 2 * kTurn);
    command(0x1F);
    command(0x0F);
    target(from + kTurn);
    command(0x1F);
    command(0x0F);
    EXPECT_EQ(status() & 0x1000, 0x1000u) << "no room for a third one";
    std::int32_t farthest = from;
    for (int i = 0; i < 1500; ++i) {
        hand.cycle();
        farthest = std::max(farthest, position());
    }
    EXPECT_NEAR(farthest, from + 2 * kTurn, 5000);
    EXPECT_NEAR(position(), from + kTurn, 1000);
    EXPECT_EQ(status() & 0x1400, 0x0400u);
}

TEST_F(DriveTest, RelativeAtOnceAndHalt) {
    enable(1);
    const auto from = position();
    target(kTurn);
    command(0x5F);  // relative
    command(0x0F);
    until(0x0400, 1000);
    EXPECT_NEAR(position(), from + kTurn, 1000);
    target(10 * kTurn);
    command(0x5F);
    command(0x0F);
    hand.cycle(200);
    command(0x10F);  // halt
    hand.cycle(300);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 1000);
    const auto stopped = position();
    EXPECT_LT(stopped, from + 8 * kTurn);
    target(from);
    command(0x0F);
    command(0x3F);
    command(0x0F);
    until(0x0400, 2000);
    EXPECT_NEAR(position(), from, 1000);
}

TEST_F(DriveTest, SoftwareLimitsHoldTargets) {
    hand.download(0x607D, 1, -kTurn, 4);
    hand.download(0x607D, 2, 4 * kTurn, 4);
    enable(1);
    target(15 * kTurn);
    command(0x1F);
    EXPECT_EQ(hand.last_abort, Abort::none);
    command(0x0F);
    until(0x0400, 3000);
    EXPECT_NEAR(position(), 4 * kTurn, 1000);
}

struct HomingCase {
    int method;
    double home_turns;  // position of the motor at home, counted from power-up
};
class Homing : public DriveTest, public testing::WithParamInterface<HomingCase> {};

TEST_P(Homing, Finishes) {
    hand.download(0x6098, 0, GetParam().method, 1);
    hand.download(0x607C, 0, 1000, 4);
    enable(6);
    command(0x1F);
    const auto cycles = until(0x1400, 20'000);  // homing attained, target reached
    ASSERT_LT(cycles, 20'000u);
    EXPECT_EQ(status() & 0x2000, 0u);
    hand.cycle(200);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 1000);
    // The home offset is the position value at home. The motor stops within a fraction of a turn from home.
    EXPECT_NEAR(position(), 1000, kTurn / 20);
    const auto& motor = static_cast<Drive&>(static_cast<StackFirmware&>(hand.device()).model()).motor();
    hand.cycle();
    EXPECT_NEAR(motor.position() - position() + 1000, GetParam().home_turns * kTurn, 100);
    // Afterwards, csp uses the new positions.
    mode(8);
    target(kTurn);
    hand.out<std::uint16_t>(0, 0x0F);
    target(position());
    hand.cycle(2);
    EXPECT_EQ(state(), 0x27u);
}
INSTANTIATE_TEST_SUITE_P(Methods, Homing,
                         testing::Values(HomingCase{1, -20}, HomingCase{2, 20}, HomingCase{17, -20.25},
                                         HomingCase{18, 20.25}, HomingCase{33, 3}, HomingCase{34, 4},
                                         HomingCase{35, 3.3}, HomingCase{37, 3.3}),
                         [](const auto& param) { return "Method" + std::to_string(param.param.method); });

TEST_F(DriveTest, UnknownHomingMethodIsAnError) {
    hand.download(0x6098, 0, 99, 1);
    enable(6);
    command(0x1F);
    EXPECT_EQ(status() & 0x3000, 0x2000u);
}

TEST_F(DriveTest, HomingStopsWhenBit4Falls) {
    hand.download(0x6098, 0, 17, 1);
    enable(6);
    command(0x1F);
    hand.cycle(200);
    EXPECT_LT(actual_speed(), -kTurn);
    command(0x0F);
    hand.cycle(500);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 1000);
    EXPECT_EQ(status() & 0x3000, 0u);
}

TEST_F(DriveTest, QuickStopRampsDownAndSwitchesOff) {
    enable(9);
    speed(20 * kTurn);
    hand.cycle(300);
    control(0x0B);
    hand.cycle(2);
    EXPECT_EQ(state(), 0x07u);
    hand.cycle(60);  // 1000 turns/s²: 20 ms
    EXPECT_EQ(status() & 0x4F, 0x40u);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 50);
}

TEST_F(DriveTest, QuickStopMayStay) {
    hand.download(0x605A, 0, 6, 2);
    enable(9);
    speed(20 * kTurn);
    hand.cycle(300);
    control(0x0B);
    hand.cycle(100);
    EXPECT_EQ(state(), 0x07u);
    speed(0);
    command(0x0F);  // transition 16
    EXPECT_EQ(state(), 0x27u);
}

TEST_F(DriveTest, InjectedFaultAndReset) {
    enable(9);
    speed(10 * kTurn);
    hand.cycle(200);
    hand.download(0x2F00, 1, 0x4210, 2);  // device temperature
    hand.cycle(2);
    EXPECT_EQ(error_code(), 0x4210u);
    hand.cycle(100);
    EXPECT_EQ(status() & 0x4F, 0x08u);
    EXPECT_NEAR(actual_speed(), 0, kTurn / 50);
    EXPECT_EQ(hand.number(0x1003, 0), 1);
    EXPECT_EQ(hand.number(0x1003, 1) & 0xFFFF, 0x4210);
    EXPECT_EQ(hand.number(0x1001), 0x09);
    command(0x00);
    EXPECT_EQ(status() & 0x4F, 0x08u) << "a fault needs a reset";
    command(0x80);
    EXPECT_EQ(status() & 0x4F, 0x40u);
    EXPECT_EQ(error_code(), 0u);
    EXPECT_EQ(hand.number(0x1001), 0);
    command(0x00);
    speed(0);
    enable(9);
}

TEST_F(DriveTest, FaultIsToldByAnEmergency) {
    hand.download(0x2F00, 1, 0x2310, 2);
    hand.cycle(3);
    const auto mail = hand.take();
    ASSERT_TRUE(mail);
    EXPECT_EQ(mail->header.type, wire::MailboxType::coe);
    EXPECT_EQ(wire::coe::load_header(mail->data).service, wire::coe::Service::emergency);
    EXPECT_EQ(load_le<std::uint16_t>(mail->data, 2), 0x2310);
}

TEST_F(DriveTest, AJammedAxisIsAFollowingError) {
    enable(8);
    hand.download(0x2F00, 3, 1, 1);
    const auto from = position();
    for (int ms = 0; ms < 400 && (status() & 0x08) == 0; ++ms) {
        target(from + ms * (kTurn / 200));
        hand.cycle();
    }
    hand.cycle(5);
    EXPECT_EQ(status() & 0x2008, 0x2008u);
    EXPECT_EQ(error_code(), 0x8611u);
}

TEST_F(DriveTest, LoadPushesAndIsHeld) {
    enable(8);
    const auto from = position();
    hand.download(0x2F00, 2, 300, 2);
    hand.cycle(500);
    EXPECT_NEAR(actual_torque(), 300, 5);
    EXPECT_NEAR(position(), from, 2000);
}

TEST_F(DriveTest, UndervoltageAndOverload) {
    enable(8);
    hand.download(0x2F00, 4, 100'000, 4);
    hand.cycle(10);
    EXPECT_EQ(error_code(), 0x3220u);
    EXPECT_EQ(status() & 0x10, 0u);  // bit "voltage enabled"
    hand.download(0x2F00, 4, 325'000, 4);
    command(0x00);
    command(0x80);
    command(0x00);
    enable(8);
    hand.download(0x2F00, 2, 2500, 2);
    hand.cycle(1000);
    EXPECT_EQ(error_code(), 0x2350u);
}

TEST_F(DriveTest, LosingTheMasterStopsTheMotor) {
    enable(9);
    speed(10 * kTurn);
    hand.cycle(200);
    hand.keep_cycling = false;
    hand.wait(200ms);
    EXPECT_EQ(hand.status(), (AlStatus{AlState::safeop, true, 0x1B}));
    hand.wait(100ms);
    EXPECT_NEAR(static_cast<double>(hand.number(0x606C)), 0, kTurn / 50);
    EXPECT_EQ(hand.number(0x603F) & 0xFFFF, 0x7500);
}

TEST_F(DriveTest, TheMasterChoosesPdos) {
    ASSERT_EQ(hand.ask(AlState::preop).state, AlState::preop);
    hand.keep_cycling = false;
    hand.download(0x1C12, 0, 0, 1);
    hand.download(0x1C12, 1, 0x1601, 2);
    hand.download(0x1C12, 0, 1, 1);
    ASSERT_EQ(hand.last_abort, Abort::none);
    hand.download(0x6060, 0, 8, 1);
    hand.outputs.assign(6, std::byte{0});
    ASSERT_EQ(hand.to(AlState::op), (AlStatus{AlState::op, false, 0}));
    hand.cycle(2);
    EXPECT_EQ(shown_mode(), 8);
}

}  // namespace
}  // namespace margay::sim::test
