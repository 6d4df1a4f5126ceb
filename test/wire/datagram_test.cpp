// Frames and datagrams compared with bytes written by hand from ETG.1000.4 "EtherCAT frame structure".
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace margay::wire {
namespace {

std::vector<std::byte> bytes(std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

TEST(FrameBuilder, BuildsTheFrameOfTheCaptureOctetByOctet) {
    // soem-sdinfo: BWR, 1 octet at 0x0103, source 01:01:01:01:01:01.
    std::array<std::byte, kMaxFrameBytes> buffer{};
    FrameBuilder builder(buffer, {1, 1, 1, 1, 1, 1});
    auto data = builder.append(Command::BWR, 0x05, DatagramAddress(std::uint16_t{0}, std::uint16_t{0x0103}), 1);
    data[0] = std::byte{0xAA};
    const auto frame = builder.finish();
    const auto expected =
        bytes({0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1,    1,    1,    1,    1,    1,    0x88, 0xa4, 0x0d,
               0x10, 0x08, 0x05, 0x00, 0x00, 0x03, 0x01, 0x01, 0x00, 0x00, 0x00, 0xaa, 0x00, 0x00});
    EXPECT_EQ(std::vector<std::byte>(frame.begin(), frame.end()), expected);
}

TEST(FrameBuilder, ChainsDatagramsWithTheMoreBit) {
    std::array<std::byte, kMaxFrameBytes> buffer{};
    FrameBuilder builder(buffer, {0, 1, 2, 3, 4, 5});
    (void)builder.append(Command::FPRD, 1, DatagramAddress(StationAddress{0x1001}, 0x0130), 2);
    (void)builder.append(Command::APWR, 2, DatagramAddress(RingPosition{2}, 0x0010), 2);
    DatagramReader reader(builder.finish());
    const auto first = reader.next();
    ASSERT_TRUE(first);
    EXPECT_TRUE(first->header.more);
    EXPECT_EQ(first->header.address.adp(), 0x1001);
    EXPECT_EQ(first->header.address.ado(), 0x0130);
    const auto second = reader.next();
    ASSERT_TRUE(second);
    EXPECT_FALSE(second->header.more);
    EXPECT_EQ(second->header.address.adp(), 0xFFFE);  // the third slave: −2
    EXPECT_FALSE(reader.next());
    EXPECT_EQ(reader.fault(), FrameFault::none);
}

TEST(DatagramReader, NamesEveryFault) {
    const auto fault_of = [](std::vector<std::byte> frame) {
        DatagramReader reader(frame);
        while (reader.next()) {
        }
        return reader.fault();
    };
    std::array<std::byte, 64> buffer{};
    FrameBuilder builder(buffer, {});
    (void)builder.append(Command::BRD, 0, DatagramAddress(0), 4);
    const auto whole = builder.finish();
    std::vector<std::byte> frame(whole.begin(), whole.end());
    EXPECT_EQ(fault_of(frame), FrameFault::none);
    for (std::size_t cut = 0; cut < kFramePrefixBytes; ++cut)
        EXPECT_EQ(fault_of({frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(cut)}), FrameFault::too_short);
    for (std::size_t cut = kFramePrefixBytes; cut < frame.size(); ++cut)
        EXPECT_EQ(fault_of({frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(cut)}), FrameFault::truncated);
    auto foreign = frame;
    foreign[13] = std::byte{0x00};
    EXPECT_EQ(fault_of(foreign), FrameFault::foreign);
    auto trailing = frame;
    trailing[14] = std::byte{0x11};  // one octet more than the datagram has
    trailing.push_back(std::byte{0});
    EXPECT_EQ(fault_of(trailing), FrameFault::trailing);
    auto more = frame;
    more[kFramePrefixBytes + 7] |= std::byte{0x80};
    EXPECT_EQ(fault_of(more), FrameFault::truncated);
}

}  // namespace
}  // namespace margay::wire
