// SYNC signals and latch inputs. ETG.1000.4 "Distributed clock"; ET1100 data sheet II, tables "Cyclic unit control
// (0x0980)" … "Latch1 time negative edge (0x09C8:0x09CF)"; I, "SyncSignal generation", "LatchSignals".
#include "rig.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct SyncUnitTest : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.step = 10us;
        auto image = sii_image(0x0D05);
        store_le<std::uint16_t>(image, 2, 0x8800);  // SYNC0 and SYNC1 are mapped to the AL event request
        store_le<std::uint16_t>(image, 4, pulse_length);
        image[14] = std::byte{wire::sii::checksum(image)};
        rig.add_with_processor(ip_core(), image);
        rig.on();
    }
    std::uint16_t pulse_length = 100;  // 1 µs
    std::uint64_t copy() { return rig.slave(0).clock().copy(rig.now); }
    void start(std::uint64_t at, std::uint32_t cycle0, std::uint32_t cycle1, unsigned activation) {
        EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0990, at), 1);
        EXPECT_EQ(rig.put<std::uint32_t>(0, 0x09A0, cycle0), 1);
        EXPECT_EQ(rig.put<std::uint32_t>(0, 0x09A4, cycle1), 1);
        EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, static_cast<std::uint8_t>(activation)), 1);
    }
    std::uint64_t pulses(unsigned signal) { return rig.slave(0).sync().pulses(signal); }
    std::uint32_t events() { return rig.get<std::uint32_t>(0, 0x0220); }
};

// Cyclic generation: cycle time and pulse length above 0.
TEST_F(SyncUnitTest, CyclicFromTheStartTimeOn) {
    const auto begin = copy() + 5'000'000;
    start(begin, 1'000'000, 0, 0x03);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0984) & 1, 1) << "activation status: SYNC0 waits for its start time";
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0990), begin);
    rig.pass(4900us);
    EXPECT_EQ(pulses(0), 0u);
    rig.pass(200us);
    EXPECT_EQ(pulses(0), 1u);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0984) & 1, 0);
    rig.pass(10ms);
    EXPECT_EQ(pulses(0), 11u);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0990), begin + 11'000'000) << "while it runs: the next pulse";
    EXPECT_EQ(pulses(1), 0u) << "not switched on";
}

// The frame that is on the wire when the start time comes changes the rate of the clock when it arrives, 190 ns later.
TEST_F(SyncUnitTest, AStartTimeWhileAFrameIsOnItsWay) {
    const auto begin = copy() + 1'000'000;
    start(begin, 1'000'000, 0, 0x03);
    rig.pass(Duration(static_cast<std::int64_t>(begin - copy())) - rig.step - 100ns);
    EXPECT_EQ(pulses(0), 0u);
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0910, begin), 1) << "the time control loop compares";
    rig.pass(500us);
    EXPECT_EQ(pulses(0), 1u);
    rig.pass(1ms);
    EXPECT_EQ(pulses(0), 2u);
}

// Acknowledge mode: with pulse length 0 the signal stays active until the PDI reads its status.
struct Acknowledged : SyncUnitTest {
    Acknowledged() { pulse_length = 0; }
};

// AL event request bits 2 and 3.
TEST_F(Acknowledged, RaisesTheAlEvent) {
    start(copy() + 1'000'000, 1'000'000, 0, 0x03);
    EXPECT_EQ(events() & 0x0C, 0u);
    rig.pass(1ms);
    EXPECT_EQ(events() & 0x0C, 0x04u);
    (void)rig.pdi_get<std::uint8_t>(0, 0x098E);
    EXPECT_EQ(events() & 0x0C, 0u) << "cleared by reading 0x098E from the PDI";
    rig.pass(1ms);
    EXPECT_EQ(events() & 0x0C, 0x04u);
}

// field-notes: on 64 bits, a start time in the past never fires.
TEST_F(SyncUnitTest, AStartTimeInThePastNeverComes) {
    rig.pass(10ms);
    start(0, 1'000'000, 0, 0x03);
    rig.pass(1s);
    EXPECT_EQ(pulses(0), 0u);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0984) & 1, 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0984), 0);
    start(copy() + 1'000'000, 1'000'000, 0, 0x03);
    rig.pass(2500us);
    EXPECT_EQ(pulses(0), 2u);
}

// Single shot: SYNC0 cycle time 0.
TEST_F(SyncUnitTest, SingleShot) {
    start(copy() + 1'000'000, 0, 0, 0x03);
    rig.pass(100ms);
    EXPECT_EQ(pulses(0), 1u);
}

TEST_F(Acknowledged, HoldsUntilRead) {
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0982), 0);
    start(copy() + 1'000'000, 0, 0, 0x03);
    rig.pass(2ms);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x098E), 1);
    EXPECT_EQ(rig.pdi_get<std::uint8_t>(0, 0x098E), 1);
    EXPECT_EQ(rig.pdi_get<std::uint8_t>(0, 0x098E), 0);
}

// SYNC1 follows SYNC0 after the SYNC1 cycle time (0x09A4).
TEST_F(Acknowledged, Sync1FollowsSync0) {
    start(copy() + 1'000'000, 1'000'000, 300'000, 0x07);
    rig.pass(1200us);
    EXPECT_EQ(pulses(0), 1u);
    EXPECT_EQ(pulses(1), 0u);
    rig.pass(200us);
    EXPECT_EQ(pulses(1), 1u);
    rig.pass(10ms);
    EXPECT_EQ(pulses(0), 11u);
    EXPECT_EQ(pulses(1), 11u);
    EXPECT_EQ(events() & 0x0C, 0x0Cu);
}

TEST_F(SyncUnitTest, Sync1WithCycleTimeZeroComesWithSync0) {
    start(copy() + 1'000'000, 1'000'000, 0, 0x07);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 5u);
    EXPECT_EQ(pulses(1), 5u);
}

// 0x0998 is the system time of the next SYNC1, also while no SYNC1 is pending.
TEST_F(SyncUnitTest, TheTimeOfTheNextSync1IsShown) {
    const auto begin = copy() + 1'000'000;
    const auto next = [&] { return rig.get<std::uint64_t>(0, 0x0998); };
    start(begin, 1'000'000, 0, 0x07);
    rig.pass(5500us);
    EXPECT_EQ(next(), begin + 5'000'000) << "with the next SYNC0";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0), 1);
    const auto again = copy() + 1'000'000;
    start(again, 1'000'000, 2'000'000, 0x07);  // each third SYNC0
    rig.pass(2500us);
    EXPECT_EQ(next(), again + 2'000'000);
    rig.pass(1ms);
    EXPECT_EQ(next(), again + 5'000'000);
}

// A SYNC1 cycle time of n SYNC0 cycles: SYNC1 occurs every n + 1 SYNC0 cycles (SOEM's manual, dcsync01: "true cycle
// time").
TEST_F(SyncUnitTest, Sync1MayBeSlowerThanSync0) {
    start(copy() + 1'000'000, 1'000'000, 3'000'000, 0x07);
    rig.pass(41ms);
    EXPECT_EQ(pulses(0), 41u);
    EXPECT_EQ(pulses(1), 10u);
}

// A very short cycle time does not stop the simulation.
TEST_F(SyncUnitTest, PulsesOfANanosecondAreCountedInBundles) {
    start(copy() + 1'000'000, 1, 0, 0x03);
    rig.pass(11ms);
    EXPECT_NEAR(static_cast<double>(pulses(0)), 10'000'000.0, 100'000.0);
}

// The clock is set years ahead while SYNC is active: the pulses in between are lost, the later ones stay in phase.
TEST_F(SyncUnitTest, AJumpOfTheClockIsNotCaughtUp) {
    start(copy() + 1'000'000, 100'000, 0, 0x03);
    rig.pass(5ms);
    const auto before = pulses(0);
    EXPECT_NEAR(static_cast<double>(before), 40.0, 1.0);
    const auto work = rig.slave(0).work();
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0920, 500'000'000'000'000'000), 1);
    rig.pass(10ms);
    EXPECT_NEAR(static_cast<double>(pulses(0) - before), 100.0, 2.0);
    EXPECT_LT(rig.slave(0).work() - work, 1000U);
    const auto next = rig.get<std::uint64_t>(0, 0x0990);
    EXPECT_GT(next, copy());
    EXPECT_LE(next, copy() + 100'000);
}

// SYNC uses the system time: the offset and the control loop move it.
TEST_F(SyncUnitTest, FollowsTheSystemTime) {
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0920, 1'000'000'000'000), 1);
    start(copy() + 2'000'000, 1'000'000, 0, 0x03);
    rig.pass(1900us);
    EXPECT_EQ(pulses(0), 0u);
    rig.pass(200us);
    EXPECT_EQ(pulses(0), 1u);
    rig.slave(0).set_drift(1'000'000, rig.now);  // 0.1 % fast
    rig.segment.reconsider();
    rig.pass(10s);
    EXPECT_NEAR(static_cast<double>(pulses(0)), 10'011.0, 2.0);
}

// 0x0980 bit 0: the PDI controls SYNC, and the master cannot.
TEST_F(SyncUnitTest, MayBelongToThePdi) {
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0980, 1), 1);
    (void)rig.put<std::uint32_t>(0, 0x09A0, 5);
    (void)rig.put<std::uint8_t>(0, 0x0981, 3);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x09A0), 0u);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0981), 0);
    rig.pdi_put<std::uint64_t>(0, 0x0990, copy() + 1'000'000);
    rig.pdi_put<std::uint32_t>(0, 0x09A0, 1'000'000);
    rig.pdi_put<std::uint8_t>(0, 0x0981, 3);
    rig.pass(3500us);
    EXPECT_EQ(pulses(0), 3u);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0980, 0), 1);
    rig.pdi_put<std::uint8_t>(0, 0x0981, 0);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0981), 3) << "now the master's again";
}

// masters-on-the-wire: BWR 0x0981 stops the SYNC signals of an earlier master.
TEST_F(SyncUnitTest, ABroadcastStopsIt) {
    start(copy() + 1'000'000, 1'000'000, 0, 0x03);
    rig.pass(3ms);
    const auto before = pulses(0);
    EXPECT_GT(before, 0u);
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0981}, bytes({0})).wkc, 1);
    rig.pass(100ms);
    EXPECT_EQ(pulses(0), before);
}

// --- Latch inputs ---

struct LatchTest : SyncUnitTest {
    void edge(unsigned input, bool rising) {
        rig.slave(0).latch(input, rising, rig.now);
        rig.segment.reconsider();
    }
    std::uint64_t time(unsigned input, bool rising) {
        return rig.get<std::uint64_t>(0, static_cast<std::uint16_t>(0x09B0 + 16 * input + (rising ? 0 : 8)));
    }
    std::uint8_t status(unsigned input) { return rig.get<std::uint8_t>(0, static_cast<std::uint16_t>(0x09AE + input)); }
};

// Latch control bits 0 and 1 are 0: continuous, each edge overwrites the time of the last edge.
TEST_F(LatchTest, Continuous) {
    rig.pass(1ms);
    const auto first = copy();
    edge(0, true);
    EXPECT_EQ(status(0), 0x04) << "no event bit, but the pin's state";
    EXPECT_EQ(time(0, true), first);
    rig.pass(1ms);
    const auto second = copy();
    edge(0, false);
    edge(0, true);
    EXPECT_EQ(time(0, true), second);
    EXPECT_EQ(time(0, false), second);
    EXPECT_EQ(time(1, true), 0u);
    EXPECT_EQ(events() & 2, 0u);
}

// Bits are 1: only the first edge, until its time has been read.
TEST_F(LatchTest, SingleEvent) {
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x09A9, 0x03), 1);  // latch 1, both edges
    rig.pass(1ms);
    const auto first = copy();
    edge(1, true);
    rig.pass(1ms);
    edge(1, false);
    edge(1, true);
    EXPECT_EQ(status(1), 0x07);
    EXPECT_EQ(events() & 2, 0u) << "the master controls the input";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 1) << "ECAT event bit 0";
    EXPECT_EQ(time(1, true), first);
    EXPECT_EQ(status(1), 0x06) << "reading the time has taken the event back";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 1) << "the other edge is still there";
    (void)time(1, false);
    EXPECT_EQ(status(1), 0x04);
    EXPECT_EQ(events() & 2, 0u);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 0);
    rig.pass(1ms);
    const auto again = copy();
    edge(1, true);
    EXPECT_EQ(time(1, true), again);
}

}  // namespace
}  // namespace margay::sim::test
