// Registers by the public API: values, access during cycles, and refused accesses.
#include "segment/bench.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class Registers : public SegmentTest {
  protected:
    void SetUp() override {
        plug_line({"coupler", "digital_in_8", "digital_out_8"});
        switch_on();
        ASSERT_TRUE(bring_up());
    }
};

TEST_F(Registers, AreReadAndWrittenOfTheSlaveThatIsNamed) {
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 2, 0x0010), 0x1002);  // its station address
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 3, 0x0010), 0x1003);
    ASSERT_TRUE(write_register<std::uint16_t>(ctx, 3, 0x0420, 0x1234));
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 3, 0x0420), 0x1234);
    EXPECT_NE(*read_register<std::uint16_t>(ctx, 2, 0x0420), 0x1234);
    // Many octets at once: the SyncManagers of the output terminal.
    std::array<std::byte, 32> all{};
    ASSERT_TRUE(read_register(ctx, 3, 0x0800, all));
    EXPECT_EQ(all[2], static_cast<std::byte>(*read_register<std::uint8_t>(ctx, 3, 0x0802)));
}

TEST_F(Registers, RideInTheFramesOfACycle) {
    std::array<std::byte, 64> image{};
    ASSERT_TRUE(config_map(ctx, image).ok());
    std::array<std::byte, 2> octets{};
    RegisterReadRequest request;
    request.slave = 2;
    request.address = 0x0010;
    request.data = octets;
    for (int n = 0; n < 4; ++n) {
        osal.advance(1ms);
        if (n == 2) {
            ASSERT_TRUE(submit(ctx, request));
            EXPECT_EQ(submit(ctx, request).error().code, Errc::busy);
        }
        (void)poll(ctx, osal.now());
        const auto frames = ctx.statistics().frames_sent;
        ASSERT_TRUE(send_processdata(ctx));
        EXPECT_EQ(*receive_processdata(ctx, 500us), ctx.group(0).expected_wkc);
        EXPECT_EQ(ctx.statistics().frames_sent - frames, 1U) << "none of its own";
    }
    (void)poll(ctx, osal.now());
    EXPECT_EQ(request.state(), RequestState::success);
    EXPECT_EQ(octets, (std::array{std::byte{0x02}, std::byte{0x10}}));
}

TEST_F(Registers, WhatIsWrongIsNamed) {
    EXPECT_EQ(words(read_register<std::uint8_t>(ctx, 4, 0x0000).error()),
              "slave 4: reading at register 0x0000: there is no such slave (there are 3)");
    std::array<std::byte, 1500> many{};
    const auto refused = [&](std::uint16_t address, std::size_t octets) {
        return read_register(ctx, 1, address, std::span(many).first(octets)).error().code;
    };
    EXPECT_EQ(refused(0x1000, 0), Errc::invalid_argument);
    EXPECT_EQ(refused(0x1000, 1487), Errc::invalid_argument);
    EXPECT_EQ(refused(0xFFFF, 2), Errc::invalid_argument);
    EXPECT_EQ(write_register(ctx, 1, 0xFFFF, std::span(many).first(2)).error().code, Errc::invalid_argument);
    segment.set_power(2, false, osal.now());
    EXPECT_EQ(write_register<std::uint16_t>(ctx, 3, 0x0420, 1).error().code, Errc::working_counter);
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 2, 0x0010), 0x1002) << "and the others answer";
}

TEST(RegistersBeforeInit, AreRefused) {
    HostContext ctx{Limits{.slaves = 1}};
    EXPECT_EQ(read_register<std::uint8_t>(ctx, 1, 0x0000).error().code, Errc::wrong_state);
    EXPECT_EQ(write_register<std::uint8_t>(ctx, 1, 0x0000, 1).error().code, Errc::wrong_state);
}

}  // namespace
}  // namespace margay
