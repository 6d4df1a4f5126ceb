// AL control and status, PDI, event masks and requests. ETG.1000.4 sections "AL control, status", "Event parameters";
// ET1100 data sheet II, "Application layer", "PDI", "Interrupts".
#include "rig.hpp"

#include "wire/sync_manager.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct Processor : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add_with_processor(et1100());
        rig.on();
        rig.pass(1ms);
    }
    IdleFirmware& firmware() { return static_cast<IdleFirmware&>(*rig.slave(0).firmware()); }
    std::uint32_t al_events() { return rig.get<std::uint32_t>(0, 0x0220); }
    std::uint16_t ecat_events() { return rig.get<std::uint16_t>(0, 0x0210); }
    void set_sm(unsigned n, std::uint16_t start, std::uint16_t length, unsigned control, unsigned activate = 1) {
        const auto low = [](unsigned v) { return v & 0xFF; };
        EXPECT_EQ(rig.write(0, reg::sync_manager(n).address,
                            bytes({low(start), start / 256u, low(length), length / 256u, control, 0, activate, 0}))
                      .wkc,
                  1);
    }
};

// ET1100 data sheet II, table "Register AL Control (0x0120:0x0121)": "behaves like a mailbox if device emulation is
// off".
TEST_F(Processor, AlControlIsFullUntilThePdiHasReadIt) {
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0002), 1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0004), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0120), 0x0002);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0130), 0x0001) << "the status is the processor's business";
    EXPECT_EQ(rig.pdi_get<std::uint16_t>(0, 0x0120), 0x0002);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0004), 1);
}

// Table "AL event request (0x0220)" bit 0: AL control event, "cleared by reading AL control from PDI".
TEST_F(Processor, AlControlEventComesAndGoes) {
    const auto before = firmware().steps;
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0002), 1);
    EXPECT_EQ(al_events() & 1, 1u);
    rig.pass(1ms);
    EXPECT_GT(firmware().steps, before) << "the event has woken the firmware";
    EXPECT_EQ(al_events() & 1, 1u) << "read by the master it stays";
    (void)rig.pdi_get<std::uint16_t>(0, 0x0120);
    EXPECT_EQ(al_events() & 1, 0u);
}

// Table "ECAT event request (0x0210)" bit 3: AL status, "cleared by reading out AL status 0x0130:0x0131 from ECAT".
TEST_F(Processor, AlStatusRaisesTheEcatEvent) {
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0130, 0x0002), 0) << "the PDI's";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0134, 0x0011), 0);
    rig.pdi_put<std::uint16_t>(0, 0x0134, 0x0016);
    rig.pdi_put<std::uint16_t>(0, 0x0130, 0x0012);
    EXPECT_EQ(ecat_events() & 0x0008, 0x0008);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0130), 0x0012);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0134), 0x0016);
    EXPECT_EQ(ecat_events() & 0x0008, 0);
}

// Table "ECAT event mask (0x0200:0x0201)": the IRQ field of datagrams contains request AND mask.
TEST_F(Processor, MaskedEcatEventsAreInTheIrqField) {
    rig.pdi_put<std::uint16_t>(0, 0x0130, 0x0002);
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0) << "the mask is 0 after power-up";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0200, 0x0008), 1);
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0x0008);
    (void)rig.get<std::uint16_t>(0, 0x0130);
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0);
}

// The events of all slaves are ORed.
TEST(EcatEvents, OfAllSlavesAreOred) {
    Rig rig;
    for (int i = 0; i < 3; ++i) rig.add_with_processor(et1100());
    rig.on();
    rig.pass(1ms);
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0200}, bytes({0x0F, 0x00})).wkc, 3);
    (void)rig.send(Command::BRD, {std::uint16_t{0}, 0x0110}, bytes({0, 0}));  // clears the DL status events of power-up
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0);
    rig.pdi_put<std::uint16_t>(2, 0x0130, 0x0002);
    rig.segment.set_cable({2, 0}, false);
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0x0004) << "the second slave has lost a link, the third is gone";
    rig.segment.set_cable({2, 0}, true);
    EXPECT_EQ(rig.read(0, 0x0000, 1).header.irq, 0x000C);
}

// Bit 2: DL status event, "cleared by reading out DL status 0x0110:0x0111 from ECAT".
TEST(EcatEvents, LinkChangeRaisesTheDlStatusEvent) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    (void)rig.get<std::uint16_t>(0, 0x0110);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 4, 0);
    rig.segment.set_cable({1, 0}, false);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 4, 4);
    (void)rig.get<std::uint16_t>(0, 0x0110);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 4, 0);
}

// Bits 4 to 11: SyncManager 0 to 7, if enabled in its control octet (bit 4: interrupt in ECAT).
TEST_F(Processor, SyncManagersRaiseEcatEvents) {
    set_sm(1, 0x1100, 4,
           wire::sm_control::kModeMailbox | wire::sm_control::kEcatReads | wire::sm_control::kEcatInterrupt);
    EXPECT_EQ(ecat_events() & 0x0FF0, 0);
    rig.pdi_put<std::uint32_t>(0, 0x1100, 1);
    EXPECT_EQ(ecat_events() & 0x0FF0, 0x0020);
    (void)rig.get<std::uint32_t>(0, 0x1100);
    EXPECT_EQ(ecat_events() & 0x0FF0, 0);
}

// Table "AL event request" bits 8 to 23: SyncManager 0 to 15, if enabled in its control octet (bit 5: interrupt in
// PDI).
TEST_F(Processor, SyncManagersRaiseAlEvents) {
    set_sm(0, 0x1000, 4,
           wire::sm_control::kModeMailbox | wire::sm_control::kEcatWrites | wire::sm_control::kPdiInterrupt);
    set_sm(2, 0x1200, 4, wire::sm_control::kModeBuffered | wire::sm_control::kEcatWrites);  // without interrupt
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 7), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1200, 7), 1);
    EXPECT_EQ(al_events() & 0x00FFFF00, 0x00000100u);
    (void)rig.pdi_get<std::uint8_t>(0, 0x0805);
    EXPECT_EQ(al_events() & 0x00FFFF00, 0x00000100u) << "reading the status is not opening the buffer";
    (void)rig.pdi_get<std::uint8_t>(0, 0x1000);
    EXPECT_EQ(al_events() & 0x00FFFF00, 0u) << "the first octet is";
}

// Bit 4: "SyncManager activation register changed; cleared by reading SyncManager activation registers from PDI".
TEST_F(Processor, ActivationRaisesAnAlEvent) {
    set_sm(3, 0x1100, 4, 0x20);
    EXPECT_EQ(al_events() & 0x10, 0x10u);
    (void)rig.pdi_get<std::uint8_t>(0, 0x0805);
    EXPECT_EQ(al_events() & 0x10, 0x10u);
    (void)rig.pdi_get<std::uint8_t>(0, 0x081E);
    EXPECT_EQ(al_events() & 0x10, 0u);
    (void)rig.put<std::uint16_t>(0, 0x0818, 0x1200);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0818), 0x1100) << "locked while it is on";
    EXPECT_EQ(al_events() & 0x10, 0u);
}

// Table "AL event mask (0x0204:0x0207)": writable by the PDI only, reset value 0x00FFFF0F.
TEST_F(Processor, AlEventMaskIsThePdis) {
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0204), 0x00FFFF0Fu);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x0204, 0), 0);
    rig.pdi_put<std::uint32_t>(0, 0x0204, 0x00000101);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0204), 0x00000101u);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x0220, 0), 0) << "requests are read only";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0210, 0), 0);
}

// Table "PDI control (0x0140)", "ESC configuration (0x0141)", "PDI configuration": loaded from the SII, read only.
TEST(Pdi, IsConfiguredByTheSii) {
    auto image = sii_image(kProcessor);
    store_le<std::uint16_t>(image, 2, 0x3412);
    store_le<std::uint16_t>(image, 4, 0x00C8);
    store_le<std::uint16_t>(image, 6, 0x7856);
    image[14] = std::byte{wire::sii::checksum(image)};
    Rig rig;
    rig.add_with_processor(et1100(), image);
    rig.on();
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0140), kProcessor);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0150), 0x3412);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0152), 0x7856);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0982), 0x00C8) << "pulse length of SYNC signals, in 10 ns";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0140, 0), 0);
}

// masters-on-the-wire: a slave with device emulation copies every write to AL control, including the acknowledge bit,
// to AL status.
TEST(Pdi, DeviceEmulationMirrorsTheAcknowledgeBit) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0120, 0x11), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0130), 0x11);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0120, 0x02), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0130), 0x02);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0008), 1) << "never full";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0120, 0x0001), 1);
}

}  // namespace
}  // namespace margay::sim::test
