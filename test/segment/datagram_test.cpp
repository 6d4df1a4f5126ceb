// Single datagrams by the public API, before and after a scan, and the memory of an image that is given when its size
// is known.
#include "segment/bench.hpp"

#include <margay/datagram.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

class SingleDatagrams : public SegmentTest {
  protected:
    void SetUp() override {
        plug_line({"coupler", "digital_in_8", "digital_out_8"});
        switch_on();
        ASSERT_TRUE(init(ctx, wire, osal));
    }
    Result<std::uint16_t> exchange(DatagramCommand command, std::uint16_t adp, std::uint16_t ado,
                                   std::span<std::byte> data) {
        return exchange_datagram(ctx, command, adp, ado, data, 100ms);
    }
};

TEST_F(SingleDatagrams, ReachAllSlavesAndOneByItsPositionBeforeAScan) {
    std::array<std::byte, 2> octets{};
    const auto all = exchange(DatagramCommand::brd, 0, 0x0000, octets);
    ASSERT_TRUE(all);
    EXPECT_EQ(*all, 3);
    octets = {std::byte{0x34}, std::byte{0x12}};
    EXPECT_EQ(*exchange(DatagramCommand::apwr, RingPosition{1}.on_wire(), 0x0010, octets), 1);
    EXPECT_EQ(octets[0], std::byte{0x34}) << "a write does not change the data";
    octets = {};
    EXPECT_EQ(*exchange(DatagramCommand::fprd, 0x1234, 0x0010, octets), 1);
    EXPECT_EQ(octets, (std::array{std::byte{0x34}, std::byte{0x12}}));
    EXPECT_EQ(*exchange(DatagramCommand::fprd, 0x7777, 0x0010, octets), 0) << "nobody has this address: no error";
}

TEST_F(SingleDatagrams, ReachTheLogicalAddressSpaceOfAMapping) {
    std::array<std::byte, 64> image{};
    ASSERT_TRUE(config_init(ctx));
    ASSERT_TRUE(config_map(ctx, image).ok());
    std::array<std::byte, 1> outputs{std::byte{0x5A}};
    DatagramRequest request;
    request.command = DatagramCommand::lwr;
    request.logical = {0};
    request.data = outputs;
    ASSERT_TRUE(submit(ctx, request));
    ASSERT_TRUE(wait(ctx, request));
    EXPECT_EQ(request.wkc, 1);
}

TEST_F(SingleDatagrams, WhatIsWrongIsRefused) {
    std::array<std::byte, 1487> many{};
    EXPECT_EQ(exchange(DatagramCommand::brd, 0, 0, {}).error().code, Errc::invalid_argument);
    EXPECT_EQ(exchange(DatagramCommand::brd, 0, 0, many).error().code, Errc::invalid_argument);
    EXPECT_EQ(exchange(static_cast<DatagramCommand>(15), 0, 0, std::span(many).first(2)).error().code,
              Errc::invalid_argument);
}

struct Memory {
    std::array<std::byte, 64> image{};
    std::size_t asked = 0;
    std::size_t given = 64;
    static std::span<std::byte> give(std::size_t bytes, void* user) {
        auto& self = *static_cast<Memory*>(user);
        self.asked = bytes;
        return std::span(self.image).first(std::min(bytes, self.given));
    }
};

TEST_F(SingleDatagrams, TheMemoryOfAnImageIsAskedForWhenItsSizeIsKnown) {
    ASSERT_TRUE(config_init(ctx));
    Memory memory;
    memory.image.fill(std::byte{0x77});
    MapRequest request;
    request.memory = Memory::give;
    request.memory_user = &memory;
    ASSERT_TRUE(submit(ctx, request));
    ASSERT_TRUE(wait(ctx, request));
    EXPECT_EQ(memory.asked, 2U);
    EXPECT_EQ(request.bytes, 2U);
    EXPECT_EQ(ctx.group(0).image.data(), memory.image.data());
    EXPECT_EQ(memory.image[1], std::byte{0}) << "what is used is set to zero";
    EXPECT_EQ(memory.image[2], std::byte{0x77}) << "and nothing behind it";
    ASSERT_TRUE(send_processdata(ctx));
    EXPECT_EQ(*receive_processdata(ctx, 500us), ctx.group(0).expected_wkc);
    memory.given = 1;
    ASSERT_TRUE(submit(ctx, request));
    EXPECT_EQ(wait(ctx, request).error().code, Errc::image_too_large);
}

}  // namespace
}  // namespace margay
