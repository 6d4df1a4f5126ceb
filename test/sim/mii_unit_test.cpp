// MII management. ETG.1000.4 "MII management interface"; ET1100 data sheet II, tables "MII management control/status
// (0x0510:0x0511)" … "PHY port status (0x0518:0x051B)"; registers of a PHY: IEEE 802.3 clause 22.
#include "rig.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct MiiUnitTest : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add_with_processor(ip_core());
        rig.on();
    }
    std::uint16_t status() { return rig.get<std::uint16_t>(0, 0x0510); }
    void command(unsigned low, unsigned high, unsigned phy, unsigned number, unsigned data = 0) {
        EXPECT_EQ(rig.write(0, 0x0512, bytes({phy, number, data & 0xFF, data >> 8})).wkc, 1);
        EXPECT_EQ(rig.write(0, 0x0510, bytes({low, high})).wkc, 1);
    }
};

TEST_F(MiiUnitTest, ReadsThePhysOfItsPorts) {
    rig.step = 10us;
    command(0, 1, 0, 1);
    EXPECT_EQ(status() & 0x8100, 0x8100) << "busy, reading";
    rig.pass(100us);
    EXPECT_EQ(status() & 0xE300, 0);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0514) & 0x0024, 0x0024) << "basic status: link, negotiation complete";
    command(0, 1, 1, 1);
    rig.pass(100us);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0514) & 0x0024, 0) << "no cable at port 1";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0518), 0x00000003u) << "PHY port status";
}

TEST_F(MiiUnitTest, WritesWithEnableOnly) {
    command(0, 2, 0, 20, 0x1234);
    EXPECT_EQ(status() & 0x4000, 0x4000) << "command error";
    command(1, 2, 0, 20, 0x1234);
    rig.pass(100us);
    EXPECT_EQ(status() & 0xE300, 0);
    command(0, 1, 0, 20, 0);
    rig.pass(100us);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0514), 0x1234);
}

TEST_F(MiiUnitTest, NoPhyIsAReadError) {
    command(0, 1, 7, 1);
    rig.pass(100us);
    EXPECT_EQ(status() & 0x2000, 0x2000);
    command(0, 3, 0, 1);
    EXPECT_EQ(status() & 0x4000, 0x4000) << "an invalid command";
}

TEST_F(MiiUnitTest, BelongsToOneSideAtATime) {
    rig.pdi_put<std::uint8_t>(0, 0x0517, 1);
    command(0, 1, 0, 2);
    EXPECT_EQ(status() & 0x8000, 0) << "the PDI's now";
    rig.pdi_put<std::uint16_t>(0, 0x0512, 0x0200);
    rig.pdi_put<std::uint16_t>(0, 0x0510, 0x0100);
    rig.pass(100us);
    EXPECT_EQ(rig.pdi_get<std::uint16_t>(0, 0x0514), 0x4D47);
}

TEST(MiiUnit, IsNotThereWithoutPhys) {
    Rig rig;
    rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    EXPECT_EQ(rig.read(0, 0x0510, 2).wkc, 0);
}

}  // namespace
}  // namespace margay::sim::test
