// The process image, compared with FMMUs, addresses and errors calculated by hand.
#include "network/image_layout.hpp"
#include "network/pdo_lists.hpp"
#include "process_data/slaves.hpp"

#include <gtest/gtest.h>

#include <array>

namespace margay {
namespace {

using wire::Fmmu;

TEST(PdoList, OfManyPdosWithoutEntriesIsNoDescription) {
    const std::vector<Pdo> pdos(256, Pdo{0x1600});
    EXPECT_EQ(listed_bits({2, pdos}).open, 256U);
}

class ImageLayoutTest : public testing::Test {
  protected:
    std::vector<Slave> slaves;
    GroupConfiguration wanted{.start = {0x10000}};
    std::vector<std::byte> image = std::vector<std::byte>(4096);

    Result<ImageLayout> lay() { return lay_out(slaves, 0, wanted, image); }
    // The FMMUs of slave `position`, after lay().
    std::array<Fmmu, 16> fmmus(std::size_t position, const ImageLayout& layout) {
        const auto made = make_fmmus(slaves[position - 1], layout);
        EXPECT_TRUE(made.ok());
        return made->at;
    }
    static Fmmu out(std::uint32_t logical, std::uint16_t length, std::uint8_t first_bit, std::uint8_t last_bit,
                    std::uint16_t physical) {
        return {{logical}, length, first_bit, last_bit, physical, 0, false, true, true};
    }
    static Fmmu in(std::uint32_t logical, std::uint16_t length, std::uint8_t first_bit, std::uint8_t last_bit,
                   std::uint16_t physical) {
        return {{logical}, length, first_bit, last_bit, physical, 0, true, false, true};
    }
};

// Outputs of all slaves, then inputs of all slaves: 2 + 1 octets out, 3 + 1 in.
TEST_F(ImageLayoutTest, ByteAligned) {
    slaves = {io_slave(1, 16, 24), io_slave(2, 0, 0), io_slave(3, 4, 2)};
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(layout->output_bytes, 3U);
    EXPECT_EQ(layout->input_bytes, 4U);
    EXPECT_EQ(layout->logical_bytes(), 7U);
    EXPECT_EQ(fmmus(1, *layout)[0], out(0x10000, 2, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(1, *layout)[1], in(0x10003, 3, 0, 7, 0x1400));
    EXPECT_EQ(fmmus(3, *layout)[0], out(0x10002, 1, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(3, *layout)[1], in(0x10006, 1, 0, 7, 0x1400));
    EXPECT_EQ(make_fmmus(slaves[1], *layout)->count, 0);
    EXPECT_EQ(slaves[0].image.inputs.bytes.data(), image.data() + 3);
    EXPECT_EQ(slaves[0].image.inputs.bytes.size(), 3U);
    EXPECT_EQ(slaves[2].image.outputs.offset_bits, 16U);
    EXPECT_EQ(slaves[1].image.outputs.bits, 0U);
}

// 4 + 2 bits share an octet, the 4 bits of the third slave cross the octet boundary; 16 bits begin at an octet; 3 bits
// follow directly.
TEST_F(ImageLayoutTest, PackedBitWise) {
    slaves = {io_slave(1, 4, 0), io_slave(2, 2, 1), io_slave(3, 4, 7), io_slave(4, 16, 0), io_slave(5, 3, 0)};
    wanted.packing = Packing::bits;
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(layout->output_bytes, 5U);  // 10 bits, 16 on octet 2, 3 on octet 4
    EXPECT_EQ(layout->input_bytes, 1U);
    EXPECT_EQ(fmmus(1, *layout)[0], out(0x10000, 1, 0, 3, 0x1100));
    EXPECT_EQ(fmmus(2, *layout)[0], out(0x10000, 1, 4, 5, 0x1100));
    EXPECT_EQ(fmmus(3, *layout)[0], out(0x10000, 2, 6, 1, 0x1100));
    EXPECT_EQ(fmmus(4, *layout)[0], out(0x10002, 2, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(5, *layout)[0], out(0x10004, 1, 0, 2, 0x1100));
    EXPECT_EQ(fmmus(2, *layout)[1], in(0x10005, 1, 0, 0, 0x1400));
    EXPECT_EQ(fmmus(3, *layout)[1], in(0x10005, 1, 1, 7, 0x1400));
    EXPECT_EQ(slaves[2].image.outputs.bytes.size(), 2U);
}

TEST_F(ImageLayoutTest, SlaveWithoutBitOperationsKeepsOctetsOfItsOwn) {
    slaves = {io_slave(1, 3, 0), io_slave(2, 2, 0), io_slave(3, 3, 0)};
    slaves[1].dl.features = wire::features::kFmmuBitOperationNotSupported;
    wanted.packing = Packing::bits;
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(fmmus(1, *layout)[0], out(0x10000, 1, 0, 2, 0x1100));
    EXPECT_EQ(fmmus(2, *layout)[0], out(0x10001, 1, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(3, *layout)[0], out(0x10002, 1, 0, 2, 0x1100));
}

// Slots of max(2, 3), max(4, 0), max(0, 1) octets: outputs and inputs of a slave have the same logical address.
TEST_F(ImageLayoutTest, Overlapped) {
    slaves = {io_slave(1, 16, 24), io_slave(2, 32, 0), io_slave(3, 0, 8)};
    wanted.overlapped = true;
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(layout->logical_bytes(), 8U);
    EXPECT_EQ(layout->image_bytes(), 16U);
    EXPECT_EQ(fmmus(1, *layout)[0], out(0x10000, 2, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(1, *layout)[1], in(0x10000, 3, 0, 7, 0x1400));
    EXPECT_EQ(fmmus(2, *layout)[0], out(0x10003, 4, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(3, *layout)[0], in(0x10007, 1, 0, 7, 0x1400));
    EXPECT_EQ(slaves[0].image.inputs.offset_bits, 64U);
    EXPECT_EQ(slaves[2].image.inputs.bytes.data(), image.data() + 8 + 7);
}

// One FMMU reads from SyncManager 3, the next from SyncManager 4. The areas of SyncManagers 5 and 6 are adjacent and
// share an FMMU.
TEST_F(ImageLayoutTest, SeveralSyncManagersOfADirection) {
    Slave slave = make_slave(1);
    slave.config.add(inputs_sm(3, 0x1400, 12));
    slave.config.add(inputs_sm(4, 0x1600, 8));
    slave.config.add(outputs_sm(5, 0x1200, 16));
    slave.config.add(outputs_sm(6, 0x1202, 3));
    slaves = {slave};
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    const auto made = make_fmmus(slaves[0], *layout);
    EXPECT_EQ(made->count, 3);
    EXPECT_EQ(made->at[0], out(0x10000, 3, 0, 7, 0x1200));
    EXPECT_EQ(made->at[1], in(0x10003, 2, 0, 7, 0x1400));
    EXPECT_EQ(made->at[2], in(0x10005, 1, 0, 7, 0x1600));
    EXPECT_EQ(sm_offset_bits(slaves[0], Packing::bytes, 0), 24U);
    EXPECT_EQ(sm_offset_bits(slaves[0], Packing::bytes, 1), 40U);
    EXPECT_EQ(sm_offset_bits(slaves[0], Packing::bytes, 3), 16U);
}

// In an ESC an octet belongs to only one FMMU of a direction.
TEST_F(ImageLayoutTest, SecondSyncManagerOfAPackedSlaveBeginsOnAnOctet) {
    Slave slave = make_slave(1);
    slave.config.add(inputs_sm(3, 0x1400, 3));
    slave.config.add(inputs_sm(4, 0x1600, 2));
    slaves = {slave};
    wanted.packing = Packing::bits;
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(fmmus(1, *layout)[0], in(0x10000, 1, 0, 2, 0x1400));
    EXPECT_EQ(fmmus(1, *layout)[1], in(0x10001, 1, 0, 1, 0x1600));
}

// 0x080D is the status of SyncManager 1. The bits are behind the inputs, in a separate octet.
TEST_F(ImageLayoutTest, MailboxStatusBits) {
    slaves = {io_slave(1, 8, 4), io_slave(2, 0, 8), io_slave(3, 0, 0), io_slave(4, 0, 0)};
    for (Slave& slave : slaves) slave.config.mailbox_status = true;
    for (const std::size_t n : {0U, 2U, 3U}) slaves[n].mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE};
    slaves[3].dl.features = wire::features::kFmmuBitOperationNotSupported;
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(layout->output_bytes, 1U);
    EXPECT_EQ(layout->input_bytes, 4U);
    Fmmu first = in(0x10003, 1, 0, 0, 0x080D);
    Fmmu second = in(0x10003, 1, 1, 1, 0x080D);
    first.physical_start_bit = second.physical_start_bit = 3;
    EXPECT_EQ(fmmus(1, *layout)[2], first);
    EXPECT_EQ(fmmus(3, *layout)[0], second);
    EXPECT_EQ(fmmus(4, *layout)[0], in(0x10004, 1, 0, 7, 0x080D));
    EXPECT_EQ(slaves[0].image.mailbox_status_bit, 24U);
    EXPECT_EQ(slaves[1].image.mailbox_status_bit, SlaveImage::kNone) << "a slave without mailbox";
    EXPECT_EQ(slaves[3].image.mailbox_status_bit, 32U + 3U) << "bit 3 of the whole status octet";
}

TEST_F(ImageLayoutTest, FmmusAreThoseThatTheSiiHasForTheUse) {
    slaves = {io_slave(1, 8, 8)};
    slaves[0].mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE};
    slaves[0].config.mailbox_status = true;
    slaves[0].fmmu_count = 4;
    slaves[0].fmmu_use = {FmmuUse::inputs, FmmuUse::mailbox_status, FmmuUse::unused, FmmuUse::outputs};
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    const auto at = fmmus(1, *layout);
    EXPECT_EQ(at[3], out(0x10000, 1, 0, 7, 0x1100));
    EXPECT_EQ(at[0], in(0x10001, 1, 0, 7, 0x1400));
    EXPECT_EQ(at[1].physical_start, 0x080D);
    EXPECT_EQ(at[1].physical_start_bit, 3);
    EXPECT_FALSE(at[2].active);
}

TEST_F(ImageLayoutTest, GroupsHaveImagesOfTheirOwn) {
    slaves = {io_slave(1, 8, 8), io_slave(2, 16, 16), io_slave(3, 8, 0)};
    slaves[1].config.group = 7;
    const auto first = lay();
    std::array<std::byte, 4> other{};
    const auto second = lay_out(slaves, 7, {.start = {0x7000000}}, other);
    ASSERT_TRUE(first.ok() && second.ok());
    EXPECT_EQ(first->image_bytes(), 3U);
    EXPECT_EQ(second->image_bytes(), 4U);
    EXPECT_EQ(fmmus(3, *first)[0], out(0x10001, 1, 0, 7, 0x1100));
    EXPECT_EQ(fmmus(2, *second)[1], in(0x7000002, 2, 0, 7, 0x1400));
    EXPECT_EQ(slaves[1].image.outputs.bytes.data(), other.data());
}

TEST_F(ImageLayoutTest, SyncManagersTakeWholeOctets) {
    EXPECT_EQ(make_sync_manager(outputs_sm(2, 0x1100, 9)), (wire::SyncManager{0x1100, 2, kOutputControl, 1}));
    EXPECT_EQ(make_sync_manager(inputs_sm(3, 0x1400, 0)), (wire::SyncManager{0x1400, 0, kInputControl, 0}));
}

// Errors.
std::string words(const Error& error) {
    std::array<char, 200> text{};
    return std::string(describe(error, text));
}

TEST_F(ImageLayoutTest, ImageLargerThanTheBuffer) {
    slaves = {io_slave(1, 800, 8), io_slave(2, 8, 800)};
    image.resize(201);
    const auto layout = lay();
    ASSERT_FALSE(layout.ok());
    EXPECT_EQ(words(layout.error()),
              "mapping process data: the process image is larger than the buffer (needed 202, there is room "
              "for 201)");
    for (const Slave& slave : slaves)
        EXPECT_TRUE(slave.image.outputs.bytes.empty() && slave.image.inputs.bytes.empty());
    image.resize(202);
    EXPECT_TRUE(lay().ok());
}

TEST_F(ImageLayoutTest, LengthsThatOverflowAreNotTakenForSmallOnes) {
    slaves = {io_slave(1, 0xFFFF'FFFF, 0)};
    EXPECT_EQ(lay().error().code, Errc::sm_memory);
}

TEST_F(ImageLayoutTest, TooFewFmmus) {
    slaves = {make_slave(1), make_slave(2, 2)};
    slaves[1].config.add(outputs_sm(2, 0x1100, 8));
    slaves[1].config.add(inputs_sm(3, 0x1200, 8));
    slaves[1].config.add(inputs_sm(4, 0x1400, 8));
    const auto layout = lay();
    ASSERT_TRUE(layout.ok());
    EXPECT_EQ(words(make_fmmus(slaves[1], *layout).error()),
              "slave 2: mapping process data: the slave has too few FMMUs (needed 3, there is room for 2)");
}

TEST_F(ImageLayoutTest, TooFewSyncManagers) {
    slaves = {make_slave(1, 8, 3)};
    slaves[0].config.add(inputs_sm(3, 0x1400, 8));
    EXPECT_EQ(words(lay().error()),
              "slave 1: mapping process data at SyncManager 3: the slave has no such SyncManager (needed 4, there is "
              "room for 3)");
}

TEST_F(ImageLayoutTest, ProcessDataOnTopOfAMailbox) {
    const auto attempt = [&](const ProcessSm& sm) {
        slaves = {make_slave(1)};
        slaves[0].mailbox = {
            .out_start = 0x1000, .out_bytes = 128, .in_start = 0x1100, .in_bytes = 128, .protocols = 4};
        slaves[0].config.add(sm);
        const auto layout = lay();
        return layout ? std::string() : words(layout.error());
    };
    const std::string on_top =
        "slave 1: mapping process data at SyncManager 2: outside the slave's process data memory, or on top of another "
        "SyncManager";
    for (const auto& sm : {outputs_sm(2, 0x107F, 8), outputs_sm(2, 0x0FFF, 16), outputs_sm(2, 0x10FF, 16)})
        EXPECT_EQ(attempt(sm).substr(0, on_top.size()), on_top) << sm.start;
    EXPECT_EQ(attempt(outputs_sm(2, 0x1080, 8 * 128)), "") << "between the mailboxes";
    EXPECT_EQ(attempt(outputs_sm(2, 0x1000, 0)), "") << "not used";
}

TEST_F(ImageLayoutTest, SyncManagersThatDoNotFitTheMemory) {
    struct Case {
        const char* name;
        ProcessSm first;
        ProcessSm second;
        Errc code;
        std::uint16_t index;
    };
    // 8 KiB of RAM end at 0x3000.
    const Case cases[] = {
        {"up to the end", outputs_sm(2, 0x1100, 8), inputs_sm(3, 0x2FFF, 8), Errc::none, 0},
        {"past the end", outputs_sm(2, 0x1100, 8), inputs_sm(3, 0x2FFF, 9), Errc::sm_memory, 0x0818},
        {"on registers", outputs_sm(2, 0x0EFF, 8), inputs_sm(3, 0x1400, 8), Errc::sm_memory, 0x0810},
        {"on digital outputs", outputs_sm(2, 0x0F00, 8), inputs_sm(3, 0x1400, 8), Errc::none, 0},
        {"side by side", outputs_sm(2, 0x1100, 16), inputs_sm(3, 0x1102, 8), Errc::none, 0},
        {"on top", outputs_sm(2, 0x1100, 17), inputs_sm(3, 0x1102, 8), Errc::sm_memory, 0x0818},
        {"below and on top", outputs_sm(2, 0x1102, 8), inputs_sm(3, 0x1100, 24), Errc::sm_memory, 0x0818},
        {"twice", outputs_sm(2, 0x1100, 8), outputs_sm(2, 0x1400, 8), Errc::invalid_argument, 0x0810},
        {"off where another is", outputs_sm(2, 0x1100, 8), inputs_sm(3, 0x1100, 0), Errc::none, 0},
    };
    for (const Case& c : cases) {
        slaves = {make_slave(1)};
        slaves[0].config.add(c.first);
        slaves[0].config.add(c.second);
        const auto layout = lay();
        EXPECT_EQ(layout.error().code, c.code) << c.name;
        EXPECT_EQ(layout.error().index, c.index) << c.name;
        EXPECT_EQ(layout.error().slave, c.code == Errc::none ? 0 : 1) << c.name;
    }
}

}  // namespace
}  // namespace margay
