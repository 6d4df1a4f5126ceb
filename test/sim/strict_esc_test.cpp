// Restrictions of an ESC that a program must respect, and functions beyond the basics: masked events, SYNC signals that
// are not mapped, one-octet SyncManagers, bit-wise writes, ownership of latch inputs, enhanced SYNC activation,
// recovery of closed ports, times of buffer events. ET1100 data sheets I and II.
#include "rig.hpp"

#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;
namespace al_event = wire::al_event;

std::vector<std::byte> image_with(std::uint16_t pdi_control, unsigned sync_latch, std::uint16_t pulse_length_10ns) {
    auto image = sii_image(pdi_control);
    store_le<std::uint16_t>(image, 2, static_cast<std::uint16_t>(sync_latch << 8));
    store_le<std::uint16_t>(image, 4, pulse_length_10ns);
    image[14] = std::byte{wire::sii::checksum(image)};
    return image;
}

struct StrictEsc : testing::Test {
    Rig rig;
    void build(unsigned sync_latch = 0x0C, std::uint16_t pulse_length_10ns = 0,
               const EscDescription& chip = ip_core()) {
        rig.step = 10us;
        rig.add_with_processor(chip, image_with(0x0C05, sync_latch, pulse_length_10ns));
        rig.on();
        rig.pass(1ms);
    }
    IdleFirmware& firmware() { return static_cast<IdleFirmware&>(*rig.slave(0).firmware()); }
    std::uint32_t events() { return rig.get<std::uint32_t>(0, 0x0220); }
    std::uint64_t copy() { return rig.slave(0).clock().copy(rig.now); }
    std::uint64_t pulses(unsigned signal) { return rig.slave(0).sync().pulses(signal); }
    void set_sm(unsigned n, std::uint16_t start, std::uint16_t length, unsigned control) {
        EXPECT_EQ(rig.write(0, reg::sync_manager(n).address,
                            bytes({start & 0xFFu, start / 256u, length & 0xFFu, length / 256u, control, 0, 1, 0}))
                      .wkc,
                  1);
    }
    void start_sync(Duration after, std::uint32_t cycle0, unsigned activation) {
        (void)rig.put<std::uint32_t>(0, 0x09A0, cycle0);
        (void)rig.put<std::uint64_t>(0, 0x0990, copy() + static_cast<std::uint64_t>(after.count()));
        (void)rig.put<std::uint8_t>(0, 0x0981, static_cast<std::uint8_t>(activation));
    }
};

// II, "AL event mask (0x0204)": the interrupt is the event request AND the mask.
TEST_F(StrictEsc, MaskedEventsDoNotWakeTheProgram) {
    build();
    rig.pdi_put<std::uint32_t>(0, 0x0204, 0);
    const auto before = firmware().steps;
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 2), 1);
    set_sm(0, 0x1000, 16, 0x26);
    EXPECT_EQ(rig.write(0, 0x1000, std::vector<std::byte>(16)).wkc, 1);
    rig.pass(10ms);
    EXPECT_EQ(events() & 0x111u, 0x111u);
    EXPECT_EQ(firmware().steps, before);
    rig.pdi_put<std::uint32_t>(0, 0x0204, al_event::kAlControl);
    rig.pass(100us);
    EXPECT_GT(firmware().steps, before) << "the line is active as soon as the mask says so";
}

// The line is a level: a program that does not clear an unmasked event is called again and again.
TEST_F(StrictEsc, AnEventThatIsNotServedKeepsTheLineActive) {
    build();
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 2), 1);
    rig.pass(10ms);
    EXPECT_GT(firmware().steps, 100u);
    (void)rig.pdi_get<std::uint16_t>(0, 0x0120);
    rig.pass(100us);
    const auto served = firmware().steps;
    rig.pass(10ms);
    EXPECT_EQ(firmware().steps, served);
}

// II, "AL event request" bits 2 and 3, "Sync/Latch PDI configuration (0x0151)" bits 3 and 7.
TEST_F(StrictEsc, OnlyMappedSyncSignalsAreAlEvents) {
    for (const unsigned mapped : {0x00u, 0x08u, 0x80u, 0x88u}) {
        rig = Rig();
        build(mapped);
        start_sync(1ms, 1'000'000, 7);
        rig.pass(10ms);
        EXPECT_GT(pulses(0), 5u);
        EXPECT_GT(pulses(1), 5u);
        EXPECT_EQ((events() & al_event::kDcSync0) != 0, (mapped & 0x08) != 0) << mapped;
        EXPECT_EQ((events() & al_event::kDcSync1) != 0, (mapped & 0x80) != 0) << mapped;
    }
}

// II, bit 2: "State of DC SYNC0"; "use only in acknowledge mode".
TEST_F(StrictEsc, APulseIsAnAlEventOnlyWhileItLasts) {
    build(0x0C, 5000);  // 50 µs
    start_sync(1ms, 1'000'000, 3);
    rig.pass(1010us - 3 * rig.step);
    EXPECT_EQ(events() & al_event::kDcSync0, al_event::kDcSync0);
    rig.pass(100us);
    EXPECT_EQ(events() & al_event::kDcSync0, 0u);
}

// II, "SyncManager length (0x0802)": a length of 1 only triggers the watchdog.
TEST_F(StrictEsc, ASyncManagerOfOneOctetOnlyTriggersTheWatchdog) {
    build();
    set_sm(2, 0x1000, 1, 0x64);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 0) << "the watchdog waits for the first trigger";
    EXPECT_EQ(rig.write(0, 0x1000, bytes({0x11})).wkc, 1);
    EXPECT_EQ(events() & al_event::sync_manager(2), 0u);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0815), 0x30) << "no buffer was written";
    EXPECT_EQ(rig.pdi_get<std::uint8_t>(0, 0x1000), 0x11) << "plain memory";
    rig.pdi_put<std::uint8_t>(0, 0x1000, 0x22);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x1000), 0x22) << "both sides read and write it";
    rig.pass(101ms);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 0) << "expired";
    EXPECT_EQ(rig.write(0, 0x0FFE, bytes({0, 0, 0x33})).wkc, 1) << "a longer write that contains the octet";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 1);
}

// Buffers are in the process RAM, and the digital outputs may have a SyncManager. A SyncManager over other registers
// has no effect.
TEST_F(StrictEsc, ASyncManagerOverRegistersHasNoEffect) {
    build();
    const auto move = [&](std::uint16_t start, std::uint16_t length, unsigned control) {
        EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0816, 0), 1);
        set_sm(2, start, length, control);
    };
    for (const unsigned control : {0x64u, 0x26u, 0x20u}) {
        move(0x0120, 2, control);
        EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0001), 1) << "the master still requests states";
        EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0120), 1) << "and reads them";
        EXPECT_EQ(rig.pdi_get<std::uint16_t>(0, 0x0120), 1);
        EXPECT_EQ(events() & al_event::sync_manager(2), 0u);
        EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0815) & 0x0F, 0) << "nothing was handed over";
    }
    move(0x0420, 1, 0x64);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 1) << "no SyncManager triggers the watchdog";
    move(0x0F00, 2, 0x44);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 0) << "the watchdog waits for the first trigger";
    EXPECT_EQ(rig.write(0, 0x0F00, bytes({1, 2})).wkc, 1);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0440), 1) << "the digital outputs trigger it";
}

// I, "FMMU": bit-wise writing works for the digital outputs 0x0F00–0x0F03 only.
TEST_F(StrictEsc, BitsBesideABitWiseWriteAreKeptInDigitalOutputsOnly) {
    build();
    const auto write_bits = [&](std::uint16_t physical) {
        std::vector<std::byte> raw(16);
        wire::store_fmmu(raw, {{0x10000}, 1, 0, 3, physical, 2, false, true, true});
        EXPECT_EQ(rig.write(0, reg::fmmu(0).address, raw).wkc, 1);
        EXPECT_EQ(rig.send(Command::LWR, wire::DatagramAddress(LogicalAddress{0x10000}), bytes({0x0F})).wkc, 1);
        return std::to_integer<unsigned>(rig.slave(0).peek(physical, 1)[0]);
    };
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0F00, 0x81), 1);
    EXPECT_EQ(write_bits(0x0F00), 0xBDu);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x1000, 0x81), 1);
    const auto octet = write_bits(0x1000);
    EXPECT_EQ(octet & 0x3Cu, 0x3Cu) << "the mapped bits";
    EXPECT_NE(octet & 0xC3u, 0x81u) << "the others";
}

// II, "Cyclic unit control (0x0980)" bits 4 and 5: "latch interrupt is routed to ECAT or PDI depending on this
// setting".
TEST_F(StrictEsc, LatchEventsGoToTheSideThatControlsTheInput) {
    build(0x00);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0980, 0x20), 1);  // input 0: master, input 1: PDI
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x09A8, 0x03), 1);
    (void)rig.put<std::uint8_t>(0, 0x09A9, 0x03);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x09A9), 0) << "the PDI's";
    rig.pdi_put<std::uint8_t>(0, 0x09A9, 0x03);
    rig.pdi_put<std::uint8_t>(0, 0x09A8, 0x00);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x09A8), 0x03) << "the master's";
    rig.slave(0).latch(0, true, rig.now);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 1);
    EXPECT_EQ(events() & al_event::kDcLatch, 0u);
    rig.slave(0).latch(1, true, rig.now);
    EXPECT_EQ(events() & al_event::kDcLatch, al_event::kDcLatch);
    (void)rig.get<std::uint64_t>(0, 0x09C0);
    EXPECT_EQ(events() & al_event::kDcLatch, al_event::kDcLatch) << "read by the wrong side";
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x09AF) & 1, 1);
    (void)rig.pdi_get<std::uint64_t>(0, 0x09B0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 1) << "read by the wrong side";
    (void)rig.pdi_get<std::uint64_t>(0, 0x09C0);
    EXPECT_EQ(events() & al_event::kDcLatch, 0u);
    (void)rig.get<std::uint64_t>(0, 0x09B0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 1, 0);
}

// II, "Activation (0x0981)" bits 3 to 7, if bit 8 of the features register is set.
TEST_F(StrictEsc, TheStartTimeActivatesTheUnit) {
    build();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0x0A), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x09A0, 1'000'000), 1);
    rig.pass(10ms);
    EXPECT_EQ(pulses(0), 0u);
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0990, copy() + 1'000'000), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0981), 0x0B);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 5u);
}

TEST_F(StrictEsc, AStartTimeOf32BitsIsExtended) {
    build();
    EXPECT_EQ(rig.put<std::uint64_t>(0, 0x0920, 0x123'0000'0000), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x09A0, 1'000'000), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0x1A), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x0990, static_cast<std::uint32_t>(copy() + 1'000'000)), 1);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0990) >> 32, 0x123u);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 5u);
}

TEST_F(StrictEsc, AnImplausibleStartTimeStartsAtOnce) {
    build();
    start_sync(-1ms, 1'000'000, 0x03);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 0u) << "without the check a start time in the past never comes";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0), 1);
    start_sync(-1ms, 1'000'000, 0x23);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 6u);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0), 1);
    start_sync(10s, 1'000'000, 0x23);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 6u) << "half of the width of the clock is near";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0), 1);
    start_sync(10s, 1'000'000, 0x63);
    rig.pass(5500us);
    EXPECT_EQ(pulses(0), 12u) << "more than 2.1 s is not";
}

TEST_F(StrictEsc, TheDebugPulseComesOnceAndReadsAsZero) {
    build();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0x86), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0981), 0x06);
    EXPECT_EQ(pulses(0), 1u);
    EXPECT_EQ(pulses(1), 1u);
    EXPECT_EQ(events() & 0x0C, 0x04u) << "SYNC0 is mapped";
    rig.pass(10ms);
    EXPECT_EQ(pulses(0), 1u);
}

TEST_F(StrictEsc, AChipWithoutTheFeatureHasNoEnhancedActivation) {
    build(0x0C, 0, et1100());
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0981, 0xFE), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0981), 0x06);
    EXPECT_EQ(pulses(0), 0u);
}

// I, "Loop control": "auto close" opens again by a valid frame at the closed port.
TEST(PortRecovery, AValidFrameOpensAnAutoClosedPort) {
    Rig rig;
    for (int n = 0; n < 2; ++n) rig.add(junction(), sii_image(kEmulationWithDc));
    EXPECT_TRUE(rig.segment.connect_master({1, 1}, 1));
    rig.on();
    const auto count = [&](unsigned port) {
        return rig.frame({{Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})}}, port).at(0).wkc;
    };
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x04), 1);  // port 1 of the first slave: auto close
    rig.segment.set_cable({1, 0}, false);
    rig.segment.set_cable({1, 0}, true);
    EXPECT_EQ(count(0), 1) << "closed";
    rig.segment.corrupt_next({0, 1});
    (void)count(1);
    EXPECT_EQ(count(0), 1) << "a damaged frame opens nothing";
    (void)count(1);
    EXPECT_EQ(count(0), 2) << "a valid frame does";
}

// I: "If all ports are closed, port 0 is opened as recovery port"; DL status shows it closed.
TEST(PortRecovery, ASlaveWithAllPortsClosedIsReachedByPort0) {
    Rig rig;
    for (int n = 0; n < 2; ++n) rig.add(junction(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0xFF), 1);
    const auto reply = rig.read(0, 0x0110, 2);
    EXPECT_TRUE(reply.returned);
    ASSERT_EQ(reply.wkc, 1) << "the first slave alone";
    EXPECT_EQ(reply.as<std::uint16_t>() & 0x5500, 0x5500) << "all loops closed";
    EXPECT_EQ(rig.read(1, 0x0110, 2).wkc, 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x00), 1);
    EXPECT_EQ(rig.read(1, 0x0110, 2).wkc, 1);
}

TEST_F(StrictEsc, TheUpperOctetOfAlControlReleasesItToo) {
    build();
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 2), 1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 4), 0);
    (void)rig.pdi_get<std::uint8_t>(0, 0x0121);
    EXPECT_EQ(events() & al_event::kAlControl, 0u);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 4), 1);
}

TEST_F(StrictEsc, EachChangedActivationMustBeRead) {
    build();
    set_sm(4, 0x1400, 4, 0x20);
    set_sm(5, 0x1500, 4, 0x20);
    (void)rig.pdi_get<std::uint8_t>(0, 0x0826);
    EXPECT_EQ(events() & al_event::kSmActivation, al_event::kSmActivation);
    (void)rig.pdi_get<std::uint8_t>(0, 0x082E);
    EXPECT_EQ(events() & al_event::kSmActivation, 0u);
}

// II, 0x09F0, 0x09F8, 0x09FC: local times of buffer events.
TEST_F(StrictEsc, TimesOfBufferEventsAreLocalTimes) {
    build();
    const auto local = [&] { return static_cast<std::uint32_t>(rig.slave(0).clock().local(rig.now)); };
    set_sm(2, 0x1000, 4, 0x24);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x09F0), 0u) << "nothing yet";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 7), 1);
    const auto changed = local();
    rig.pass(3ms);
    EXPECT_NEAR(rig.get<std::uint32_t>(0, 0x09F0), changed, 1000) << "the frame";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x09F8), 0u);
    (void)rig.pdi_get<std::uint8_t>(0, 0x1000);
    const auto started = local();
    rig.pass(2ms);
    (void)rig.pdi_get<std::uint8_t>(0, 0x1003);
    const auto finished = local();
    rig.pass(2ms);
    EXPECT_NEAR(rig.get<std::uint32_t>(0, 0x09F8), started, 1000);
    EXPECT_NEAR(rig.get<std::uint32_t>(0, 0x09FC), finished, 1000);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x09F0, 0), 0) << "read only";
}

}  // namespace
}  // namespace margay::sim::test
