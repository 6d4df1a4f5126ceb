// The clock of an ESC. ETG.1000.4 section "Distributed clock"; ET1100 data sheet II, "Distributed clocks"; I,
// "Distributed clocks", "Propagation delay measurement", "Drift compensation".
#include "rig.hpp"

#include <cstdlib>

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

EscDescription clocked(std::int32_t drift_ppb, std::uint64_t start_ns = 0, DcUnit unit = DcUnit::bits64) {
    auto chip = ip_core();
    chip.dc = unit;
    chip.clock = {drift_ppb, start_ns};
    return chip;
}

// 0x092C: sign and magnitude.
std::int32_t signed_difference(std::uint32_t raw) {
    const auto magnitude = static_cast<std::int32_t>(raw & 0x7FFFFFFF);
    return (raw & 0x80000000) != 0 ? -magnitude : magnitude;
}

TEST(LocalTime, RunsWithTheDriftOfItsOscillator) {
    Rig rig;
    rig.add(clocked(0, 1000), sii_image(kEmulationWithDc));
    rig.add(clocked(100'000), sii_image(kEmulationWithDc));
    rig.add(clocked(-50'000), sii_image(kEmulationWithDc));
    rig.on();
    const auto at = [&](std::uint32_t n, Duration t) { return rig.slave(n).clock().local(Time{} + t); };
    EXPECT_EQ(at(0, 10s), 10'000'001'000u);
    EXPECT_EQ(at(1, 10s), 10'001'000'000u) << "100 ppm fast: a millisecond in ten seconds";
    EXPECT_EQ(at(2, 10s), 9'999'500'000u);
    rig.pass(10s);
    rig.slave(1).set_drift(0, rig.now);
    EXPECT_EQ(at(1, 20s), 20'001'000'000u) << "from now on right, what it has gained it keeps";
    EXPECT_EQ(at(1, 5s), 5'001'000'000u);
}

// Tables "Receive time port 0 (0x0900)" …: a write latches the time when the first bit of the frame arrived at each
// port.
TEST(ReceiveTimes, AreLatchedByAWriteOnly) {
    Rig rig;
    for (int i = 0; i < 2; ++i) rig.add(clocked(0), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0900), 0u);
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0900}, bytes({0, 0, 0, 0})).wkc, 2);
    const auto latched = rig.get<std::uint64_t>(0, 0x0900);
    EXPECT_NE(latched, 0u);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0900), latched) << "reading latches nothing";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x0904, 0), 0) << "nor does port 1, which cannot be written";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0900, 0), 1);
    EXPECT_NE(rig.get<std::uint64_t>(0, 0x0900), latched) << "one octet is enough";
}

// The delay between two slaves is half of the difference of two times: the time from leaving the first slave until the
// return to it, and the same time for the second slave.
TEST(ReceiveTimes, GiveTheDelaysOfTheCables) {
    Rig rig;
    for (int i = 0; i < 3; ++i) rig.segment.add(std::make_unique<Esc>(clocked(0), sii_image(kEmulationWithDc)));
    EXPECT_TRUE(rig.segment.connect_master({0, 0}));
    EXPECT_TRUE(rig.segment.connect({0, 1}, {1, 0}, 100ns));
    EXPECT_TRUE(rig.segment.connect({1, 1}, {2, 0}, 500ns));
    rig.on();
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0900}, bytes({0, 0, 0, 0})).wkc, 3);
    const auto away = [&](std::uint16_t n) {
        return rig.get<std::uint32_t>(n, 0x0904) - rig.get<std::uint32_t>(n, 0x0900);
    };
    const auto& chip = rig.slave(0).description();
    const Duration port = chip.ports[0].delay;
    const auto ns = [](Duration d) { return static_cast<std::uint32_t>(d.count()); };
    // Receive, process, send, cable delay; at the end of the line receive, process, send; on the way back receive,
    // forward, send.
    const auto there = [&](Duration cable) { return 2 * port + chip.processing_delay + cable; };
    const Duration turn = 2 * port + chip.processing_delay;
    const Duration back = 2 * port + chip.forwarding_delay;
    EXPECT_EQ(away(1), ns(there(500ns) + turn + 500ns));
    EXPECT_EQ(away(0), away(1) + ns(there(100ns) + back + 100ns));
    EXPECT_EQ(rig.get<std::uint32_t>(2, 0x0904), 0u) << "nobody behind it: the port keeps what it had";
}

// Every clock has its own time: the latched times of two slaves are not related.
TEST(ReceiveTimes, AreInTheSlavesOwnTime) {
    Rig rig;
    rig.add(clocked(0, 0xFFFFFF00), sii_image(kEmulationWithDc));
    rig.add(clocked(0, 5'000'000'000), sii_image(kEmulationWithDc));
    rig.on();
    rig.step = 1ms;
    (void)rig.send(Command::BWR, {std::uint16_t{0}, 0x0900}, bytes({0, 0, 0, 0}));
    const auto port0 = rig.get<std::uint32_t>(0, 0x0900);
    const auto port = static_cast<std::uint32_t>(rig.slave(0).description().ports[0].delay.count());
    EXPECT_EQ(port0, 0xFFFFFF00u + 1'000'050u + port) << "32 bits, wrapped; the master's cable takes 50 ns";
    // Table "Receive time ECAT processing unit (0x0918:0x091F)": all 64 bits.
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0918), 0x1'0000'0000u + port0);
    EXPECT_EQ(rig.get<std::uint64_t>(1, 0x0918) >> 32, 5'001'000'000u >> 32);
}

// A segment connected at port 1: 0x0918 is the time of arrival at this port.
TEST(ReceiveTimes, ByAnotherEntryPort) {
    Rig rig;
    rig.segment.add(std::make_unique<Esc>(clocked(0), sii_image(kEmulationWithDc)));
    rig.segment.add(std::make_unique<Esc>(clocked(0), sii_image(kEmulationWithDc)));
    EXPECT_TRUE(rig.segment.connect_master({0, 1}));
    EXPECT_TRUE(rig.segment.connect({0, 0}, {1, 0}));
    rig.on();
    (void)rig.send(Command::BWR, {std::uint16_t{0}, 0x0900}, bytes({0, 0, 0, 0}));
    // The frame enters at port 1, goes to the neighbour through port 0, returns at port 0 and is processed there.
    EXPECT_GT(rig.get<std::uint32_t>(1, 0x0900), rig.get<std::uint32_t>(1, 0x0904));
    EXPECT_EQ(rig.segment.order(), (std::vector<std::uint32_t>{1, 0}));
}

TEST(SystemTime, IsLocalTimePlusOffset) {
    Rig rig;
    rig.add_with_processor(clocked(0, 1'000'000), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0920, 0x1'0000'0000), 1);
    rig.step = 0us;
    const auto local = static_cast<std::uint64_t>(rig.now.time_since_epoch().count()) + 1'000'000;
    const auto& chip = rig.slave(0).description();
    const auto there = static_cast<std::uint64_t>((50ns + chip.ports[0].delay).count());
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0910), local + 0x1'0000'0000 + there) << "when the frame was processed";
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0920), 0x1'0000'0000u);
    // A read by the master subtracts the delay, so that it returns the time of the reference clock when the frame
    // passed that clock. The PDI reads the copy without this subtraction.
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x0928, 300), 1);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0910), local + 0x1'0000'0000 + there - 300);
    EXPECT_EQ(rig.pdi_get<std::uint64_t>(0, 0x0910), rig.slave(0).clock().local(rig.slave(0).now()) + 0x1'0000'0000);
}

TEST(SystemTime, Of32BitsWraps) {
    Rig rig;
    rig.add(clocked(0, 0xFFFFF000, DcUnit::bits32), sii_image(kEmulationWithDc));
    rig.on();
    rig.step = 1ms;
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0910) >> 32, 0u);
    EXPECT_LT(rig.get<std::uint32_t>(0, 0x0910), 10'000'000u) << "past the wrap";
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0918) >> 32, 0u);
}

TEST(DcUnit, IsThereAsFarAsTheChipHasIt) {
    Rig rig;
    rig.add(clocked(0, 0, DcUnit::none), sii_image(kEmulationWithDc));
    rig.add(clocked(0, 0, DcUnit::receive_times), sii_image(kEmulationWithDc));
    auto enabled = et1200();  // register 0x0141 enables its DC unit
    rig.add(enabled, sii_image(kDigitalIo));
    rig.add(enabled, sii_image(kEmulationWithDc));
    rig.on();
    const auto there = [&](std::uint16_t n, std::uint16_t address) { return rig.read(n, address, 4).wkc; };
    EXPECT_EQ(there(0, 0x0900), 0);
    EXPECT_EQ(there(0, 0x0910), 0);
    EXPECT_EQ(there(1, 0x0900), 1);
    EXPECT_EQ(there(1, 0x0910), 0);
    EXPECT_EQ(there(2, 0x0900), 1) << "as the EL2828 of replay-dc: receive times, and nothing more";
    EXPECT_EQ(there(2, 0x0910), 0);
    EXPECT_EQ(there(3, 0x0910), 1);
}

// --- The time control loop ---

struct ControlLoop : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.step = 1ms;
        rig.add(clocked(0), sii_image(kEmulationWithDc));
        rig.add(clocked(100'000), sii_image(kEmulationWithDc));
        rig.add(clocked(-80'000, 0, DcUnit::bits32), sii_image(kEmulationWithDc));
        rig.on();
        for (std::uint16_t n = 0; n < 3; ++n)
            (void)rig.put<std::uint16_t>(n, 0x0010, static_cast<std::uint16_t>(0x1001 + n));
        // Delays as a master would have measured them, calculated from the times of the model.
        for (std::uint16_t n = 1; n < 3; ++n)
            (void)rig.put<std::uint32_t>(n, 0x0928, static_cast<std::uint32_t>(n * kHop.count()));
    }
    static constexpr Duration kHop = 2 * 140ns + 60ns + 5ns;  // two ports, the processing unit, the cable
    void drift_frames(int count) {
        for (int i = 0; i < count; ++i)
            EXPECT_EQ(rig.send(Command::FRMW, {StationAddress{0x1001}, 0x0910}, std::vector<std::byte>(8)).wkc, 3);
    }
    std::int32_t difference(std::uint16_t n) { return signed_difference(rig.get<std::uint32_t>(n, 0x092C)); }
    std::int64_t apart(std::uint32_t n) {
        return static_cast<std::int32_t>(static_cast<std::uint32_t>(rig.slave(n).clock().copy(rig.now)) -
                                         static_cast<std::uint32_t>(rig.slave(0).clock().copy(rig.now)));
    }
};

TEST_F(ControlLoop, BringsTheClocksTogetherAndHoldsThem) {
    rig.pass(100ms);
    EXPECT_GT(apart(1), 9'000) << "100 ppm are 10 µs in 100 ms";
    EXPECT_LT(apart(2), -7'000);
    drift_frames(3000);
    for (std::uint16_t n = 1; n < 3; ++n) {
        EXPECT_LT(std::abs(difference(n)), 20) << n;
        EXPECT_LT(std::abs(apart(n)), 20) << n;
    }
    EXPECT_EQ(difference(0), 0) << "the reference is not compared with itself: nobody writes to it";
    // 0x0932 is in two's complement: negative for a fast clock, which is slowed down, positive for a slow clock.
    EXPECT_LT(static_cast<std::int16_t>(rig.get<std::uint16_t>(1, 0x0932)), -1000);
    EXPECT_GT(static_cast<std::int16_t>(rig.get<std::uint16_t>(2, 0x0932)), 1000);
    // The drift changes, as by temperature.
    rig.slave(1).set_drift(60'000, rig.now);
    drift_frames(3000);
    EXPECT_LT(std::abs(difference(1)), 20);
    // Without the frames the clocks diverge, by the part of the drift that the loop has not compensated.
    rig.pass(1s);
    EXPECT_LT(std::abs(apart(1)), 2'000) << "the rate is held";
}

// Table "System time difference (0x092C:0x092F)": bit 31 is set when the local copy is smaller than the received time.
TEST_F(ControlLoop, DifferenceIsSignAndMagnitude) {
    EXPECT_EQ(rig.put<std::uint8_t>(1, 0x0934, 0), 1);  // no averaging: the last difference
    EXPECT_EQ(rig.put<std::uint8_t>(2, 0x0934, 0), 1);
    rig.pass(50ms);
    const auto fast = apart(1);
    drift_frames(1);
    const auto raw_fast = rig.get<std::uint32_t>(1, 0x092C);
    const auto raw_slow = rig.get<std::uint32_t>(2, 0x092C);
    EXPECT_EQ(raw_fast >> 31, 0u);
    EXPECT_EQ(raw_slow >> 31, 1u);
    EXPECT_NEAR(static_cast<double>(raw_fast & 0x7FFFFFFF), static_cast<double>(fast), 120.0)
        << "a millisecond later: 100 ns more";
    EXPECT_GT(raw_slow & 0x7FFFFFFF, 3'000u);
}

// Table "System time difference filter depth (0x0934)": the mean of 2^n differences; a write restarts the filter.
TEST_F(ControlLoop, FilterDepth) {
    rig.pass(100ms);
    drift_frames(1);
    const auto first = std::abs(difference(1));
    EXPECT_LT(first, 1'000) << "a sixteenth of the difference, at the default depth of 4";
    EXPECT_GT(first, 500);
    EXPECT_EQ(rig.put<std::uint8_t>(1, 0x0934, 4), 1);
    EXPECT_EQ(difference(1), 0);
    // Table "Speed counter start (0x0930:0x0931)": a write resets the difference, the counter difference and the loop.
    drift_frames(10);
    EXPECT_NE(rig.get<std::uint16_t>(1, 0x0932), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(1, 0x0930), 0x1000);
    EXPECT_EQ(rig.put<std::uint16_t>(1, 0x0930, 0x1000), 1);
    EXPECT_EQ(rig.get<std::uint16_t>(1, 0x0932), 0);
    EXPECT_EQ(difference(1), 0);
    EXPECT_EQ(rig.put<std::uint16_t>(1, 0x0932, 1), 0) << "read only";
    EXPECT_EQ(rig.put<std::uint32_t>(1, 0x092C, 1), 0);
}

// 0x0932 stays within ± (start − 0x7F): the loop changes the speed of a clock only within this limit.
TEST_F(ControlLoop, SpeedCounterHasItsLimits) {
    EXPECT_EQ(rig.put<std::uint16_t>(1, 0x0930, 0x0100), 1);
    EXPECT_EQ(rig.put<std::uint64_t>(1, 0x0920, 1'000'000'000), 1);  // a second ahead
    drift_frames(200);
    EXPECT_EQ(static_cast<std::int16_t>(rig.get<std::uint16_t>(1, 0x0932)), -(0x0100 - 0x7F));
}

// Other masters write the time by FPWR or BWR: every clock that is written follows it.
TEST_F(ControlLoop, FollowsWhateverIsWritten) {
    rig.pass(10ms);
    const auto before = rig.slave(0).clock().copy(rig.now);
    std::vector<std::byte> time(8);
    store_le<std::uint64_t>(time, 0, before + 5'000'000);
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0910}, time).wkc, 3);
    for (std::uint16_t n = 0; n < 3; ++n) EXPECT_LT(difference(n), 0) << "behind what came";
    // The written value is not stored: the register shows the local copy.
    EXPECT_NEAR(static_cast<double>(rig.get<std::uint32_t>(0, 0x0910)), static_cast<double>(before + 3'000'000),
                2'500'000.0);
}

}  // namespace
}  // namespace margay::sim::test
