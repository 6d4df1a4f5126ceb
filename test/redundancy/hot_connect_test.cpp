// Hot connect groups that appear in the part of a broken ring that is connected to the second NIC.
#include "redundancy/ring_bus.hpp"

namespace margay {
namespace {

SlaveConfiguration hot_io() {
    SlaveConfiguration config;
    config.source = ConfigurationSource::application;
    config.add({0, Direction::outputs, 0x64, 0x1100, 16});
    config.add({1, Direction::inputs, 0x20, 0x2000, 16});
    return config;
}

// Six slaves in the ring, and a group of two slaves whose cable is not plugged in. The first slave of the group has the
// alias 0x0010.
struct HotConnectInRing : testing::Test, RingBus {
    SlaveConfiguration config = hot_io();
    std::vector<ExpectedSlave> expected;
    std::uint32_t first = 0;
    std::uint32_t member = 0;
    std::vector<std::uint32_t> ring;

    static sim::Device device(std::uint32_t product, std::uint16_t alias = 0) {
        auto made = sim::device_from_sii(io_image(16, 16, {.product = product, .alias = alias}));
        made.chip = sim::junction();
        return made;
    }
    void SetUp() override {
        for (std::uint16_t n = 0; n < 6; ++n) {
            ring.push_back(add_to_ring(device(0x100)));
            expected.push_back({.number = static_cast<std::uint16_t>(n + 1), .product = 0x100, .config = &config});
        }
        close_ring();
        first = add(device(0x200, 0x0010));
        member = add(device(0x201));
        ASSERT_TRUE(segment.connect({first, 1}, {member, 0}));
        expected.push_back({.alias = std::uint16_t{0x0010}, .product = 0x200, .hot_connect = 1, .config = &config});
        expected.push_back({.product = 0x201, .hot_connect = 1, .config = &config});
    }
    void bring_up() {
        ASSERT_TRUE(begin().ok());
        ASSERT_TRUE(expect(*ctx, expected).ok());
        const auto found = config_init(*ctx);
        ASSERT_TRUE(found.ok()) << words(found.error());
        const auto mapped = config_map(*ctx, image);
        ASSERT_TRUE(mapped.ok()) << words(mapped.error());
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(until([&] { return ctx->slave(6).al.state == AlState::op; })) << joined(events());
        (void)events();
    }
    template <class Done>
    bool until(Done done, unsigned most = 4000) {
        for (unsigned n = 0; n < most; ++n) {
            (void)cycle();
            if (done()) return true;
        }
        return false;
    }
    bool group_in_op() {
        return ctx->slave(7).al == AlStatus{AlState::op, false, 0} &&
               ctx->slave(8).al == AlStatus{AlState::op, false, 0};
    }
    void plug_group(std::uint32_t at, std::uint8_t port) {
        ASSERT_TRUE(segment.connect({at, port}, {first, 0}));
        segment.advance(osal.now());
    }
    void pull_group() { segment.disconnect({first, 0}); }
    void expect_exchanged() {
        EXPECT_EQ(stale_cycles(20), 0U);
        EXPECT_EQ(wkc.ok() ? *wkc : 0U, 8 * 3U) << joined(events());
    }
};

// The group is connected at a port before the way to the next slave (3), and at a port behind it (2), at each slave of
// the part that begins with slave 3.
TEST_F(HotConnectInRing, AppearsBehindABreak) {
    bring_up();
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{2}})
        for (std::size_t slave = 1; slave <= 6; ++slave) {
            SCOPED_TRACE("at slave " + std::to_string(slave) + " port " + std::to_string(port));
            cable(ring_cables[2], false);
            (void)stale_cycles(20);
            plug_group(ring[slave - 1], port);
            ASSERT_TRUE(until([&] { return group_in_op(); })) << joined(events());
            (void)stale_cycles(20);
            expect_exchanged();
            const RingEnd end = slave >= 3 ? RingEnd::second_nic : RingEnd::first_nic;
            EXPECT_EQ(ctx->slave(7).ring, end);
            EXPECT_EQ(ctx->slave(8).ring, end);
            EXPECT_EQ(ctx->slave(7).parent, slave);
            EXPECT_EQ(ctx->slave(7).parent_port, port);
            EXPECT_EQ(ctx->slave(8).parent, 7);
            cable(ring_cables[2], true);
            (void)stale_cycles(50);
            expect_exchanged();
            EXPECT_EQ(status().ring, RingState::whole);
            EXPECT_EQ(ctx->slave(7).parent, slave) << "whole again";
            pull_group();
            ASSERT_TRUE(until([&] { return ctx->slave(7).al.state == AlState::none; }));
            (void)stale_cycles(700);
            for (const std::size_t n : {1U, 2U, 3U, 4U, 5U, 6U}) EXPECT_EQ(ctx->slave(n).al.state, AlState::op) << n;
        }
}

}  // namespace
}  // namespace margay
