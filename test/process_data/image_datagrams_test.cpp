// The division of an image into datagrams and frames, and the expected working counters.
#include "network/image_datagrams.hpp"
#include "process_data/slaves.hpp"

#include <gtest/gtest.h>

namespace margay {
namespace {

using wire::Command;

class ImageDatagramsTest : public testing::Test {
  protected:
    std::vector<Slave> slaves;
    GroupConfiguration wanted{.start = {0x1000}};
    std::vector<std::byte> image = std::vector<std::byte>(100000);
    std::vector<DatagramPlan> room = std::vector<DatagramPlan>(64);

    std::vector<DatagramPlan> plan() {
        const auto layout = lay_out(slaves, 0, wanted, image);
        EXPECT_TRUE(layout.ok());
        const auto count = plan_datagrams(slaves, 0, wanted, *layout, room);
        EXPECT_TRUE(count.ok());
        return {room.begin(), room.begin() + static_cast<std::ptrdiff_t>(*count)};
    }
};

TEST_F(ImageDatagramsTest, OneLrw) {
    slaves = {io_slave(1, 16, 24), io_slave(2, 0, 0), io_slave(3, 0, 8)};
    const auto got = plan();
    ASSERT_EQ(got.size(), 1U);
    // 3 for the slave with outputs and inputs, 0 for the coupler, 1 for the slave with inputs.
    EXPECT_EQ(got[0], (DatagramPlan{Command::LRW, 0, {0x1000}, 6, 4, 0, 2, 2, 4, 2}));
}

TEST_F(ImageDatagramsTest, LrdAndLwrShareAFrame) {
    slaves = {io_slave(1, 16, 24), io_slave(2, 0, 0), io_slave(3, 0, 8)};
    wanted.block_lrw = true;
    const auto got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0], (DatagramPlan{Command::LWR, 0, {0x1000}, 2, 1, 0, 0, 2, 0, 0}));
    EXPECT_EQ(got[1], (DatagramPlan{Command::LRD, 0, {0x1002}, 4, 2, 0, 2, 0, 4, 0}));
}

TEST_F(ImageDatagramsTest, OneSlaveWithoutLrwIsEnough) {
    slaves = {io_slave(1, 8, 8), io_slave(2, 8, 8)};
    slaves[1].config.block_lrw = true;
    EXPECT_EQ(plan().size(), 2U);
    slaves[1].config.block_lrw = false;
    slaves[1].dl.features = wire::features::kLrwNotSupported;
    EXPECT_EQ(plan().size(), 2U);
    slaves[1].config.sm_count = 0;
    EXPECT_EQ(plan().size(), 1U) << "a slave without data does not matter";
}

TEST_F(ImageDatagramsTest, OneDirectionNeedsNoLrw) {
    slaves = {io_slave(1, 8, 0)};
    EXPECT_EQ(plan()[0].command, Command::LWR);
    EXPECT_EQ(plan()[0].expected_wkc, 1);
    slaves = {io_slave(1, 0, 8)};
    EXPECT_EQ(plan()[0].command, Command::LRD);
    EXPECT_EQ(plan()[0].expected_wkc, 1);
    slaves = {io_slave(1, 0, 0)};
    EXPECT_TRUE(plan().empty());
}

TEST_F(ImageDatagramsTest, OverlappedDataTravelsOnce) {
    slaves = {io_slave(1, 16, 24), io_slave(2, 32, 0), io_slave(3, 0, 8)};
    wanted.overlapped = true;
    auto got = plan();
    ASSERT_EQ(got.size(), 1U);
    EXPECT_EQ(got[0], (DatagramPlan{Command::LRW, 0, {0x1000}, 8, 6, 0, 8, 8, 8, 0}));
    wanted.block_lrw = true;
    got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0], (DatagramPlan{Command::LWR, 0, {0x1000}, 8, 2, 0, 0, 8, 0, 0}));
    EXPECT_EQ(got[1], (DatagramPlan{Command::LRD, 0, {0x1000}, 8, 2, 0, 8, 0, 8, 0}));
}

// 1486 octets fit into one datagram, alone in its frame.
TEST_F(ImageDatagramsTest, AFullFrameIsOneFrame) {
    slaves = {io_slave(1, 486 * 8, 500 * 8), io_slave(2, 500 * 8, 0)};
    EXPECT_EQ(plan().size(), 1U);
    slaves[0].config.sms[0].bits += 1;
    EXPECT_EQ(plan().size(), 2U);
}

// Three slaves of 700 octets: two slaves leave 86 octets of a frame free, and the third slave is not divided to fill
// them.
TEST_F(ImageDatagramsTest, SlavesStayWholeWhereThatCostsNoFrame) {
    slaves = {io_slave(1, 0, 700 * 8), io_slave(2, 0, 700 * 8), io_slave(3, 0, 700 * 8)};
    const auto got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0].bytes, 1400);
    EXPECT_EQ(got[1].bytes, 700);
    EXPECT_EQ(got[1].frame, 1);
    EXPECT_EQ(got[0].expected_wkc, 2);
    EXPECT_EQ(got[1].expected_wkc, 1);
}

// An ESC increments the working counter of a datagram once for all octets that it writes into the datagram. It writes
// its mailbox status in any state. In the datagram of the inputs this increment would also count for inputs that were
// not read.
TEST_F(ImageDatagramsTest, TheMailboxStatusHasADatagramOfItsOwn) {
    for (const bool overlapped : {false, true}) {
        for (const bool block_lrw : {false, true}) {
            slaves = {io_slave(1, 16, 16), io_slave(2, 0, 16)};
            slaves[1].mailbox = {.out_start = 0x1800, .out_bytes = 64, .in_start = 0x1880, .in_bytes = 64};
            slaves[1].config.mailbox_status = true;
            wanted.overlapped = overlapped;
            wanted.block_lrw = block_lrw;
            const auto got = plan();
            ASSERT_EQ(got.size(), block_lrw ? 3U : 2U);
            EXPECT_EQ(got.back().command, wire::Command::LRD);
            EXPECT_EQ(got.back().bytes, 1);
            EXPECT_EQ(got.back().expected_wkc, 1);
            EXPECT_EQ(got.back().image_input, slaves[1].image.mailbox_status_bit / 8);
            unsigned others = 0;
            for (std::size_t n = 0; n + 1 < got.size(); ++n) others += got[n].expected_wkc;
            EXPECT_EQ(others, block_lrw ? 3U : 4U);
        }
    }
}

// Three slaves of 990 octets have 2970 octets, and two frames can contain 2972 octets.
TEST_F(ImageDatagramsTest, ASlaveIsCutWhereThatSavesAFrame) {
    slaves = {io_slave(1, 0, 990 * 8), io_slave(2, 0, 990 * 8), io_slave(3, 0, 990 * 8)};
    const auto got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0].bytes, 1486);
    EXPECT_EQ(got[1].bytes, 2970 - 1486);
    EXPECT_EQ(got[0].expected_wkc, 2) << "the slave on the boundary counts in both";
    EXPECT_EQ(got[1].expected_wkc, 2);
}

TEST_F(ImageDatagramsTest, ASlaveLargerThanAFrame) {
    slaves = {make_slave(1)};
    slaves[0].dl.ram_kib = 60;
    slaves[0].config.add(inputs_sm(3, 0x1400, 4000 * 8));
    const auto got = plan();
    ASSERT_EQ(got.size(), 3U);
    EXPECT_EQ(got[2].bytes, 4000 - 2 * 1486);
    EXPECT_EQ(got[2].image_input, 2U * 1486);
}

TEST_F(ImageDatagramsTest, ReserveLeavesRoomInTheFirstFrameOnly) {
    slaves = {io_slave(1, 0, 1480 * 8), io_slave(2, 0, 1486 * 8)};
    wanted.reserve_bytes = 20;
    auto got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0].frame, 1) << "three frames it takes anyway: the first is left to the others, and no slave is cut";
    EXPECT_EQ(got[1].frame, 2);
    wanted.reserve_bytes = 6;
    got = plan();
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0].bytes, 1480);
    wanted.reserve_bytes = 1498;
    const auto layout = lay_out(slaves, 0, wanted, image);
    EXPECT_EQ(plan_datagrams(slaves, 0, wanted, *layout, room).error().code, Errc::invalid_argument);
}

TEST_F(ImageDatagramsTest, TooFewDatagrams) {
    slaves = {io_slave(1, 0, 1486 * 8), io_slave(2, 0, 1486 * 8), io_slave(3, 0, 8)};
    const auto layout = lay_out(slaves, 0, wanted, image);
    const auto count = plan_datagrams(slaves, 0, wanted, *layout, std::span(room).first(2));
    ASSERT_FALSE(count.ok());
    EXPECT_EQ(count.error().code, Errc::too_many_frames);
    EXPECT_EQ(count.error().expected, 3U);
    EXPECT_EQ(count.error().actual, 2U);
}

}  // namespace
}  // namespace margay
