// GroupConfiguration::hold_inputs: the image changes only while the application receives its group, no matter which
// call receives the frames.
#include "process_data/bus.hpp"

#include <functional>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct Form {
    const char* name;
    std::function<void(GroupConfiguration&)> set;
};

// Two slaves with a clock and one octet in each direction, in one group or in two groups.
class HoldInputsTest : public testing::TestWithParam<Form> {
  protected:
    Bus bus;
    std::array<std::vector<std::byte>, 2> images{std::vector<std::byte>(64), std::vector<std::byte>(64)};
    std::uint8_t value = 0x10;

    HostContext& ctx() { return *bus.ctx; }
    void start(bool two_groups = false, bool hold = true) {
        for (int n = 0; n < 2; ++n) bus.add(8, 8);
        bus.start({.slaves = 8, .groups = 2});
        if (two_groups) ctx().slave(2).config.group = 1;
        for (std::uint8_t n = 0; n < (two_groups ? 2 : 1); ++n) {
            GetParam().set(ctx().group(n).config);
            ctx().group(n).config.hold_inputs = hold;
            ASSERT_TRUE(config_map(ctx(), images[n], n).ok());
        }
    }
    void set_inputs() {
        ++value;
        for (std::size_t n = 1; n <= 2; ++n) {
            bus.device(n).inputs()[0] = std::byte{value};
            bus.device(n).poke();
        }
    }
    std::uint8_t input(std::size_t n) { return std::to_integer<std::uint8_t>(ctx().slave(n).image.inputs.bytes[0]); }
    void poll_until_back() {
        for (int n = 0; n < 5; ++n) {
            bus.osal.advance(100us);
            (void)poll(ctx(), bus.osal.now());
        }
    }
    Result<std::uint32_t> receive(std::uint8_t group = 0) { return receive_processdata(ctx(), 500us, group); }
};

TEST_P(HoldInputsTest, AReplyThatAPollTakesInChangesTheImageWhenTheGroupIsReceived) {
    start();
    ASSERT_EQ(bus.to_op().state, AlState::op);
    const auto wkc = bus.cycle();
    ASSERT_TRUE(wkc.ok());
    const auto lost = ctx().statistics().lost;
    for (int n = 0; n < 20; ++n) {
        set_inputs();
        const std::uint8_t before = input(1);
        const Group& group = ctx().group(0);
        const std::uint64_t time = group.dc_time.value;
        images[0][0] = std::byte{value};
        ASSERT_TRUE(send_processdata(ctx()).ok());
        poll_until_back();
        EXPECT_EQ(input(1), before);
        EXPECT_EQ(group.dc_time.value, time);
        const auto received = receive();
        ASSERT_TRUE(received.ok()) << n;
        EXPECT_EQ(*received, *wkc);
        EXPECT_EQ(input(1), value);
        EXPECT_EQ(input(2), value);
        const std::uint8_t applied = n == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(value - 1);
        EXPECT_EQ(bus.device(1).outputs()[0], std::byte{applied}) << "of the cycle before; not the reply in the frame";
        if (group.config.dc_reference != 0) {
            EXPECT_EQ(group.dc_time.slaves, 2);
            EXPECT_EQ(group.dc_time.value - time, n == 0 ? group.dc_time.value - time : 500'000U);
            EXPECT_EQ(group.al_status.value, 0x08U) << "not combined with the reply before";
        }
    }
    EXPECT_EQ(ctx().statistics().lost, lost);
}

TEST_P(HoldInputsTest, WithoutItThePollChangesTheImage) {
    start(false, false);
    ASSERT_TRUE(bus.cycle().ok());
    set_inputs();
    ASSERT_TRUE(send_processdata(ctx()).ok());
    poll_until_back();
    EXPECT_EQ(input(1), value);
    EXPECT_TRUE(receive().ok());
}

TEST_P(HoldInputsTest, ReceivingAnotherGroupLeavesTheImage) {
    start(true);
    ASSERT_TRUE(bus.cycle(0).ok());
    ASSERT_TRUE(bus.cycle(1).ok());
    for (int n = 0; n < 5; ++n) {
        set_inputs();
        const std::uint8_t before = input(2);
        ASSERT_TRUE(send_processdata(ctx(), 1).ok());
        ASSERT_TRUE(send_processdata(ctx(), 0).ok());
        bus.osal.advance(100us);
        ASSERT_TRUE(receive(0).ok());
        EXPECT_EQ(input(1), value);
        EXPECT_EQ(input(2), before);
        ASSERT_TRUE(receive(1).ok());
        EXPECT_EQ(input(2), value);
    }
}

TEST_P(HoldInputsTest, AReplyThatIsNotReceivedIsNotTheReplyOfTheNextCycle) {
    start();
    ASSERT_TRUE(bus.cycle().ok());
    set_inputs();
    ASSERT_TRUE(send_processdata(ctx()).ok());
    poll_until_back();
    const std::uint8_t before = input(1);
    set_inputs();
    ASSERT_TRUE(send_processdata(ctx()).ok());
    EXPECT_EQ(input(1), before);
    poll_until_back();
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(input(1), value);

    // The inputs stay also when the next cycle is lost.
    set_inputs();
    ASSERT_TRUE(send_processdata(ctx()).ok());
    poll_until_back();
    bus.segment.disconnect({0, 0});
    EXPECT_EQ(send_processdata(ctx()).error().code, Errc::nic);
    poll_until_back();
    EXPECT_EQ(receive().error().code, Errc::no_frame);
    EXPECT_NE(input(1), value);
    ASSERT_TRUE(bus.segment.connect_master({0, 0}));
    bus.osal.advance(100ms);
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(input(1), value);
}

TEST_P(HoldInputsTest, ALostSlaveKeepsItsInputs) {
    start();
    ASSERT_TRUE(bus.cycle().ok());
    bus.segment.set_power(1, false, bus.osal.now());
    const std::uint8_t before = input(2);
    for (int n = 0; n < 10; ++n) {
        set_inputs();
        ASSERT_TRUE(send_processdata(ctx()).ok());
        poll_until_back();
        EXPECT_EQ(receive().error().code, Errc::working_counter);
        EXPECT_EQ(input(2), before);
        (void)readstate(ctx());
    }
    EXPECT_EQ(input(1), value) << "known to be lost: the inputs of the other slave come";
}

TEST_P(HoldInputsTest, AFrameThatIsLostLeavesThoseBehindIt) {
    for (int n = 0; n < 2; ++n) bus.add(8 * 800, 8 * 800);
    bus.start({.slaves = 8});
    GetParam().set(ctx().group(0).config);
    ctx().group(0).config.hold_inputs = true;
    std::vector<std::byte> image(4096);
    ASSERT_TRUE(config_map(ctx(), image).ok());
    const Group& group = ctx().group(0);
    ASSERT_GT(group.frames, 1);
    ASSERT_TRUE(bus.cycle().ok());
    for (int n = 0; n < 5; ++n) {
        ++value;
        std::ranges::fill(bus.device(2).inputs(), std::byte{value});
        bus.device(2).poke();
        bus.segment.lose_next({0, 0});
        ASSERT_TRUE(send_processdata(ctx()).ok());
        poll_until_back();
        const auto received = receive();
        EXPECT_EQ(received.error().code, Errc::no_frame);
        EXPECT_EQ(received.error().actual, 1U) << "one of " << group.frames;
        EXPECT_FALSE(group.datagrams.front().came);
        EXPECT_TRUE(group.datagrams.back().fresh);
        EXPECT_EQ(ctx().slave(2).image.inputs.bytes[799], std::byte{value});
    }
    EXPECT_TRUE(bus.cycle().ok());
}

TEST_P(HoldInputsTest, RequestsTravelWithTheCycleAndEndInThePoll) {
    start();
    for (int n = 0; n < 5; ++n) ASSERT_TRUE(bus.cycle().ok());
    RegisterReadRequest request;
    std::array<std::byte, 2> data{};
    request.slave = 1;
    request.address = 0x0130;
    request.data = data;
    ASSERT_TRUE(submit(ctx(), request).ok());
    for (int n = 0; n < 10 && request.busy(); ++n) {
        set_inputs();
        const std::uint8_t before = input(1);
        ASSERT_TRUE(send_processdata(ctx()).ok());
        poll_until_back();
        EXPECT_EQ(input(1), before);
        ASSERT_TRUE(receive().ok());
        EXPECT_EQ(input(1), value);
    }
    EXPECT_EQ(request.state(), RequestState::success);
}

INSTANTIATE_TEST_SUITE_P(Forms, HoldInputsTest,
                         testing::Values(Form{"OneDatagram", [](GroupConfiguration&) {}},
                                         Form{"BlockLrw", [](GroupConfiguration& c) { c.block_lrw = true; }},
                                         Form{"Overlapped", [](GroupConfiguration& c) { c.overlapped = true; }},
                                         Form{"Readings",
                                              [](GroupConfiguration& c) {
                                                  c.al_status = true;
                                                  if (c.start.value == 0) c.dc_reference = 1;
                                              }}),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace margay
