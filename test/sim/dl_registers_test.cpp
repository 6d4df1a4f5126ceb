// Data link registers: ESC information, addresses, write protection, DL control and status, reset. ETG.1000.4 section
// "DL attributes"; ET1100 data sheet section II, "ESC information" to "Data link layer".
#include "rig.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

// ET1100 data sheet II, tables "Register Type (0x0000)" … "Register ESC features supported (0x0008:0x0009)".
TEST(DlInformation, TellsWhatTheChipIs) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(lan9252(), sii_image(kProcessor));
    rig.on();
    // Type, revision, build, FMMUs, SMs, KiB of RAM, ports (MII, E-bus, MII, none), features.
    EXPECT_EQ(rig.read(0, 0x0000, 10).data, bytes({0x11, 0x00, 0x03, 0x00, 8, 8, 8, 0x3B, 0xFC, 0x00}));
    EXPECT_EQ(rig.read(1, 0x0000, 10).data, bytes({0xC0, 0x02, 0x00, 0x00, 3, 4, 4, 0x1F, 0xCC, 0x01}));
    EXPECT_EQ(rig.write(0, 0x0000, bytes({1, 2, 3})).wkc, 0) << "read only";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0007), 0xFC3B) << "a word at an odd address, as TwinCAT reads it";
}

// Recorded: after power-up 0x0102 is C7 on chips with E-bus (samples/Fidelity.DlControlAfterPowerUp), 07 on an IP
// core.
TEST(DlInformation, DlControlAfterPowerUpDependsOnTheChip) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(ip_core(), sii_image(kProcessor));
    rig.add(lan9252(), sii_image(kProcessor));
    rig.on();
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0100), 0x00C70001U);
    EXPECT_EQ(rig.get<std::uint32_t>(1, 0x0100), 0x00070001U);
    EXPECT_EQ(rig.get<std::uint32_t>(2, 0x0100), 0x00070001U);
}

// ETG.1000.4 table "Configured station address", "Configured station alias".
TEST(StationAddress, IsTheMastersAndTheAliasThePdis) {
    Rig rig;
    rig.add_with_processor(et1100(), sii_image(kProcessor, 0x0077));
    rig.on();
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0) << "none after power-up";
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x1001), 1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0012, 0x0099), 0) << "read only for the master";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0012), 0x0077);
    rig.pdi_put<std::uint16_t>(0, 0x0010, 0x2222);
    rig.pdi_put<std::uint16_t>(0, 0x0012, 0x0099);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0x1001) << "read only for the PDI";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0012), 0x0099);
    // 0x0100 bit 24: the alias is also used for all commands with configured addressing.
    const auto by = [&](std::uint16_t address) {
        return rig.send(Command::FPRD, {StationAddress{address}, 0x0000}, bytes({0})).wkc;
    };
    EXPECT_EQ(by(0x1001), 1);
    EXPECT_EQ(by(0x0099), 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0103, 1), 1);
    EXPECT_EQ(by(0x0099), 1);
    EXPECT_EQ(by(0x1001), 1);
    rig.pdi_put<std::uint16_t>(0, 0x0012, 0x0100);
    EXPECT_EQ(by(0x0099), 0);
    EXPECT_EQ(by(0x0100), 1);
}

// ET1100 data sheet II, tables "Write Register Enable (0x0020)" … "ESC Write Protection (0x0031)".
TEST(WriteProtection, RegistersNeedTheEnableInTheSameFrame) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0021, 1), 1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x1001), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0021, 0), 0) << "the protection protects itself";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0F80, 0x55), 1) << "user RAM and process memory are not registers";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x1000, 0x55), 1);
    const auto replies =
        rig.frame({{Command::APWR, {RingPosition{0}, 0x0020}, bytes({0xAB})},  // the value does not matter
                   {Command::APWR, {RingPosition{0}, 0x0010}, bytes({0x01, 0x10})}});
    EXPECT_EQ(replies.at(0).wkc, 1);
    EXPECT_EQ(replies.at(1).wkc, 1);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0x1001);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x2002), 0) << "protected again in the next frame";
    EXPECT_EQ(rig.frame({{Command::APWR, {RingPosition{0}, 0x0020}, bytes({0})},
                         {Command::APWR, {RingPosition{0}, 0x0021}, bytes({0})}})
                  .at(1)
                  .wkc,
              1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x2002), 1);
}

TEST(WriteProtection, OfTheWholeEscCoversItsMemory) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0031, 1), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x1000, 0x55), 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0F80, 0x55), 0);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x1001), 0);
    EXPECT_EQ(rig.frame({{Command::APWR, {RingPosition{0}, 0x0030}, bytes({0})},
                         {Command::APWR, {RingPosition{0}, 0x1000}, bytes({0x66})}})
                  .at(1)
                  .wkc,
              1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x1000), 0x66);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x1000, 0x77), 0);
    // The write protection covers buffers of SyncManagers, accessed by address and by an FMMU.
    (void)rig.frame(
        {{Command::APWR, {RingPosition{0}, 0x0030}, bytes({0})},
         {Command::APWR, {RingPosition{0}, 0x0800}, bytes({0x00, 0x11, 2, 0, 0x24, 0, 1, 0})},
         {Command::APWR, {RingPosition{0}, 0x0600}, bytes({0, 0, 0, 0, 2, 0, 0, 7, 0x00, 0x11, 0, 2, 1, 0, 0, 0})}});
    const wire::DatagramAddress logical{LogicalAddress{0}};
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x1100, 0x7777), 0);
    EXPECT_EQ(rig.send(Command::LWR, logical, bytes({1, 2})).wkc, 0);
    EXPECT_EQ(
        rig.frame({{Command::APWR, {RingPosition{0}, 0x0030}, bytes({0})}, {Command::LWR, logical, bytes({1, 2})}})
            .at(1)
            .wkc,
        1);
}

// ET1100 data sheet II, table "Register ESC Reset ECAT (0x0040)": R, E, S in consecutive frames; a read shows the
// progress.
TEST(Reset, NeedsThreeLettersInOrder) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc, 0x0077));
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, 0x1001), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x0C), 1) << "port 1 closed: the second slave is gone";
    EXPECT_EQ(rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).wkc, 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0040), 0);
    (void)rig.put<std::uint8_t>(0, 0x0040, 'R');
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0040), 1);
    (void)rig.put<std::uint8_t>(0, 0x0040, 'S');
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0040), 0) << "out of order";
    (void)rig.put<std::uint8_t>(0, 0x0040, 'R');
    (void)rig.put<std::uint8_t>(0, 0x0040, 'E');
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0040), 2);
    (void)rig.put<std::uint8_t>(0, 0x0040, 'S');
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0) << "as after power-up";
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0101), 0);
    EXPECT_EQ(rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).wkc, 2) << "and its ports too";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110), 0x5A31);
}

// ETG.1000.4 table "DL control": loop control of port 0 in bits 8 and 9, of the next ports in the next bits. Table "DL
// status": link in bits 4 to 7; loop and communication in two bits per port from bit 8.
TEST(DlControl, LoopsAreAutomaticOpenOrClosed) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    const auto count = [&] { return rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).wkc; };
    const auto status = [&] { return rig.get<std::uint16_t>(0, 0x0110); };
    EXPECT_EQ(count(), 2);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x0C), 1);  // port 1 closed
    EXPECT_EQ(count(), 1);
    EXPECT_EQ(status(), 0x5631) << "link at ports 0 and 1, loop of 1 closed, communication at 0 only";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x00), 1);  // automatic again
    EXPECT_EQ(count(), 2);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x20),
              1);  // port 2 open without a link: frames that leave do not return
    rig.segment.advance(rig.now);
    EXPECT_FALSE(rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).returned);
}

// "Auto close": the port opens at link-up only when the master writes the loop control again.
TEST(DlControl, AutoCloseStaysClosedUntilWritten) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    const auto count = [&] { return rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).wkc; };
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x04), 1);  // port 1: auto close
    EXPECT_EQ(count(), 2);
    rig.segment.set_cable({1, 0}, false);
    EXPECT_EQ(count(), 1);
    rig.segment.set_cable({1, 0}, true);
    EXPECT_EQ(count(), 1) << "the link is back, the port stays closed";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110), 0x5631);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0101, 0x04), 1);
    EXPECT_EQ(count(), 2);
}

// 0x0100 bit 1: "temporary use of settings: use for about 1 second, then the settings before".
TEST(DlControl, TemporaryLoopsLastASecond) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    const auto count = [&] { return rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})).wkc; };
    EXPECT_EQ(rig.write(0, 0x0100, bytes({0x03, 0x0C})).wkc, 1);
    EXPECT_EQ(count(), 1);
    rig.pass(900ms);
    EXPECT_EQ(count(), 1);
    rig.pass(101ms);
    EXPECT_EQ(count(), 2);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0100), 0x0001);
}

// ETG.1000.4 table "DL control" bit 0: frames that are not EtherCAT are forwarded or destroyed.
TEST(DlControl, ForwardingRule) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    std::array<std::byte, 64> frame{};
    const auto foreign = [&] {
        frame.fill(std::byte{0x10});
        frame[12] = std::byte{0x08};
        frame[13] = std::byte{0x06};
        rig.now += 100us;
        return rig.segment.process(frame, rig.now);
    };
    EXPECT_FALSE(foreign().returned) << "the default of the ET1100: destroyed";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0100, 0), 1);
    EXPECT_TRUE(foreign().returned);
    EXPECT_EQ(frame[6], std::byte{0x10}) << "not processed, so its source address is left alone";
}

// ET1100 data sheet II, table "Physical Read/Write Offset (0x0108:0x0109)": for FPRW and APRW only.
TEST(PhysicalReadWriteOffset, MovesTheWriteOfAReadWrite) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    EXPECT_EQ(rig.write(0, 0x1000, bytes({1, 2})).wkc, 1);
    EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0108, 0x0010), 1);
    const auto reply = rig.send(Command::APRW, {RingPosition{0}, 0x1000}, bytes({7, 8}));
    EXPECT_EQ(reply.wkc, 3);
    EXPECT_EQ(reply.data, bytes({1, 2}));
    EXPECT_EQ(rig.read(0, 0x1000, 2).data, bytes({1, 2}));
    EXPECT_EQ(rig.read(0, 0x1010, 2).data, bytes({7, 8}));
}

// ESC data sheets, "Shadow buffer for register write operations": written values become effective at the end of a
// frame without errors.
TEST(ShadowBuffer, DamagedFramesWriteNoRegister) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    std::array<std::byte, 60> raw{};
    wire::FrameBuilder builder(raw, {0, 1, 1, 1, 1, 1});
    auto data = builder.append(Command::APWR, 0, {RingPosition{0}, 0x0010}, 2);
    store_le<std::uint16_t>(data, 0, 0x1001);
    const auto size = builder.finish().size();
    // "More datagrams follow" is set, but none follows: the structure is wrong.
    raw[14 + 2 + 7] |= std::byte{0x80};
    rig.now += 100us;
    (void)rig.segment.process(MutableBytes(raw).first(size), rig.now);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x030C), 1) << "counted as a frame that the processing unit could not take";
}

// User RAM, ET1100 data sheet II, table "User RAM (0x0F80:0x0FFF)": no shadow buffer, accessible from both sides.
TEST(UserRam, IsPlainMemory) {
    Rig rig;
    rig.add_with_processor(et1100());
    rig.on();
    const auto replies = rig.frame({{Command::APWR, {RingPosition{0}, 0x0F80}, bytes({0x12, 0x34})},
                                    {Command::APRD, {RingPosition{0}, 0x0F80}, bytes({0, 0})}});
    EXPECT_EQ(replies.at(1).data, bytes({0x12, 0x34}));
    rig.pdi_put<std::uint8_t>(0, 0x0FFF, 0x99);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0FFF), 0x99);
}

// An access beyond the last address: existing octets are read, the others stay unchanged; the working counter
// increments.
TEST(Access, OverTheEndOfRegistersAndMemory) {
    Rig rig;
    auto chip = et1200();  // 1 KiB: 0x1000 to 0x13FF
    rig.add(chip, sii_image(kDigitalIo));
    rig.on();
    EXPECT_EQ(rig.write(0, 0x13FE, bytes({1, 2, 3, 4})).wkc, 1);
    const auto reply = rig.send(Command::APRD, {RingPosition{0}, 0x13FE}, bytes({0, 0, 9, 9}));
    EXPECT_EQ(reply.wkc, 1);
    EXPECT_EQ(reply.data, bytes({1, 2, 9, 9}));
    EXPECT_EQ(rig.read(0, 0x1400, 4).wkc, 0);
    EXPECT_EQ(rig.write(0, 0x1400, bytes({1})).wkc, 0);
    // From the user RAM into the process RAM.
    EXPECT_EQ(rig.write(0, 0x0FFE, bytes({5, 6, 7, 8})).wkc, 1);
    EXPECT_EQ(rig.read(0, 0x0FFE, 4).data, bytes({5, 6, 7, 8}));
    EXPECT_EQ(rig.read(0, 0xFFFE, 4).wkc, 0) << "nothing there, and no wrap to 0x0000";
}

// masters-on-the-wire: writes longer than the implemented FMMUs or SyncManagers increment the working counter, too.
TEST(Access, LongerThanTheImplementedArraysCounts) {
    Rig rig;
    rig.add(et1200(), sii_image(kDigitalIo));  // 3 FMMUs, 4 SyncManagers
    rig.on();
    for (const std::size_t length : {48u, 128u, 256u})
        EXPECT_EQ(rig.write(0, 0x0600, std::vector<std::byte>(length)).wkc, 1) << length;
    for (const std::size_t length : {32u, 64u, 128u})
        EXPECT_EQ(rig.write(0, 0x0800, std::vector<std::byte>(length)).wkc, 1) << length;
    EXPECT_EQ(rig.write(0, 0x0630, std::vector<std::byte>(16)).wkc, 0) << "the fourth FMMU is not there";
    EXPECT_EQ(rig.write(0, 0x0820, std::vector<std::byte>(8)).wkc, 0) << "the fifth SyncManager is not there";
}

}  // namespace
}  // namespace margay::sim::test
