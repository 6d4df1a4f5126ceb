// Registers that are read with each cycle: the AL status of all slaves, and the time of the reference clock.
#include "facts.hpp"
#include "network/image_datagrams.hpp"
#include "oshw/pcap/recorder.hpp"
#include "process_data/bus.hpp"
#include "process_data/slaves.hpp"
#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <filesystem>

namespace margay {
namespace {

using namespace std::chrono_literals;

class ReadingsTest : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(8192);
    HostContext& ctx() { return *bus.ctx; }
    const Group& group() { return ctx().group(0); }
    // Three slaves with a clock. Both readings are enabled.
    void start() {
        for (int i = 0; i < 3; ++i) bus.add(16, 16);
        bus.start();
        group().config.al_status = true;
        group().config.dc_reference = 1;
    }
};

TEST_F(ReadingsTest, TheAlStatusOfAllComesWithTheCycle) {
    start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(group().frames, 1);
    EXPECT_EQ(group().datagrams.size(), 1U) << "readings are no process data";
    const auto wkc = bus.cycle();
    ASSERT_TRUE(wkc.ok());
    EXPECT_EQ(*wkc, 9U) << "nor do they count as such";
    EXPECT_TRUE(group().al_status.came);
    EXPECT_EQ(group().al_status.slaves, 3);
    EXPECT_EQ(group().al_status.value, 0x04U);
    EXPECT_EQ(bus.to_op().state, AlState::op);
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(group().al_status.value, 0x08U);
    ASSERT_TRUE(writestate(ctx(), 2, AlState::safeop).ok());
    for (int i = 0; i < 5; ++i) (void)bus.cycle();
    EXPECT_EQ(group().al_status.value, 0x0CU) << "the bits of all";
    bus.segment.set_power(2, false, bus.osal.now());
    EXPECT_EQ(bus.cycle().error().code, Errc::working_counter);
    EXPECT_EQ(group().al_status.slaves, 2);
}

TEST_F(ReadingsTest, TheTimeOfTheReferenceClockComesWithTheCycle) {
    start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_TRUE(group().dc_time.came);
    EXPECT_EQ(group().dc_time.slaves, 3) << "read from one, written to two";
    for (int i = 0; i < 10; ++i) {
        const std::uint64_t before = group().dc_time.value;
        const Time end = bus.osal.now();
        ASSERT_TRUE(bus.cycle().ok());
        const Duration passed = bus.osal.now() - end;  // all cycles have the same duration
        EXPECT_EQ(group().dc_time.value - before, static_cast<std::uint64_t>(passed.count()));
    }
}

TEST_F(ReadingsTest, AFrameThatIsLostLeavesTheLastValue) {
    start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_TRUE(bus.cycle().ok());
    const std::uint64_t time = group().dc_time.value;
    ASSERT_TRUE(send_processdata(ctx()).ok());
    EXPECT_EQ(receive_processdata(ctx(), 0us).error().code, Errc::no_frame);
    EXPECT_FALSE(group().dc_time.came);
    EXPECT_FALSE(group().al_status.came);
    EXPECT_EQ(group().dc_time.value, time);
}

TEST_F(ReadingsTest, AGroupMayHaveNothingElse) {
    start();
    ctx().group(1).config.al_status = true;
    std::vector<std::byte> none;
    ASSERT_TRUE(config_map(ctx(), none, 1).ok());
    EXPECT_EQ(ctx().group(1).frames, 1);
    const auto wkc = bus.cycle(1);
    ASSERT_TRUE(wkc.ok());
    EXPECT_EQ(*wkc, 0U);
    EXPECT_EQ(ctx().group(1).al_status.slaves, 3);
    EXPECT_EQ(ctx().group(1).al_status.value, 0x02U);
    ASSERT_TRUE(send_processdata(ctx(), 1).ok());
    EXPECT_EQ(receive_processdata(ctx(), 0us, 1).error().code, Errc::no_frame) << "its frame is missed all the same";
}

TEST_F(ReadingsTest, SeveralFramesAndRequestsBesideThem) {
    for (int i = 0; i < 3; ++i) bus.add(5000, 5000);
    bus.start();
    group().config.al_status = true;
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(group().frames, 3);
    for (int i = 0; i < 20; ++i) {
        const auto wkc = bus.cycle();
        ASSERT_TRUE(wkc.ok());
        EXPECT_EQ(*wkc, group().expected_wkc);
        EXPECT_EQ(group().al_status.slaves, 3);
        EXPECT_EQ(readstate(ctx())->state, AlState::safeop);
    }
}

TEST_F(ReadingsTest, TheReferenceClockIsASlaveWithAClock) {
    start();
    group().config.dc_reference = 4;
    auto mapped = config_map(ctx(), image);
    EXPECT_EQ(mapped.error().code, Errc::unknown_slave);
    EXPECT_EQ(mapped.error().slave, 4);
    group().config.dc_reference = 2;
    facts(ctx().slave(2)).dl.dc = false;
    mapped = config_map(ctx(), image);
    EXPECT_EQ(mapped.error().code, Errc::invalid_argument);
    EXPECT_EQ(mapped.error().slave, 2);
    group().config.dc_reference = 1;
    EXPECT_TRUE(config_map(ctx(), image).ok());
    EXPECT_TRUE(bus.cycle().ok());
}

// The octets that both readings need in the first frame: 12 + 2 and 12 + 8.
TEST(ReadingsPlan, TheFirstFrameHasRoomForThem) {
    std::vector<Slave> slaves{io_slave(1, 0, (1486 - 34) * 8)};
    slaves[0].dl.dc = slaves[0].dl.dc_64bit = true;
    slaves[0].dl.ram_kib = 16;
    GroupConfiguration wanted;
    wanted.al_status = true;
    wanted.dc_reference = 1;
    std::vector<std::byte> image(4096);
    std::vector<DatagramPlan> room(8);
    const auto frames = [&] {
        const auto layout = lay_out(slaves, 0, wanted, image);
        const auto count = plan_datagrams(slaves, 0, wanted, *layout, room);
        return room[*count - 1].frame + 1;
    };
    EXPECT_EQ(frames(), 1);
    slaves[0].config.sms[0].bits += 8;
    EXPECT_EQ(frames(), 2);
}

// The frame as tshark decodes it and as the standard defines it: LRW of the image, BRD of 0x0130, FRMW of 0x0910 at
// the station address of the first slave.
TEST_F(ReadingsTest, TsharkReadsTheFrame) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    for (int i = 0; i < 2; ++i) bus.add(16, 16);
    bus.segment.power_up(bus.osal.now());
    SimulatedNic line(bus.segment, bus.osal);
    PcapRecorder recorder(line, bus.osal);
    HostContext master({.slaves = 8});
    ASSERT_TRUE(init(master, recorder, bus.osal).ok());
    ASSERT_TRUE(config_init(master).ok());
    master.group(0).config.al_status = true;
    master.group(0).config.dc_reference = 1;
    ASSERT_TRUE(config_map(master, image).ok());
    const auto file =
        std::filesystem::temp_directory_path() / ("margay-readings-" + std::to_string(::getpid()) + ".pcap");
    ASSERT_TRUE(recorder.open(file.string()).ok());
    ASSERT_TRUE(send_processdata(master).ok());
    ASSERT_TRUE(receive_processdata(master, 1ms).ok());
    ASSERT_TRUE(recorder.close().ok());
    const auto seen = testing_tshark::fields_of(file.string(), {"ecat.cmd", "ecat.lad", "ecat.adp", "ecat.ado",
                                                                "ecat.subframe.length", "ecat.cnt", "_ws.malformed"});
    std::filesystem::remove(file);
    ASSERT_EQ(seen.size(), 2U) << "sent, and back";
    using Row = std::vector<std::string>;
    EXPECT_EQ(seen[0], (Row{"0x0c,0x07,0x0e", "0x00000000", "0x0000,0x1001", "0x0130,0x0910", "8,2,8", "0,0,0", ""}));
    EXPECT_EQ(seen[1], (Row{"0x0c,0x07,0x0e", "0x00000000", "0x0002,0x1001", "0x0130,0x0910", "8,2,8", "6,2,2", ""}));
}

}  // namespace
}  // namespace margay
