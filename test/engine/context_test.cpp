// The context and its requests, as an application uses them, with a far end that rarely answers.
#include "api/master.hpp"
#include "engine/scripted_nic.hpp"
#include "test_osal.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <array>
#include <memory>

namespace margay {
namespace {

using namespace std::chrono_literals;

class ContextTest : public testing::Test {
  protected:
    ScriptedNic nic;
    TestOsal osal;
    HostContext ctx{Limits{.slaves = 4}};
};

TEST_F(ContextTest, BeforeInitEverythingIsRefusedAndNothingCrashes) {
    ScanRequest scan;
    EXPECT_EQ(submit(ctx, scan).error().code, Errc::wrong_state);
    EXPECT_EQ(config_init(ctx).error().code, Errc::wrong_state);
    EXPECT_EQ(poll(ctx, osal.now()), kNever);
    EXPECT_TRUE(ctx.slaves().empty());
    EXPECT_EQ(ctx.slave(1).number, 0);
}

TEST_F(ContextTest, BeforeInitThereIsNothingToRead) {
    EXPECT_FALSE(ctx.errors().take().has_value());
    EXPECT_EQ(ctx.errors().dropped(), 0U);
    EXPECT_FALSE(ctx.warnings().take().has_value());
    EXPECT_FALSE(ctx.events().take().has_value());
    EXPECT_EQ(ctx.statistics().frames_sent, 0U);
    EXPECT_EQ(ctx.arena_bytes(), 0U);
    EXPECT_EQ(ctx.arena_peak_bytes(), 0U);
}

// A scan over a busy NIC ends, and its error says that nothing could be sent.
TEST_F(ContextTest, ScanOverANicThatStaysBusyEnds) {
    ASSERT_TRUE(init(ctx, nic, osal));
    nic.answer = SendStatus::busy;
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    const Time start = osal.now();
    Time now = start;
    while (scan.busy() && now - start < 60s) {
        const Time next = poll(ctx, now);
        if (scan.busy()) now = std::max(now + 1us, next);
    }
    EXPECT_EQ(scan.state(), RequestState::error);
    EXPECT_EQ(scan.error().code, Errc::nic_busy);
    std::array<char, 200> text{};
    EXPECT_EQ(describe(scan.error(), text), "counting slaves: the network interface does not take frames");
    EXPECT_LE(now - start, 5s);
    EXPECT_EQ(config_init(ctx).error().code, Errc::nic_busy) << "the blocking form ends too";
}

TEST_F(ContextTest, LinkSettingsHoldWhetherSetBeforeOrAfterInit) {
    ctx.link_settings().sendings = 2;
    ctx.link_settings().frame_timeout = 3ms;
    ASSERT_TRUE(init(ctx, nic, osal));
    const auto scan_ends_after = [&] {
        const Time start = osal.now();
        EXPECT_EQ(config_init(ctx).error().code, Errc::no_frame);
        return osal.now() - start;
    };
    EXPECT_LASTS(scan_ends_after(), 6ms);
    EXPECT_EQ(nic.sent.size(), 2U);
    ctx.link_settings().sendings = 1;
    ctx.link_settings().frame_timeout = 20ms;
    EXPECT_LASTS(scan_ends_after(), 20ms);
    EXPECT_EQ(nic.sent.size(), 3U);
}

TEST_F(ContextTest, CallbackOfEventsSetBeforeInitStays) {
    int told = 0;
    ctx.events().callback = [](const Event&, void* user) { ++*static_cast<int*>(user); };
    ctx.events().user = &told;
    ASSERT_TRUE(init(ctx, nic, osal));
    master_of(ctx)->network.report({});
    EXPECT_EQ(told, 1);
    EXPECT_TRUE(ctx.events().take().has_value());
}

// slave(0) and unknown slaves, before and after init(): the image has no octets, and every octet reads as zero.
TEST_F(ContextTest, SlaveThatIsNotThereHasAnImageThatDoesNoHarm) {
    for (int round = 0; round < 2; ++round) {
        for (const std::size_t number : {std::size_t{0}, std::size_t{1}, std::size_t{99}}) {
            const SlaveImage& image = ctx.slave(number).image;
            EXPECT_TRUE(image.inputs.bytes.empty());
            EXPECT_EQ(image.inputs.bytes[0], std::byte{0});
            image.outputs.bytes[7] = std::byte{0x55};
            EXPECT_EQ(image.outputs.bytes[7], std::byte{0});
        }
        if (round == 0) {
            ASSERT_TRUE(init(ctx, nic, osal));
        }
    }
}

TEST_F(ContextTest, LimitsOutOfRangeAreNamed) {
    HostContext none(Limits{.slaves = 0});
    EXPECT_EQ(init(none, nic, osal).error().code, Errc::invalid_argument);
    HostContext frames(Limits{.slaves = 1, .frames = 129});
    EXPECT_EQ(init(frames, nic, osal).error().code, Errc::invalid_argument);
    EXPECT_TRUE(init(ctx, nic, osal));
    EXPECT_EQ(init(ctx, nic, osal).error().code, Errc::wrong_state) << "once only";
}

TEST_F(ContextTest, UnpluggedCableIsWaitedForAndThenNamed) {
    ASSERT_TRUE(init(ctx, nic, osal));
    nic.link = LinkState::down;
    const Time start = osal.now();
    const auto found = config_init(ctx);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, Errc::link_down);
    EXPECT_GE(osal.now() - start, 1s);
    EXPECT_TRUE(nic.sent.empty());
}

TEST_F(ContextTest, NobodyAnswers) {
    ASSERT_TRUE(init(ctx, nic, osal));
    const auto found = config_init(ctx);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, Errc::no_frame);
    EXPECT_EQ(found.error().step, Step::count_slaves);
}

TEST_F(ContextTest, MoreSlavesThanThereIsRoomFor) {
    ASSERT_TRUE(init(ctx, nic, osal));
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    (void)poll(ctx, osal.now());
    ASSERT_EQ(nic.sent.size(), 1U);
    nic.incoming.push_back(reply_to(nic.sent[0], 5));
    (void)poll(ctx, osal.now());
    EXPECT_EQ(scan.state(), RequestState::error);
    EXPECT_EQ(scan.error().code, Errc::capacity);
    EXPECT_EQ(scan.error().expected, 5U);
    EXPECT_EQ(scan.error().actual, 4U);
    EXPECT_EQ(nic.sent.size(), 1U) << "nothing was written to a segment that cannot be handled";
}

TEST_F(ContextTest, EmptySegment) {
    ASSERT_TRUE(init(ctx, nic, osal));
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    (void)poll(ctx, osal.now());
    nic.incoming.push_back(reply_to(nic.sent[0], 0));
    (void)poll(ctx, osal.now());
    EXPECT_EQ(scan.error().code, Errc::no_slaves);
}

TEST_F(ContextTest, RequestsAreCheckedBeforeTheyStart) {
    ASSERT_TRUE(init(ctx, nic, osal));
    std::array<std::byte, 4> data{};
    EXPECT_EQ(read_sii(ctx, 1, 0, data).error().code, Errc::unknown_slave);
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    EXPECT_TRUE(scan.busy());
    EXPECT_EQ(submit(ctx, scan).error().code, Errc::busy);
}

TEST_F(ContextTest, CanceledRequestLeavesTheContextUsable) {
    ASSERT_TRUE(init(ctx, nic, osal));
    {
        ScanRequest forgotten;
        ASSERT_TRUE(submit(ctx, forgotten));
        (void)poll(ctx, osal.now());
    }
    ScanRequest canceled;
    ASSERT_TRUE(submit(ctx, canceled));
    canceled.cancel();
    EXPECT_EQ(canceled.state(), RequestState::error);
    EXPECT_EQ(canceled.error().code, Errc::canceled);
    nic.incoming.push_back(reply_to(nic.sent[0], 1));
    (void)poll(ctx, osal.now());
    ASSERT_TRUE(submit(ctx, canceled)) << "may be used again";
    EXPECT_TRUE(canceled.busy());
}

TEST_F(ContextTest, ContextThatGoesAwayEndsItsRequests) {
    auto shorter = std::make_unique<StaticContext<Limits{.slaves = 2}>>();
    ASSERT_TRUE(init(*shorter, nic, osal));
    ScanRequest scan;
    ASSERT_TRUE(submit(*shorter, scan));
    (void)poll(*shorter, osal.now());
    shorter.reset();
    EXPECT_EQ(scan.error().code, Errc::canceled);
}

TEST_F(ContextTest, TwoContextsShareNothing) {
    HostContext other(Limits{.slaves = 4});
    ScriptedNic other_nic;
    ASSERT_TRUE(init(ctx, nic, osal));
    ASSERT_TRUE(init(other, other_nic, osal));
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    (void)poll(other, osal.now());
    EXPECT_TRUE(other_nic.sent.empty());
    (void)poll(ctx, osal.now());
    EXPECT_EQ(nic.sent.size(), 1U);
    EXPECT_EQ(other.statistics().frames_sent, 0U);
}

}  // namespace
}  // namespace margay
