// SlaveConfiguration::sms describe the next mapping of a slave. The image of the last mapping does not change.
#include "process_data/bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class NextSizes : public testing::Test, protected Bus {
  protected:
    std::array<std::byte, 1024> image{};

    void SetUp() override {
        for (int n = 0; n < 4; ++n) add(16, 16);
        start();
        ASSERT_TRUE(config_map(*ctx, image));
        ASSERT_EQ(to_op().state, AlState::op);
        ASSERT_TRUE(submit(*ctx, supervision));
        cycles(50);
    }
    void cycles(int count) {
        while (count-- > 0) (void)cycle();
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    // Checks that slave 3 receives the outputs that the application writes for slave 3.
    void expect_outputs_of_slave_3() {
        std::ranges::fill(ctx->slave(2).image.outputs.bytes, std::byte{0x22});
        std::ranges::fill(ctx->slave(3).image.outputs.bytes, std::byte{0x33});
        cycles(3);
        for (const std::byte octet : device(3).outputs()) EXPECT_EQ(octet, std::byte{0x33});
    }
    SuperviseRequest supervision;
};

constexpr auto kRemap =
    "slave 2: mapping process data: its revision, SyncManagers or PDOs have changed since config_map(): call "
    "config_map() again";

TEST_F(NextSizes, ASlaveThatComesBackWaitsForTheMapping) {
    const std::uint32_t expected = *cycle();
    for (const bool fewer : {false, true}) {
        SlaveConfiguration& config = ctx->slave(2).config;
        const SlaveConfiguration before = config;
        config.source = ConfigurationSource::application;
        config.sms[0].bits += 8;
        if (fewer) config.sm_count = 0;
        segment.set_power(1, false, osal.now());
        cycles(50);
        EXPECT_EQ(cycle().error().expected, expected) << "counted as before";
        while (ctx->events().take()) {
        }
        segment.set_power(1, true, osal.now());
        cycles(3000);
        int states = 0;
        while (const auto event = ctx->events().take()) states += event->kind == EventKind::state ? 1 : 0;
        EXPECT_LE(states, 2) << "to PREOP, and there it stays";
        EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
        EXPECT_EQ(words(what_is_wrong(*ctx)), kRemap);
        EXPECT_EQ(cycle().error().expected, expected);
        expect_outputs_of_slave_3();
        config = before;
        cycles(3000);
        EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
        EXPECT_EQ(*cycle(), expected);
    }
    ctx->slave(2).config.source = ConfigurationSource::application;
    ctx->slave(2).config.sms[0].bits -= 8;
    supervision.cancel();
    // The mapping writes the new size, which this device cannot have.
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 2: requesting a state: the slave refused (wanted SAFEOP, is in PREOP, AL status code 0x001d: "
              "invalid output configuration)");
    EXPECT_EQ(ctx->slave(2).image.outputs.bits, 8U);
    EXPECT_EQ(ctx->group(0).output_bytes, 7U);
}

// The library must not use the new sizes for the present mapping. In that case entries, and the reading of FMMUs, would
// be lost.
TEST_F(NextSizes, TheSlaveGoesOnAsItIsMapped) {
    const std::uint32_t expected = *cycle();
    SlaveConfiguration& config = ctx->slave(2).config;
    config.sms[0].bits += 8;
    for (int n = 0; n < 200; ++n) EXPECT_EQ(*cycle(), expected);
    segment.set_power(3, false, osal.now());  // without another slave the working counter is too small
    cycles(200);
    EXPECT_TRUE(ctx->slave(2).takes_part);
    segment.set_power(3, true, osal.now());
    cycles(3000);
    EXPECT_EQ(*cycle(), expected);
    expect_outputs_of_slave_3();
    const auto handle = find_entry(*ctx, 2, 0x6000, 1);
    EXPECT_EQ(handle.error().code, Errc::remapping_needed) << words(handle.error());
}

// The hook of a slave moves the slave to another group while the group is mapped again.
TEST_F(NextSizes, AHookThatGivesItsSlaveToAnotherGroup) {
    supervision.cancel();
    ctx->slave(2).hooks.user = ctx.get();
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave, void* user) {
        static_cast<Context*>(user)->slave(2).config.group = 1;
        return Result<>();
    };
    ASSERT_TRUE(config_map(*ctx, image));
    EXPECT_EQ(ctx->slave(2).image.group, SlaveImage::kNoGroup);
    EXPECT_EQ(ctx->group(0).output_bytes, 6U);
    EXPECT_EQ(ctx->group(0).expected_wkc, 9U);
    for (int n = 0; n < 5; ++n) EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(readstate(*ctx)->state, AlState::preop) << "slave 2";
    ctx->slave(2).hooks = {};
    std::array<std::byte, 64> second{};
    ASSERT_TRUE(config_map(*ctx, second, 1));
    EXPECT_EQ(ctx->slave(2).image.group, 1);
}

}  // namespace
}  // namespace margay
