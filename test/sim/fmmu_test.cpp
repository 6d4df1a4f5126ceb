// FMMUs and logical commands. ETG.1000.4 section "Fieldbus memory management unit (FMMU)"; ET1100 data sheet I, "FMMU".
#include "rig.hpp"

#include "wire/fmmu.hpp"

namespace margay::sim::test {
namespace {

struct FmmuTest : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add(et1100(), sii_image(kEmulationWithDc));
        rig.on();
    }
    void set(unsigned n, const wire::Fmmu& fmmu, std::uint16_t position = 0) {
        std::vector<std::byte> raw(16);
        wire::store_fmmu(raw, fmmu);
        EXPECT_EQ(rig.write(position, reg::fmmu(n).address, raw).wkc, 1);
    }
    void fill(std::uint16_t address, std::initializer_list<unsigned> values) {
        EXPECT_EQ(rig.write(0, address, bytes(values)).wkc, 1);
    }
    std::vector<std::byte> memory(std::uint16_t address, std::size_t count) {
        return rig.slave(0).peek(address, count);
    }
    Reply logical(Command command, std::uint32_t address, std::vector<std::byte> data) {
        return rig.send(command, wire::DatagramAddress(LogicalAddress{address}), std::move(data));
    }
};

constexpr wire::Fmmu kRead{{0x10000}, 4, 0, 7, 0x1000, 0, true, false, true};
constexpr wire::Fmmu kWrite{{0x10000}, 4, 0, 7, 0x1000, 0, false, true, true};

// ETG.1000.4 table "Working counter increment": read 1, write 1, LRW 1 for reading and 2 for writing.
TEST_F(FmmuTest, WorkingCounters) {
    set(0, kRead);
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0, 0, 0, 0})).wkc, 1);
    EXPECT_EQ(logical(Command::LWR, 0x10000, bytes({0, 0, 0, 0})).wkc, 0);
    EXPECT_EQ(logical(Command::LRW, 0x10000, bytes({0, 0, 0, 0})).wkc, 1);
    set(0, kWrite);
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0, 0, 0, 0})).wkc, 0);
    EXPECT_EQ(logical(Command::LWR, 0x10000, bytes({0, 0, 0, 0})).wkc, 1);
    EXPECT_EQ(logical(Command::LRW, 0x10000, bytes({0, 0, 0, 0})).wkc, 2);
    set(0, {{0x10000}, 4, 0, 7, 0x1000, 0, true, true, true});
    EXPECT_EQ(logical(Command::LRW, 0x10000, bytes({0, 0, 0, 0})).wkc, 3);
}

TEST_F(FmmuTest, ReadsAndWritesItsWindowOnly) {
    fill(0x1000, {0x11, 0x22, 0x33, 0x44, 0x55, 0x66});
    set(0, kRead);
    EXPECT_EQ(logical(Command::LRD, 0xFFFE, bytes({9, 9, 9, 9, 9, 9, 9, 9})).data,
              bytes({9, 9, 0x11, 0x22, 0x33, 0x44, 9, 9}));
    EXPECT_EQ(logical(Command::LRD, 0x10002, bytes({9, 9, 9})).data, bytes({0x33, 0x44, 9})) << "from its middle";
    EXPECT_EQ(logical(Command::LRD, 0x10004, bytes({9})).wkc, 0) << "behind it";
    EXPECT_EQ(logical(Command::LRD, 0xFFFF, bytes({9})).wkc, 0) << "before it";
    set(0, kWrite);
    EXPECT_EQ(logical(Command::LWR, 0xFFFF, bytes({1, 2, 3, 4, 5, 6})).wkc, 1);
    EXPECT_EQ(memory(0x1000, 6), bytes({2, 3, 4, 5, 0x55, 0x66}));
}

// LRW: the read data are returned in the place of the written data.
TEST_F(FmmuTest, LrwExchangesAtTheSameAddress) {
    fill(0x1000, {0x11, 0x22, 0x33, 0x44});
    set(0, kWrite);
    set(1, {{0x10000}, 4, 0, 7, 0x1100, 0, true, false, true});
    fill(0x1100, {0xA1, 0xA2, 0xA3, 0xA4});
    const auto reply = logical(Command::LRW, 0x10000, bytes({1, 2, 3, 4}));
    EXPECT_EQ(reply.wkc, 3);
    EXPECT_EQ(reply.data, bytes({0xA1, 0xA2, 0xA3, 0xA4}));
    EXPECT_EQ(memory(0x1000, 4), bytes({1, 2, 3, 4})) << "written is what the master sent";
}

// Bits: from logical bit 6 to bit 1 of the next octet, at bit 3 of the memory.
TEST_F(FmmuTest, BitsAreMappedBothWays) {
    fill(0x1000, {0b01011000, 0});
    set(0, {{0x10000}, 2, 6, 1, 0x1000, 3, true, false, true});
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0xFF, 0xFF})).data, bytes({0xFF, 0b11111110}))
        << "four bits 1, 1, 0, 1; the others are left alone";
    fill(0x1000, {0b00101000, 0});
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0, 0})).data, bytes({0b01000000, 0b00000001}));
    // Digital outputs are writable bit by bit.
    set(0, {{0x10000}, 2, 6, 1, 0x0F00, 3, false, true, true});
    fill(0x0F00, {0xFF});
    EXPECT_EQ(logical(Command::LWR, 0x10000, bytes({0b01000000, 0b00000001})).wkc, 1);
    EXPECT_EQ(memory(0x0F00, 1), bytes({0b10101111})) << "the neighbours stay";
}

TEST_F(FmmuTest, ASingleBit) {
    set(0, {{0x09000000}, 1, 5, 5, 0x0805, 3, true, false, true});
    // masters-on-the-wire: libethercat maps bit 3 of the SyncManager status in this way and reads it by LRD.
    EXPECT_EQ(logical(Command::LRD, 0x09000000, bytes({0xFF})).data, bytes({0b11011111}));
    EXPECT_EQ(logical(Command::LRD, 0x09000000, bytes({0x00})).data, bytes({0}));
}

// 0x0008 bit 0: chips whose FMMUs map whole octets only.
TEST_F(FmmuTest, ChipsWithoutBitOperationMapOctets) {
    Rig other;
    auto chip = et1100();
    chip.features = static_cast<std::uint16_t>(chip.features | wire::features::kFmmuBitOperationNotSupported);
    other.add(chip, sii_image(kEmulationWithDc));
    other.on();
    std::vector<std::byte> raw(16);
    wire::store_fmmu(raw, {{0}, 1, 2, 3, 0x1000, 1, true, false, true});
    (void)other.write(0, 0x0600, raw);
    (void)other.write(0, 0x1000, bytes({0xA5}));
    EXPECT_EQ(other.send(Command::LRD, wire::DatagramAddress(LogicalAddress{0}), bytes({0})).data, bytes({0xA5}));
}

// "If two or more FMMUs with the same direction are configured for the same logical byte, the one with the lower number
// is used, the other ones are ignored."
TEST_F(FmmuTest, TheLowerNumberWinsAnOctet) {
    fill(0x1000, {1, 1, 1, 1});
    fill(0x1100, {2, 2, 2, 2, 2, 2});
    set(0, {{0x10001}, 2, 0, 7, 0x1000, 0, true, false, true});
    set(1, {{0x10000}, 6, 0, 7, 0x1100, 0, true, false, true});
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0, 0, 0, 0, 0, 0})).data, bytes({2, 1, 1, 2, 2, 2}));
    set(0, {{0x10001}, 2, 0, 7, 0x1000, 0, false, true, true});
    set(1, {{0x10000}, 6, 0, 7, 0x1100, 0, false, true, true});
    EXPECT_EQ(logical(Command::LWR, 0x10000, bytes({9, 8, 7, 6, 5, 4})).wkc, 1);
    EXPECT_EQ(memory(0x1000, 3), bytes({8, 7, 1}));
    EXPECT_EQ(memory(0x1100, 6), bytes({9, 2, 2, 6, 5, 4})) << "nothing of it where the other is in charge";
    // With bits, too, the whole octet belongs to the lower number.
    set(0, {{0x10000}, 1, 0, 3, 0x1000, 0, true, false, true});
    set(1, {{0x10000}, 1, 4, 7, 0x1100, 0, true, false, true});
    fill(0x1000, {0xFF});
    fill(0x1100, {0xFF});
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0})).data, bytes({0x0F}));
}

TEST_F(FmmuTest, OnlyActiveOnesMap) {
    set(0, {{0x10000}, 4, 0, 7, 0x1000, 0, true, false, false});
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0})).wkc, 0);
    set(0, kRead);
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0})).wkc, 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x060C, 0), 1) << "switched off by its last octet alone";
    EXPECT_EQ(logical(Command::LRD, 0x10000, bytes({0})).wkc, 0);
}

TEST_F(FmmuTest, NonsenseMapsNothing) {
    set(0, {{0x10000}, 0, 0, 7, 0x1000, 0, true, true, true});          // no length
    set(1, {{0x20000}, 1, 7, 0, 0x1000, 0, true, true, true});          // ends before it starts
    set(2, {{0x30000}, 4, 0, 7, 0xFFFE, 0, true, true, true});          // memory that does not exist
    set(3, {{0x40000}, 4, 0, 7, 0x2FFE, 0, true, true, true});          // beyond the end of the memory
    set(4, {{0xFFFFFFFE}, 0xFFFF, 0, 7, 0x1000, 0, true, true, true});  // beyond the end of the logical address space
    EXPECT_EQ(logical(Command::LRW, 0x10000, bytes({0, 0})).wkc, 0);
    EXPECT_EQ(logical(Command::LRW, 0x20000, bytes({0, 0})).wkc, 0);
    EXPECT_EQ(logical(Command::LRW, 0x30000, bytes({0, 0, 0, 0})).wkc, 0);
    EXPECT_EQ(logical(Command::LRW, 0x40000, bytes({1, 2, 3, 4})).wkc, 3) << "half of it is";
    EXPECT_EQ(memory(0x2FFE, 2), bytes({1, 2}));
    EXPECT_EQ(logical(Command::LRW, 0xFFFFFFFE, bytes({5, 6})).wkc, 3);
    EXPECT_EQ(memory(0x1000, 2), bytes({5, 6}));
}

// 0x0008 bit 9: no LRW (as TI's chips); bit 10: no BRW, APRW, FPRW.
TEST_F(FmmuTest, ChipsWithoutLrw) {
    Rig other;
    auto chip = et1100();
    chip.features = static_cast<std::uint16_t>(chip.features | wire::features::kLrwNotSupported |
                                               wire::features::kReadWriteNotSupported);
    other.add(chip, sii_image(kEmulationWithDc));
    other.on();
    std::vector<std::byte> raw(16);
    wire::store_fmmu(raw, {{0}, 1, 0, 7, 0x1000, 0, true, true, true});
    (void)other.write(0, 0x0600, raw);
    const auto address = wire::DatagramAddress(LogicalAddress{0});
    EXPECT_EQ(other.send(Command::LRW, address, bytes({1})).wkc, 0);
    EXPECT_EQ(other.send(Command::LWR, address, bytes({1})).wkc, 1);
    EXPECT_EQ(other.send(Command::LRD, address, bytes({0})).data, bytes({1}));
    EXPECT_EQ(other.send(Command::APRW, {RingPosition{0}, 0x1000}, bytes({2})).wkc, 0);
    EXPECT_EQ(other.send(Command::BRW, {std::uint16_t{0}, 0x1000}, bytes({2})).wkc, 0);
}

// Several slaves fill one datagram; two of them share an octet.
TEST(FmmuLine, SlavesShareAnOctet) {
    Rig rig;
    for (int i = 0; i < 2; ++i) rig.add(et1200(), sii_image(kDigitalIo));
    rig.on();
    for (std::uint16_t n = 0; n < 2; ++n) {
        std::vector<std::byte> raw(16);
        const auto first = static_cast<std::uint8_t>(4 * n);
        wire::store_fmmu(raw, {{0}, 1, first, static_cast<std::uint8_t>(first + 3), 0x0F00, 0, false, true, true});
        EXPECT_EQ(rig.write(n, 0x0600, raw).wkc, 1);
    }
    EXPECT_EQ(rig.send(Command::LWR, wire::DatagramAddress(LogicalAddress{0}), bytes({0xA5})).wkc, 2);
    EXPECT_EQ(rig.slave(0).peek(0x0F00, 1), bytes({0x05}));
    EXPECT_EQ(rig.slave(1).peek(0x0F00, 1), bytes({0x0A}));
}

}  // namespace
}  // namespace margay::sim::test
