// A line of ESCs, also through the NIC: they are counted and addressed, and the master reads their EEPROM and their
// state.
#include "rig.hpp"

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

class Line : public ::testing::Test {
  protected:
    void SetUp() override {
        rig.add(et1100(), sii_image(kEmulationWithDc, 0x0077));
        rig.add(et1200(), sii_image(kDigitalIo));
        rig.add(et1200(), sii_image(kDigitalIo));
        rig.on();
    }
    Rig rig;
};

TEST_F(Line, BroadcastReadCountsSlavesAndOrsTheirData) {
    const auto reply = rig.send(Command::BRD, {std::uint16_t{0}, reg::kType.address}, bytes({0}));
    EXPECT_TRUE(reply.returned);
    EXPECT_EQ(reply.wkc, 3);
    EXPECT_EQ(reply.header.address.adp(), 3);
    EXPECT_EQ(reply.as<std::uint8_t>(), 0x11 | 0x12);  // types of the EK1100 and the EL terminals in the recordings
    EXPECT_EQ(reply.source, std::byte{0x02});          // the first ESC marks the frame
}

TEST_F(Line, StationAddressesAndAliases) {
    for (std::uint16_t n = 0; n < 3; ++n)
        EXPECT_EQ(rig.put<std::uint16_t>(n, 0x0010, static_cast<std::uint16_t>(0x1001 + n)), 1);
    EXPECT_EQ(rig.send(Command::FPRD, {StationAddress{0x1003}, 0x0010}, bytes({0, 0})).as<std::uint16_t>(), 0x1003);
    EXPECT_EQ(rig.send(Command::FPRD, {StationAddress{0x1004}, 0x0010}, bytes({0, 0})).wkc, 0);
    EXPECT_EQ(rig.send(Command::FPRD, {StationAddress{0x0077}, 0x0012}, bytes({0, 0})).wkc, 0);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0103, 1), 1);  // alias addressing on
    EXPECT_EQ(rig.send(Command::FPRD, {StationAddress{0x0077}, 0x0012}, bytes({0, 0})).as<std::uint16_t>(), 0x0077);
}

TEST_F(Line, SiiIsBusyForItsTimeAndThenHasEightOctets) {
    rig.step = 50us;
    EXPECT_EQ(rig.write(1, 0x0502, bytes({0x00, 0x01, 0x08, 0, 0, 0})).wkc, 1);
    EXPECT_EQ(rig.get<std::uint16_t>(1, 0x0502),
              0x8140);  // busy, 8 octets, reading: as recorded for the EK1100 in replay-dc
    int looks = 1;
    while ((rig.get<std::uint16_t>(1, 0x0502) & 0x8000) != 0) ++looks;
    EXPECT_EQ(looks, 5);  // at 50, 100 … 250 µs of 300
    EXPECT_EQ(rig.get<std::uint64_t>(1, 0x0508), 0xA00BA00AA009A008u);
}

TEST_F(Line, DeviceEmulationMirrorsAlControl) {
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x0120}, bytes({0x11, 0})).wkc, 3);
    EXPECT_EQ(rig.get<std::uint16_t>(2, 0x0130), 0x0011);
    EXPECT_EQ(rig.put<std::uint16_t>(2, 0x0120, 0x0002), 1);
    EXPECT_EQ(rig.get<std::uint16_t>(2, 0x0130), 0x0002);
}

TEST_F(Line, DlStatusShowsTheEndOfTheLine) {
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0110),
              0x5A31);  // the values of EK1100, EL2828, EL2889 in replay-dc
    EXPECT_EQ(rig.get<std::uint16_t>(1, 0x0110), 0x5A33);
    EXPECT_EQ(rig.get<std::uint16_t>(2, 0x0110), 0x5613);
}

TEST_F(Line, WritesTakeEffectAtTheEndOfTheFrame) {
    const auto replies = rig.frame({{Command::APWR, {RingPosition{0}, 0x0010}, bytes({0x34, 0x12})},
                                    {Command::APRD, {RingPosition{0}, 0x0010}, bytes({0, 0})}});
    EXPECT_EQ(replies.at(1).as<std::uint16_t>(), 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), 0x1234);
}

TEST(SimulatedNic, DeliversAfterTheRoundTripInOrder) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    VirtualOsal osal;
    SimulatedNic nic(rig.segment, osal, {.round_trip = 100us, .queue_frames = 2});
    EXPECT_EQ(nic.link_state(), LinkState::up);
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (std::uint8_t index = 1; index <= 3; ++index) {
        wire::FrameBuilder builder(buffer, nic.source_mac());
        (void)builder.append(Command::BRD, index, {std::uint16_t{0}, 0x0000}, 1);
        EXPECT_EQ(nic.send(builder.finish()), index < 3 ? SendStatus::sent : SendStatus::busy);
    }
    EXPECT_EQ(nic.receive(buffer), 0u);
    osal.wait(nic.next_arrival(), nic.wait_handle());
    EXPECT_GE(osal.now(), Time{100us});
    EXPECT_LT(osal.now(), Time{102us});
    ASSERT_EQ(nic.receive(buffer), 29u);
    wire::DatagramReader reader(Bytes(buffer).first(29));
    const auto reply = reader.next();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->header.index, 1);
    EXPECT_EQ(reply->wkc, 1);
    ASSERT_EQ(nic.receive(buffer), 29u);
    EXPECT_EQ(nic.receive(buffer), 0u);
    EXPECT_EQ(nic.next_arrival(), kNever);
}

TEST(SimulatedNic, KeepsTheWireBusy) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    VirtualOsal osal;
    SimulatedNic nic(rig.segment, osal, {.round_trip = 0us, .wire_time = true});
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (int i = 0; i < 3; ++i) {
        wire::FrameBuilder builder(buffer, nic.source_mac());
        (void)builder.append(Command::BRD, 0, {std::uint16_t{0}, 0x1000}, 1000);
        ASSERT_EQ(nic.send(builder.finish()), SendStatus::sent);
    }
    const auto one = nic.next_arrival();
    osal.wait(one, -1);
    ASSERT_NE(nic.receive(buffer), 0u);
    EXPECT_EQ(nic.next_arrival() - one, Duration(static_cast<int>(wire::bytes_on_the_wire(1028)) * 80));
}

}  // namespace
}  // namespace margay::sim::test
