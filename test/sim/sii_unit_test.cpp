// The SII EEPROM interface. ETG.1000.4 "Slave information interface"; ET1100 data sheet II, tables "EEPROM
// configuration (0x0500)" … "EEPROM data (0x0508:0x050F)".
#include "rig.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;
namespace control = wire::sii_control;

struct SiiUnitTest : testing::Test {
    Rig rig;
    void power(EscDescription chip, std::vector<std::byte> image = sii_image(kProcessor)) {
        rig.add_with_processor(chip, std::move(image));
        rig.on();
    }
    std::uint16_t status() { return rig.get<std::uint16_t>(0, 0x0502); }
    void command(unsigned low, unsigned high, std::uint32_t word, unsigned data = 0) {
        const auto b = [&](unsigned n) { return word >> (8 * n) & 0xFF; };
        EXPECT_EQ(rig.write(0, 0x0502, bytes({low, high, b(0), b(1), b(2), b(3), data & 0xFF, data >> 8})).wkc, 1);
    }
    std::uint16_t result() {
        rig.pass(10ms);
        return status();
    }
};

TEST_F(SiiUnitTest, ReadsEightOctets) {
    power(et1100());
    EXPECT_EQ(status(), 0x0040);
    command(0, 1, 0x10);
    EXPECT_EQ(status(), 0x8140) << "busy, reading";
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0508), 0xA013A012A011A010u);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0504), 0x10u) << "the address stays";
}

TEST_F(SiiUnitTest, ReadsFourOctetsWhereTheChipDoes) {
    power(ip_core());
    EXPECT_EQ(status(), 0x0000);
    command(0, 1, 0x10);
    EXPECT_EQ(result(), 0x0000);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0508), 0x00000000A011A010u);
}

// masters-on-the-wire: IgH writes 4 octets and reads status, address and data in one read of 10 octets.
TEST_F(SiiUnitTest, StatusAddressAndDataInOneRead) {
    power(ip_core());
    EXPECT_EQ(rig.write(0, 0x0502, bytes({0x80, 0x01, 0x12, 0x00})).wkc, 1);
    rig.pass(10ms);
    EXPECT_EQ(rig.read(0, 0x0502, 10).data, bytes({0x00, 0x00, 0x12, 0, 0, 0, 0x12, 0xA0, 0x13, 0xA0}));
}

TEST_F(SiiUnitTest, BehindTheEndItReadsAsErased) {
    power(et1100(), sii_image(kProcessor, 0, 256));
    command(0, 1, 0x7E);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0508), 0xFFFFFFFFA07FA07Eu);
}

// Bit 15: commands, address and data are locked while busy.
TEST_F(SiiUnitTest, IsLockedWhileBusy) {
    auto chip = et1100();
    chip.sii.read = 1ms;
    power(chip);
    command(0, 1, 0x10);
    (void)rig.put<std::uint32_t>(0, 0x0504, 0x20);
    command(0, 1, 0x30);
    EXPECT_EQ(status(), 0x8140);
    rig.pass(1ms);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xA010);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0504), 0x10u);
}

// Recorded on an EK1100: the interface is busy until 0.3 ms after a write command, and no command is acknowledged
// until 3.8 ms.
TEST_F(SiiUnitTest, AcknowledgesNothingWhileTheEepromStoresAWord) {
    power(et1100());
    command(1, 2, 0x40, 0xBEEF);
    EXPECT_EQ(status() & (control::kBusy | control::kCommandWrite), control::kBusy | control::kCommandWrite);
    rig.pass(320us);
    EXPECT_EQ(status(), 0x0040) << "the enable bit has cleared itself";
    command(0, 1, 0x40);
    rig.pass(200us);
    EXPECT_EQ(status(), 0x2040);
    command(1, 2, 0x41, 0xDEAD);
    rig.pass(200us);
    EXPECT_EQ(status(), 0x2040);
    rig.pass(3ms);
    command(0, 1, 0x40);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xBEEF);
    EXPECT_EQ(load_le<std::uint16_t>(rig.slave(0).sii().image(), 0x82), 0xA041) << "that write was lost";
}

TEST_F(SiiUnitTest, AnInterfaceMayStayBusyUntilTheWordIsStored) {
    auto chip = et1100();
    chip.sii.write = 3ms;
    chip.sii.write_busy = 3ms;
    power(chip);
    command(1, 2, 0x40, 0xBEEF);
    rig.pass(2500us);
    EXPECT_NE(status() & control::kBusy, 0);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(load_le<std::uint16_t>(rig.slave(0).sii().image(), 0x80), 0xBEEF);
}

// Bit 14: write without enable.
TEST_F(SiiUnitTest, WriteWithoutEnableIsAnError) {
    power(et1100());
    command(0, 2, 0x40, 0xBEEF);
    EXPECT_EQ(result(), 0x4040);
    EXPECT_EQ(load_le<std::uint16_t>(rig.slave(0).sii().image(), 0x80), 0xA040);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0502, 1), 1) << "in a frame before, it does not count";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0503, 2), 1);
    EXPECT_EQ(result(), 0x4040);
    command(0, 0, 0x40);
    EXPECT_EQ(status(), 0x0040) << "the command 'nothing' clears the error";
}

// Bit 13: missing acknowledge of the EEPROM, or an invalid command.
TEST_F(SiiUnitTest, MissingAcknowledgeIsShownUntilTheNextCommand) {
    power(et1100());
    rig.slave(0).sii().fail_next(1);
    command(0, 1, 0x10);
    EXPECT_EQ(result(), 0x2040);
    command(0, 1, 0x10);
    EXPECT_EQ(result(), 0x0040);
    command(0, 3, 0x10);
    EXPECT_EQ(result(), 0x2040) << "reading and writing at once";
}

TEST_F(SiiUnitTest, WritesBehindTheEndAreNotAcknowledged) {
    power(et1100(), sii_image(kProcessor, 0, 256));
    command(1, 2, 0x80, 1);
    EXPECT_EQ(result(), 0x2040);
}

// Bits 11 and 12: checksum of words 0 to 7 wrong, device information not loaded; DL status bit 0 is 0.
TEST_F(SiiUnitTest, WrongChecksumLeavesTheConfigurationAlone) {
    auto image = sii_image(kProcessor, 0x0077);
    image[14] ^= std::byte{1};
    power(et1100(), image);
    EXPECT_EQ(status(), 0x1840);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0140), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0012), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110) & 1, 0);
    command(0, 1, 0x00);
    EXPECT_EQ(result(), 0x1840) << "it can be read all the same";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), kProcessor);
    // Corrected and reloaded: command 4.
    command(1, 2, 0x07, wire::sii::checksum(rig.slave(0).sii().image()));
    rig.pass(10ms);
    command(0, 4, 0);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0140), kProcessor);
}

// ESC data sheets, DL status bit 0: the PDI does not work without a loaded EEPROM. No program executes, AL control
// gets no answer, and there is no emulation. Registers and memory work.
TEST_F(SiiUnitTest, WithAWrongChecksumThePdiDoesNotWorkAndTheAlStatusStays) {
    for (const std::uint16_t pdi : {kProcessor, kEmulationWithDc}) {
        Rig own;
        auto image = sii_image(pdi);
        image[14] ^= std::byte{1};
        own.add_with_processor(et1100(), image);
        own.on();
        auto& program = dynamic_cast<IdleFirmware&>(*own.slave(0).firmware());
        EXPECT_EQ(program.starts, 0U);
        EXPECT_EQ(own.put<std::uint16_t>(0, 0x0120, 2), 1);
        own.pass(1s);
        EXPECT_EQ(own.get<std::uint16_t>(0, 0x0130), 1);
        EXPECT_EQ(program.steps, 0U);
        EXPECT_EQ(own.put<std::uint16_t>(0, 0x1000, 0xBEEF), 1);
        EXPECT_EQ(own.get<std::uint16_t>(0, 0x1000), 0xBEEF);
        // Corrected and reloaded: the program starts.
        own.slave(0).sii().image()[14] ^= std::byte{1};
        EXPECT_EQ(own.put<std::uint16_t>(0, 0x0502, 0x0400), 1);
        own.pass(10ms);
        EXPECT_EQ(own.get<std::uint16_t>(0, 0x0502), 0x0040);
        EXPECT_EQ(program.starts, 1U);
        EXPECT_EQ(own.get<std::uint16_t>(0, 0x0110) & 1, 1);
    }
}

// A reload loads the whole area except the alias, which is loaded at power-up only.
TEST_F(SiiUnitTest, ReloadTakesAllButTheAlias) {
    power(et1100(), sii_image(kProcessor, 0x0077));
    auto changed = sii_image(0x0C05, 0x0099);
    rig.slave(0).sii().image() = changed;
    command(0, 4, 0);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0140), 0x0C05);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0012), 0x0077);
    rig.segment.set_power(0, false, rig.now);
    rig.segment.set_power(0, true, rig.now);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0012), 0x0099);
}

// 0x0500 bit 0 offers the interface to the PDI. The PDI takes it with 0x0501 bit 0. With 0x0500 bit 1 the master gets
// it back by force.
TEST_F(SiiUnitTest, BelongsToOneSideAtATime) {
    power(et1100());
    rig.pdi_put<std::uint8_t>(0, 0x0501, 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0501), 0) << "not offered";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0500, 1), 1);
    command(0, 1, 0x10);
    EXPECT_EQ(result(), 0x0040) << "offered, not taken: the master still may";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xA010);
    rig.pdi_put<std::uint8_t>(0, 0x0501, 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0501), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0501, 0), 0) << "read only for the master";
    command(0, 1, 0x20);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xA010) << "ignored";
    rig.pdi_put<std::uint32_t>(0, 0x0504, 0x30);
    rig.pdi_put<std::uint16_t>(0, 0x0502, 0x0100);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.pdi_get<std::uint16_t>(0, 0x0508), 0xA030) << "the PDI's command";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0500, 2), 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0501), 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0500, 0), 1);
    command(0, 1, 0x20);
    EXPECT_EQ(result(), 0x0040);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xA020);
}

// masters-on-the-wire: KickCAT reads the EEPROM of all slaves at once.
TEST(SiiBroadcast, AllSlavesReadAtOnce) {
    Rig rig;
    for (int i = 0; i < 3; ++i) rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0502}, bytes({0x00, 0x01, 0x08, 0, 0, 0})).wkc, 3);
    EXPECT_EQ(rig.send(Command::BRD, {std::uint16_t{0}, 0x0502}, bytes({0, 0})).as<std::uint16_t>(), 0x8140);
    rig.pass(10ms);
    EXPECT_EQ(rig.send(Command::BRD, {std::uint16_t{0}, 0x0502}, bytes({0, 0})).as<std::uint16_t>(), 0x0040);
    for (std::uint16_t n = 0; n < 3; ++n) EXPECT_EQ(rig.get<std::uint16_t>(n, 0x0508), 0xA008);
}

// EEPROM emulation, ESC data sheets I, "EEPROM emulation": the command waits for the PDI (AL event bit 5). The PDI
// writes the data, then writes the command back to 0x0502.
struct Emulation : SiiUnitTest {
    void SetUp() override {
        auto chip = ip_core();
        chip.sii.emulated = true;
        chip.sii.reads_8_bytes = true;
        power(chip);
    }
};

TEST_F(Emulation, TheProcessorAnswersReads) {
    EXPECT_EQ(status(), 0x0060);
    command(0, 1, 0x10);
    rig.pass(1s);
    EXPECT_EQ(status(), 0x8160) << "busy until it does";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x20, 0x20u);
    EXPECT_EQ(rig.pdi_get<std::uint32_t>(0, 0x0504), 0x10u);
    rig.pdi_put<std::uint64_t>(0, 0x0508, 0x1122334455667788u);
    EXPECT_NE(status() & control::kBusy, 0);
    rig.pdi_put<std::uint16_t>(0, 0x0502, 0x0100);
    EXPECT_EQ(status(), 0x0060);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x20, 0u);
    EXPECT_EQ(rig.get<std::uint64_t>(0, 0x0508), 0x1122334455667788u);
}

TEST_F(Emulation, TheProcessorMayRefuse) {
    command(1, 2, 0x10, 0xBEEF);
    EXPECT_EQ(rig.pdi_get<std::uint16_t>(0, 0x0508), 0xBEEF);
    rig.pdi_put<std::uint16_t>(0, 0x0502, 0x2200);
    EXPECT_EQ(status(), 0x2060);
}

}  // namespace
}  // namespace margay::sim::test
