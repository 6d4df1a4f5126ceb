// Error counters and watchdogs. ETG.1000.4 tables "RX error counter" … "Lost link counter", "Watchdog"; ET1100 data
// sheet II, "Error counters", "Watchdogs".
#include "rig.hpp"

#include "wire/sync_manager.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct ErrorCounters : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add(et1100(), sii_image(kEmulationWithDc));
        rig.add(et1200(), sii_image(kDigitalIo));
        rig.add(et1200(), sii_image(kDigitalIo));
        rig.on();
    }
    // The present value of a register, read without a frame.
    unsigned peek(std::uint32_t n, std::uint16_t address) {
        return std::to_integer<unsigned>(rig.slave(n).peek(address, 1)[0]);
    }
    void damage_at(PortRef end) {
        rig.segment.corrupt_next(end);
        EXPECT_FALSE(rig.read(0, 0, 1).returned) << "the master's NIC drops it";
    }
};

// The port where a damaged frame arrives counts it as invalid (0x0300 + 2 n), later ports count it as forwarded
// (0x0308 + n), and each processing unit counts it at 0x030C.
TEST_F(ErrorCounters, DamageIsCountedAtThePortItCameInAt) {
    damage_at({1, 0});
    EXPECT_EQ(peek(0, 0x0300), 0u) << "before the damage";
    EXPECT_EQ(peek(0, 0x030C), 0u);
    EXPECT_EQ(peek(1, 0x0300), 1u) << "here it is seen first";
    EXPECT_EQ(peek(1, 0x0308), 0u);
    EXPECT_EQ(peek(1, 0x030C), 1u);
    EXPECT_EQ(peek(2, 0x0300), 0u) << "marked by the one before";
    EXPECT_EQ(peek(2, 0x0308), 1u);
    EXPECT_EQ(peek(2, 0x030C), 1u);
    EXPECT_EQ(peek(1, 0x0309), 1u) << "on the way back, at port 1";
    EXPECT_EQ(peek(0, 0x0309), 1u);

    // A frame damaged on the way back is counted at the far port, and no processing unit counts it.
    damage_at({0, 1});
    EXPECT_EQ(peek(0, 0x0302), 1u);
    EXPECT_EQ(peek(0, 0x0309), 1u);
    EXPECT_EQ(peek(1, 0x0300), 1u);
    EXPECT_EQ(peek(0, 0x030C), 0u);
}

TEST_F(ErrorCounters, DamagedFramesDoNothingBehindTheDamage) {
    rig.segment.corrupt_next({1, 0});
    (void)rig.send(Command::BWR, {std::uint16_t{0}, 0x0F80}, bytes({0x55}));
    EXPECT_EQ(peek(0, 0x0F80), 0x55u) << "it was whole there";
    EXPECT_EQ(peek(1, 0x0F80), 0u);
}

// "Cleared if one of the RX error counters 0x0300–0x030B is written"; each of the other counters is cleared by a write
// to it.
TEST_F(ErrorCounters, AreClearedByAWrite) {
    damage_at({1, 0});
    rig.segment.set_cable({2, 0}, false);
    EXPECT_EQ(rig.put<std::uint8_t>(1, 0x030C, 0), 1);
    EXPECT_EQ(peek(1, 0x030C), 0u);
    EXPECT_EQ(peek(1, 0x0300), 1u);
    EXPECT_EQ(rig.put<std::uint8_t>(1, 0x0302, 0xAA), 1) << "the value does not matter";
    EXPECT_EQ(peek(1, 0x0300), 0u);
    EXPECT_EQ(peek(1, 0x0302), 0u);
    EXPECT_EQ(peek(1, 0x0309), 0u) << "forwarded errors go with them";
    EXPECT_EQ(peek(1, 0x0311), 1u);
    EXPECT_EQ(rig.put<std::uint8_t>(1, 0x0313, 0), 1);
    EXPECT_EQ(peek(1, 0x0311), 0u);
    // Writes of masters at their start: BWR 0x0300 of 8 or 20 octets.
    damage_at({1, 0});
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0300}, std::vector<std::byte>(20)).wkc, 2);
    EXPECT_EQ(rig.slave(1).peek(0x0300, 20), std::vector<std::byte>(20));
}

TEST_F(ErrorCounters, StopAt255) {
    for (int i = 0; i < 300; ++i) damage_at({1, 0});
    EXPECT_EQ(peek(1, 0x0300), 255u);
    EXPECT_EQ(peek(2, 0x0308), 255u);
    EXPECT_EQ(peek(1, 0x030C), 255u);
}

// Table "Lost link counter (0x0310:0x0313)": counted at both ends of a broken cable, and when a neighbour loses power.
TEST_F(ErrorCounters, LostLinks) {
    rig.segment.set_cable({1, 0}, false);
    EXPECT_EQ(peek(0, 0x0311), 1u);
    EXPECT_EQ(peek(1, 0x0310), 1u);
    rig.segment.set_cable({1, 0}, true);
    EXPECT_EQ(peek(0, 0x0311), 1u) << "healing counts nothing";
    rig.segment.set_power(2, false, rig.now);
    EXPECT_EQ(peek(1, 0x0311), 1u);
    rig.segment.set_power(2, true, rig.now);
    EXPECT_EQ(peek(1, 0x0311), 1u);
    EXPECT_EQ(peek(2, 0x0310), 0u) << "fresh";
}

// --- Watchdogs: (0x0400 + 2) times 40 ns is the unit of 0x0410 and 0x0420 ---

struct WatchdogTest : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add_with_processor(et1100());
        rig.on();
        // outputs that trigger the watchdog
        EXPECT_EQ(rig.write(0, 0x0810, bytes({0x00, 0x11, 2, 0, 0x64, 0, 1, 0})).wkc, 1);
    }
    std::uint16_t status() { return rig.get<std::uint16_t>(0, 0x0440); }
    void feed() { EXPECT_EQ(rig.put<std::uint16_t>(0, 0x1100, 0x1234), 1); }
};

// Tables "Watchdog divider (0x0400:0x0401)", "Watchdog time process data (0x0420:0x0421)": 1000 times 100 µs.
TEST_F(WatchdogTest, ProcessDataRunsOutAfterItsTime) {
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0400), 0x09C2);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0420), 0x03E8);
    feed();
    EXPECT_EQ(status(), 1);
    rig.pass(99ms);
    EXPECT_EQ(status(), 1);
    rig.pass(2ms);
    EXPECT_EQ(status(), 0);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 1) << "counted";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x40, 0x40u) << "AL event request bit 6";
    (void)rig.pdi_get<std::uint16_t>(0, 0x0440);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x40, 0u) << "cleared by reading 0x0440 from the PDI";
    rig.pass(500ms);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 1) << "once";
    feed();
    EXPECT_EQ(status(), 1) << "process data starts it again";
}

TEST_F(WatchdogTest, EveryWriteFeedsIt) {
    feed();
    for (int i = 0; i < 10; ++i) {
        rig.pass(90ms);
        feed();
    }
    EXPECT_EQ(status(), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 0);
}

TEST_F(WatchdogTest, TimesAndDividerCount) {
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0400, 248), 1);  // (248 + 2) · 40 ns = 10 µs
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0420, 200), 1);  // 2 ms
    feed();
    rig.pass(1800us);
    EXPECT_EQ(status(), 1);
    rig.pass(200us);
    EXPECT_EQ(status(), 0);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0420, 0), 1) << "0: off";
    feed();
    rig.pass(10s);
    EXPECT_EQ(status(), 1);
}

TEST_F(WatchdogTest, OnlyChannelsWithTheTriggerBitFeedIt) {
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0816, 0), 1);
    EXPECT_EQ(rig.write(0, 0x0810, bytes({0x00, 0x11, 2, 0, 0x24, 0, 1, 0})).wkc, 1);
    feed();
    rig.pass(1s);
    EXPECT_EQ(status(), 1) << "nothing to watch";
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 0);
}

// A write to 0x0442 or 0x0443 clears both counters.
TEST_F(WatchdogTest, CountersAreCleared) {
    feed();
    rig.pass(200ms);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0443, 0), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0442), 0);
}

// Table "Watchdog time PDI (0x0410:0x0411)": a processor that hangs clears DL status bit 1.
TEST_F(WatchdogTest, HangingProcessorIsNoticed) {
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110) & 2, 2);
    rig.slave(0).halt_firmware(rig.now);
    rig.segment.reconsider();
    rig.pass(99ms);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110) & 2, 2);
    rig.pass(2ms);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110) & 2, 0);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0443), 1);
}

// A program that reads its AL events when it is called, and sleeps in between.
class SleepingFirmware final : public Firmware {
  public:
    void start(subdevice::EscAccess& esc, Time) override { esc_ = &esc; }
    Time step(Time now) override {
        std::array<std::byte, 4> events{};
        esc_->read(0x0220, events);
        std::array<std::byte, 2> control{};
        esc_->read(0x0120, control);
        return every == Duration::zero() ? kNever : now + every;
    }
    Duration every{};

  private:
    subdevice::EscAccess* esc_ = nullptr;
};

// DS I, "PDI watchdog": accesses of the processor trigger it, and only they do.
TEST(WatchdogOfThePdi, ExpiresWhileTheProgramSleeps) {
    for (const Duration every : {0ms, 50ms}) {
        Rig rig;
        rig.add(et1100(), sii_image(kProcessor));
        auto firmware = std::make_unique<SleepingFirmware>();
        firmware->every = every;
        rig.slave(0).set_firmware(std::move(firmware));
        rig.on();
        const auto alive = [&] { return (rig.get<std::uint16_t>(0, 0x0110) & 2) != 0; };
        rig.pass(99ms);
        EXPECT_TRUE(alive());
        rig.pass(101ms);
        EXPECT_EQ(alive(), every == 50ms);
        EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0443), every == 50ms ? 0 : 1);
        rig.pass(1s);
        EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0443), every == 50ms ? 0 : 1) << "it expires once";
        EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0001), 1);  // an event wakes the program
        rig.pass(1ms);
        EXPECT_TRUE(alive());
        rig.pass(200ms);
        EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0443), every == 50ms ? 0 : 2);
    }
}

// Digital I/O without a processor: the chip resets the outputs.
TEST(WatchdogDigital, OutputsFallWhenItRunsOut) {
    Rig rig;
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    EXPECT_EQ(rig.write(0, 0x0800, bytes({0x00, 0x0F, 1, 0, 0x44, 0, 1, 0})).wkc, 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0F00, 0xFF), 1);
    EXPECT_EQ(rig.slave(0).peek(0x0F00, 1)[0], std::byte{0xFF});
    rig.pass(101ms);
    EXPECT_EQ(rig.slave(0).peek(0x0F00, 1)[0], std::byte{0});
}

}  // namespace
}  // namespace margay::sim::test
