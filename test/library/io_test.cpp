// Digital and analogue devices and the encoder: their environment changes, and the master reads the effect.
#include "hand.hpp"

#include <algorithm>

namespace margay::sim::test {
namespace {

TEST(Library, EveryDeviceGoesToOpByItsOwnSii) {
    for (const auto name : {"digital_io_16", "analog_io_4_2", "encoder", "drive"}) {
        SCOPED_TRACE(name);
        Hand hand(name);
        EXPECT_EQ(hand.to(AlState::op), (AlStatus{AlState::op, false, 0}));
        EXPECT_EQ(hand.number(0x1018, 1), kVendorId);
        EXPECT_EQ(static_cast<std::uint32_t>(hand.number(0x1018, 2)), hand.model.fixed.identity.product);
        EXPECT_EQ(hand.to(AlState::init).state, AlState::init);
    }
}

TEST(DigitalIo, InputsShowThePinsAndOutputsTheImage) {
    Hand hand("digital_io_16");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    store_le<std::uint16_t>(hand.device().inputs(), 0, 0xA5C3);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::uint16_t>(0), 0xA5C3);
    hand.out<std::uint16_t>(0, 0x8001);
    hand.cycle(2);
    EXPECT_EQ(hand.number(0x7000, 1), 1);
    EXPECT_EQ(hand.number(0x7000, 2), 0);
    EXPECT_EQ(hand.number(0x7000, 16), 1);
    EXPECT_EQ(load_le<std::uint16_t>(hand.device().outputs()), 0x8001);
}

TEST(DigitalIo, InvertedInputs) {
    Hand hand("digital_io_16");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.download(0x8000, 1, 0x00FF, 2);
    ASSERT_EQ(hand.last_abort, Abort::none);
    store_le<std::uint16_t>(hand.device().inputs(), 0, 0x0F0F);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::uint16_t>(0), 0x0FF0);
}

TEST(DigitalIo, OutputsFallWhenOpIsLeft) {
    Hand hand("digital_io_16");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.out<std::uint16_t>(0, 0xFFFF);
    hand.cycle(2);
    ASSERT_EQ(hand.number(0x7000, 5), 1);
    ASSERT_EQ(hand.ask(AlState::safeop).state, AlState::safeop);
    hand.cycle(3);  // the master still writes 0xFFFF; the device does not apply it
    EXPECT_EQ(hand.number(0x7000, 5), 0);
}

constexpr std::size_t value_at(unsigned channel) { return 4 * channel + 2; }

TEST(AnalogIo, RawValuesComeThroughUntilTheyAreScaled) {
    Hand hand("analog_io_4_2");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    store_le<std::int16_t>(hand.device().inputs(), 2, -1000);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::int16_t>(value_at(1)), -1000);
    hand.download(0x8010, 0x12, 0x8000, 4);  // a factor of one half
    hand.download(0x8010, 0x11, 20, 2);
    hand.download(0x8010, 1, 1, 1);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::int16_t>(value_at(1)), -480);
    EXPECT_EQ(hand.number(0x9010, 1), -1000);
}

TEST(AnalogIo, OverrangeUnderrangeAndLimits) {
    Hand hand("analog_io_4_2");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    store_le<std::int16_t>(hand.device().inputs(), 0, 32767);
    store_le<std::int16_t>(hand.device().inputs(), 2, -32768);
    hand.download(0x8020, 7, 1, 1);
    hand.download(0x8020, 0x13, -10, 2);
    hand.download(0x8020, 0x14, 10, 2);
    store_le<std::int16_t>(hand.device().inputs(), 4, 11);
    hand.cycle(2);
    // Bits 0 underrange, 1 overrange, 2 and 3 limit, 6 error.
    EXPECT_EQ(hand.in<std::uint8_t>(0), 0x42);
    EXPECT_EQ(hand.in<std::int16_t>(value_at(0)), 32000);
    EXPECT_EQ(hand.in<std::uint8_t>(4), 0x41);
    EXPECT_EQ(hand.in<std::uint8_t>(8), 0x08);
    store_le<std::int16_t>(hand.device().inputs(), 4, -11);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::uint8_t>(8), 0x04);
    store_le<std::int16_t>(hand.device().inputs(), 4, 10);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::uint8_t>(8), 0x00);
}

TEST(AnalogIo, OutputsAreScaledToTheTerminal) {
    Hand hand("analog_io_4_2");
    ASSERT_EQ(hand.to(AlState::op).state, AlState::op);
    hand.download(0x8050, 0x12, 2 * 65536, 4);
    hand.download(0x8050, 1, 1, 1);
    hand.out<std::int16_t>(0, 77);
    hand.out<std::int16_t>(2, 20000);
    hand.cycle(2);
    EXPECT_EQ(hand.number(0x9040, 1), 77);
    EXPECT_EQ(hand.number(0x9050, 1), 32767);  // limited, not wrapped
    ASSERT_EQ(hand.ask(AlState::safeop).state, AlState::safeop);
    EXPECT_EQ(hand.number(0x9040, 1), 0);
}

// Inputs of the encoder: flags in octets 0 and 1, counter, latch, speed.
class EncoderTest : public testing::Test {
  protected:
    Hand hand{"encoder"};
    void SetUp() override { ASSERT_EQ(hand.to(AlState::op).state, AlState::op); }
    void turn(std::int32_t speed) {
        store_le<std::int32_t>(hand.device().inputs(), 0, speed);
        hand.device().poke();
    }
    std::uint8_t flags() { return hand.in<std::uint8_t>(0); }
    std::uint32_t counter() { return hand.in<std::uint32_t>(2); }
    std::uint32_t latched() { return hand.in<std::uint32_t>(6); }
};

TEST_F(EncoderTest, CountsWhatItTurns) {
    hand.cycle();
    const auto before = counter();
    turn(10'000);
    hand.cycle(101);
    const auto start = counter();
    EXPECT_GE(start - before, 990u);
    EXPECT_LE(start - before, 1020u);
    hand.cycle(1000);
    EXPECT_EQ(counter() - start, 10'000u);
    EXPECT_EQ(hand.in<std::int32_t>(10), 10'000);
    turn(-10'000);
    hand.cycle(2000);
    EXPECT_LT(static_cast<std::int32_t>(counter() - start), 0);
}

TEST_F(EncoderTest, LongTurningLosesNothing) {
    turn(100'000'003);
    hand.cycle(2);
    const auto start = counter();
    hand.keep_cycling = false;
    hand.rig.now += std::chrono::minutes(5);  // meanwhile the watchdog changes OP to SAFEOP
    hand.cycle(3);
    // 5 minutes, and about 3 ms of the cycles.
    const std::uint64_t turned = 300u * 100'000'003ull;
    const auto counted = counter() - start;
    EXPECT_NEAR(static_cast<double>(static_cast<std::uint32_t>(counted - static_cast<std::uint32_t>(turned))), 300'000,
                110'000);
}

TEST_F(EncoderTest, SetCounterOnceAtARisingEdge) {
    hand.out<std::uint32_t>(2, 123'456);
    hand.out<std::uint8_t>(0, 0x04);
    hand.cycle(2);
    EXPECT_EQ(flags() & 0x04, 0x04);
    EXPECT_EQ(counter(), 123'456u);
    turn(1000);
    hand.cycle(100);
    EXPECT_GT(counter(), 123'500u);
}

TEST_F(EncoderTest, LatchesTheFirstIndexPulse) {
    hand.out<std::uint8_t>(0, 0x01);
    hand.cycle(2);
    EXPECT_EQ(flags() & 0x01, 0);
    turn(40'960);  // ten turns per second
    hand.cycle(150);
    EXPECT_EQ(flags() & 0x01, 0x01);
    EXPECT_EQ(latched(), 4096u);
    hand.cycle(150);
    EXPECT_EQ(latched(), 4096u) << "the second pulse must not overwrite the first";
    hand.out<std::uint8_t>(0, 0);
    hand.cycle(2);
    EXPECT_EQ(flags() & 0x01, 0);
    turn(-40'960);
    hand.out<std::uint8_t>(0, 0x01);
    hand.cycle(150);
    EXPECT_EQ(flags() & 0x01, 0x01);
    EXPECT_EQ(latched() % 4096, 0u);
    EXPECT_GT(latched(), counter());
}

TEST_F(EncoderTest, LatchInputTellsThePositionAtTheEdge) {
    constexpr std::uint8_t kLatch0IsThePdis = 0x10;
    hand.rig.put<std::uint8_t>(0, reg::kCyclicUnitControl.address, kLatch0IsThePdis);
    turn(1'000'000);  // one count per microsecond
    hand.out<std::uint8_t>(0, 0x02);
    hand.cycle(5);
    const auto before = counter();
    const auto at = hand.rig.now + 370us;
    hand.esc().latch(0, true, at);
    hand.rig.segment.reconsider();
    hand.cycle(2);
    ASSERT_EQ(flags() & 0x02, 0x02);
    // The inputs that a cycle reads are one millisecond old.
    EXPECT_GT(latched(), before);
    EXPECT_LT(latched() - before, 1000u + 500u);
    const auto first = latched();
    hand.esc().latch(0, true, hand.rig.now + 100us);
    hand.rig.segment.reconsider();
    hand.cycle(2);
    EXPECT_EQ(latched(), first) << "armed once, it takes one edge";
}

}  // namespace
}  // namespace margay::sim::test
