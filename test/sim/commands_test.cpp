// All commands: addressing, working counter, returned data. ETG.1000.4 tables "Command", "Working counter increment".
#include "rig.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct CommandsTest : testing::Test {
    Rig rig;
    void SetUp() override {
        for (int i = 0; i < 3; ++i) rig.add(et1100(), sii_image(kEmulationWithDc));
        rig.on();
        for (std::uint16_t n = 0; n < 3; ++n) {
            (void)rig.put<std::uint16_t>(n, 0x0010, static_cast<std::uint16_t>(0x1001 + n));
            (void)rig.put<std::uint8_t>(n, 0x1000, static_cast<std::uint8_t>(1u << n));
        }
    }
    std::vector<std::byte> values() {
        std::vector<std::byte> all;
        for (std::uint32_t n = 0; n < 3; ++n) all.push_back(rig.slave(n).peek(0x1000, 1)[0]);
        return all;
    }
};

TEST_F(CommandsTest, NopTouchesNobody) {
    const auto reply = rig.send(Command::NOP, {std::uint16_t{0}, 0x1000}, bytes({0x55}));
    EXPECT_TRUE(reply.returned);
    EXPECT_EQ(reply.wkc, 0);
    EXPECT_EQ(reply.data, bytes({0x55}));
    EXPECT_EQ(reply.header.address.adp(), 0);
}

TEST_F(CommandsTest, ByPosition) {
    for (std::uint16_t n = 0; n < 3; ++n) {
        const auto reply = rig.send(Command::APRD, {RingPosition{n}, 0x1000}, bytes({0}));
        EXPECT_EQ(reply.wkc, 1);
        EXPECT_EQ(reply.data[0], static_cast<std::byte>(1u << n));
        EXPECT_EQ(reply.header.address.adp(), static_cast<std::uint16_t>(3 - n)) << "each slave has added 1";
    }
    EXPECT_EQ(rig.send(Command::APRD, {RingPosition{3}, 0x1000}, bytes({0})).wkc, 0);
    EXPECT_EQ(rig.send(Command::APWR, {RingPosition{1}, 0x1000}, bytes({9})).wkc, 1);
    EXPECT_EQ(values(), bytes({1, 9, 4}));
    const auto both = rig.send(Command::APRW, {RingPosition{2}, 0x1000}, bytes({8}));
    EXPECT_EQ(both.wkc, 3);
    EXPECT_EQ(both.data, bytes({4})) << "read before it was written";
    EXPECT_EQ(values(), bytes({1, 9, 8}));
}

TEST_F(CommandsTest, ByStation) {
    const auto reply = rig.send(Command::FPRD, {StationAddress{0x1002}, 0x1000}, bytes({0}));
    EXPECT_EQ(reply.wkc, 1);
    EXPECT_EQ(reply.data, bytes({2}));
    EXPECT_EQ(reply.header.address.adp(), 0x1002) << "not counted up";
    EXPECT_EQ(rig.send(Command::FPWR, {StationAddress{0x1003}, 0x1000}, bytes({7})).wkc, 1);
    const auto both = rig.send(Command::FPRW, {StationAddress{0x1001}, 0x1000}, bytes({8}));
    EXPECT_EQ(both.wkc, 3);
    EXPECT_EQ(both.data, bytes({1}));
    EXPECT_EQ(values(), bytes({8, 2, 7}));
    // Two slaves with the same address both answer: the second overwrites the data of the first.
    (void)rig.put<std::uint16_t>(1, 0x0010, 0x1001);
    const auto twice = rig.send(Command::FPRD, {StationAddress{0x1001}, 0x1000}, bytes({0}));
    EXPECT_EQ(twice.wkc, 2);
    EXPECT_EQ(twice.data, bytes({2}));
}

// "Broadcast read: all slaves put a logical OR of their data and the data of the datagram into it."
TEST_F(CommandsTest, Broadcast) {
    const auto reply = rig.send(Command::BRD, {std::uint16_t{0}, 0x1000}, bytes({0x40}));
    EXPECT_EQ(reply.wkc, 3);
    EXPECT_EQ(reply.data, bytes({0x47}));
    EXPECT_EQ(reply.header.address.adp(), 3);
    const auto both = rig.send(Command::BRW, {std::uint16_t{0x1234}, 0x1000}, bytes({0x10}));
    EXPECT_EQ(both.wkc, 9);
    EXPECT_EQ(both.header.address.adp(), 0x1237);
    EXPECT_EQ(both.data, bytes({0x17}));
    EXPECT_EQ(rig.slave(0).peek(0x1000, 1), bytes({0x10})) << "each writes what came to it …";
    EXPECT_EQ(rig.slave(2).peek(0x1000, 1), bytes({0x13})) << "… which holds what those before have read";
    EXPECT_EQ(rig.send(Command::BWR, {std::uint16_t{0}, 0x1000}, bytes({0x77})).wkc, 3);
    EXPECT_EQ(values(), bytes({0x77, 0x77, 0x77}));
}

// "Read multiple write: the slave addressed reads, the others write what it read."
TEST_F(CommandsTest, ReadMultipleWrite) {
    const auto by_position = rig.send(Command::ARMW, {RingPosition{0}, 0x1000}, bytes({0xFF}));
    EXPECT_EQ(by_position.wkc, 3);
    EXPECT_EQ(by_position.data, bytes({1}));
    EXPECT_EQ(by_position.header.address.adp(), 3);
    EXPECT_EQ(values(), bytes({1, 1, 1}));
    (void)rig.put<std::uint8_t>(1, 0x1000, 5);
    const auto by_station = rig.send(Command::FRMW, {StationAddress{0x1002}, 0x1000}, bytes({0xFF}));
    EXPECT_EQ(by_station.wkc, 3);
    EXPECT_EQ(by_station.data, bytes({5}));
    EXPECT_EQ(by_station.header.address.adp(), 0x1002);
    EXPECT_EQ(values(), bytes({0xFF, 5, 5})) << "those before it write what the master sent";
}

TEST_F(CommandsTest, UnknownCommandsPass) {
    for (const unsigned code : {15u, 16u, 99u, 255u}) {
        const auto reply = rig.send(static_cast<Command>(code), {std::uint16_t{0}, 0x1000}, bytes({0x55}));
        EXPECT_TRUE(reply.returned);
        EXPECT_EQ(reply.wkc, 0);
        EXPECT_EQ(reply.data, bytes({0x55}));
    }
}

TEST_F(CommandsTest, TheWorkingCounterGoesOnFromWhatCame) {
    std::array<std::byte, 60> raw{};
    wire::FrameBuilder builder(raw, {0, 1, 1, 1, 1, 1});
    (void)builder.append(Command::BRD, 0, {std::uint16_t{0}, 0x0000}, 1);
    const auto size = builder.finish().size();
    store_le<std::uint16_t>(raw, size - 2, 0xFFFE);
    rig.now += 100us;
    (void)rig.segment.process(MutableBytes(raw).first(size), rig.now);
    EXPECT_EQ(load_le<std::uint16_t>(raw, size - 2), 1) << "modulo 65536";
}

TEST_F(CommandsTest, ADatagramWithoutData) {
    const auto reply = rig.send(Command::BRD, {std::uint16_t{0}, 0x0000}, {});
    EXPECT_TRUE(reply.returned);
    EXPECT_EQ(reply.wkc, 0);
    EXPECT_EQ(rig.send(Command::LRW, wire::DatagramAddress(LogicalAddress{0}), {}).wkc, 0);
}

// An access to registers of several kinds has the effect of an access to each of them.
TEST_F(CommandsTest, AnAccessAcrossRegisters) {
    // 0x0120 AL control to 0x0135 AL status code: AL control is written, the other registers are read-only.
    auto data = std::vector<std::byte>(0x16);
    data[0] = std::byte{0x02};
    data[0x10] = std::byte{0x55};
    EXPECT_EQ(rig.write(0, 0x0120, data).wkc, 1);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0120), 2);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0130), 2) << "device emulation, not 0x55";
    // SII control and address in one access that begins in the register before them.
    EXPECT_EQ(rig.write(0, 0x0500, bytes({0, 0, 0, 1, 8, 0, 0, 0})).wkc, 1);
    rig.pass(10ms);
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0508), 0xA008);
    // From the reserved octets of the last FMMU into addresses without registers.
    EXPECT_EQ(rig.read(0, 0x05F0, 32).wkc, 1);
}

// --- Frames ---

struct FramesTest : CommandsTest {
    std::vector<std::byte> frame(std::size_t size = 60) {
        std::vector<std::byte> raw(size);
        wire::FrameBuilder builder(raw, {0x00, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE});
        (void)builder.append(Command::BRD, 7, {std::uint16_t{0}, 0x0000}, 1);
        (void)builder.finish();
        return raw;
    }
    Segment::Passage send_raw(std::vector<std::byte>& raw) {
        rig.now += 100us;
        return rig.segment.process(raw, rig.now);
    }
    static std::uint16_t wkc(const std::vector<std::byte>& raw, std::size_t extra = 0) {
        return load_le<std::uint16_t>(raw, 14 + extra + 2 + 10 + 1);
    }
};

// ETG.1000.4: the processing unit sets bit 1 of the first source octet, also in group addresses like SOEM's.
TEST_F(FramesTest, SourceMacIsMarked) {
    for (const unsigned first : {0x00u, 0x01u, 0x10u, 0xCAu}) {
        auto raw = frame();
        raw[6] = static_cast<std::byte>(first);
        EXPECT_TRUE(send_raw(raw).returned);
        EXPECT_EQ(raw[6], static_cast<std::byte>(first | 2));
        EXPECT_EQ(wkc(raw), 3) << "whatever the source is";
        EXPECT_EQ(raw[7], std::byte{0xAA});
    }
}

TEST_F(FramesTest, PaddedAndUnpadded) {
    auto padded = frame(60);
    auto bare = frame(29);
    EXPECT_TRUE(send_raw(padded).returned);
    EXPECT_TRUE(send_raw(bare).returned);
    EXPECT_EQ(wkc(padded), 3);
    EXPECT_EQ(wkc(bare), 3);
    EXPECT_EQ(padded[16 + 1], std::byte{7}) << "the index is the master's business";
}

// ESC data sheets, "EtherCAT frame": with a VLAN tag, and in UDP/IP at port 0x88A4.
TEST_F(FramesTest, VlanAndUdp) {
    auto raw = frame();
    raw.insert(raw.begin() + 12, {std::byte{0x81}, std::byte{0}, std::byte{0}, std::byte{5}});
    EXPECT_TRUE(send_raw(raw).returned);
    EXPECT_EQ(wkc(raw, 4), 3);

    raw = frame();
    std::vector<std::byte> ip(28);
    ip[0] = std::byte{0x45};
    ip[9] = std::byte{17};
    ip[22] = std::byte{0x88};
    ip[23] = std::byte{0xA4};
    ip[26] = ip[27] = std::byte{0x33};
    raw.insert(raw.begin() + 14, ip.begin(), ip.end());
    raw[12] = std::byte{0x08};
    raw[13] = std::byte{0x00};
    EXPECT_TRUE(send_raw(raw).returned);
    EXPECT_EQ(wkc(raw, 28), 3);
    EXPECT_EQ(load_le<std::uint16_t>(raw, 14 + 26), 0) << "the UDP checksum would be wrong now";
}

// A circulating datagram is destroyed when it arrives at a closed port 0 for the second time (ETG.1000.4 "Circulating
// frames"). This happens when the master's cable is pulled while a frame is on the wire.
TEST(CirculatingFrames, AreDestroyedTheSecondTime) {
    Rig rig;
    for (int i = 0; i < 3; ++i) rig.add(et1100(), sii_image(kEmulationWithDc));
    EXPECT_TRUE(rig.segment.connect_master({2, 1}, 1));  // the far end
    rig.on();
    // The cable of the first master port is pulled: a frame from the second port turns at the closed port 0.
    rig.segment.set_cable({0, 0}, false);
    auto reply = rig.frame({{Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})}}, 1).at(0);
    EXPECT_TRUE(reply.returned);
    EXPECT_EQ(reply.wkc, 3);
    EXPECT_TRUE(reply.header.circulating) << "marked by the slave whose port 0 is closed";
    // The same frame again, as if it had circulated.
    std::array<std::byte, 60> raw{};
    wire::FrameBuilder builder(raw, {0, 1, 1, 1, 1, 1});
    (void)builder.append(Command::BRD, 0, {std::uint16_t{0}, 0x0000}, 1);
    const auto size = builder.finish().size();
    raw[14 + 2 + 7] |= std::byte{0x40};
    rig.now += 100us;
    EXPECT_FALSE(rig.segment.process(MutableBytes(raw).first(size), rig.now, 1).returned);
}

TEST_F(FramesTest, NonsenseIsCountedAndSurvived) {
    auto raw = frame();
    raw[16 + 6] = std::byte{0xFF};  // a length beyond the end of the frame
    raw[16 + 7] = std::byte{0x07};
    EXPECT_TRUE(send_raw(raw).returned);
    EXPECT_EQ(rig.slave(0).peek(0x030C, 1), bytes({1}));
    for (std::size_t size = 0; size <= 29; ++size) {
        auto cut = frame(29);
        cut.resize(size);
        (void)send_raw(cut);
    }
    auto other = frame();
    other[15] = std::byte{0x40};  // type 4: no datagrams
    other[14] = std::byte{0x0B};
    EXPECT_EQ(wkc(other), 0);
    (void)send_raw(other);
    EXPECT_EQ(wkc(other), 0);
}

}  // namespace
}  // namespace margay::sim::test
