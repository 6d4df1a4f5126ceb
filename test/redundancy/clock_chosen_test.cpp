// A chosen reference clock with clocks before it, in a ring with two NICs.
#include "redundancy/clock_ring.hpp"

namespace margay {
namespace {

// A ring of six slaves. The reference is slave 3, with slaves 4 and 5 at its branch if there is a branch.
struct ChosenInRing : testing::Test, ClockRingBus {
    void bring_up_chosen(std::uint16_t reference) {
        start();
        at = segment.order();
        const auto found = configdc(*ctx, {.reference = reference, .burst_frames = 2000});
        ASSERT_TRUE(found.ok()) << words(found.error());
        ASSERT_EQ(*found, reference);
        told_ = joined(events());
        for (std::uint16_t n = reference; n <= segment.size(); ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        (void)cycles(1000);
        ASSERT_EQ(status().ring, RingState::whole);
    }
    // The greatest difference of the clocks that the reference synchronises.
    std::int64_t apart_from(std::uint16_t reference) {
        std::int64_t most = 0;
        for (std::uint16_t n = reference; n <= segment.size(); ++n)
            if (segment.powered(at[n - 1U])) most = std::max(most, std::abs(ahead_ns(n, reference)));
        return most;
    }
    std::int64_t cycles_from(std::uint16_t reference, unsigned count) {
        std::int64_t most = 0;
        for (unsigned n = 0; n < count; ++n) {
            (void)cycle();
            most = std::max(most, apart_from(reference));
            // The clocks before the reference follow the time that the master expects, and never get zeros.
            for (std::uint16_t s = 1; s < reference; ++s) before_ = std::max(before_, std::abs(ahead_ns(s, reference)));
        }
        return most;
    }
    void expect_running(std::uint16_t reference) {
        EXPECT_EQ(reference_clock(*ctx), reference);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
        for (std::uint16_t n = 1; n <= segment.size(); ++n) {
            EXPECT_EQ(slave_clock(*ctx, n).synchronised, n >= reference) << n;
            EXPECT_EQ(slave_clock(*ctx, n).in_sync, n >= reference) << n;
            EXPECT_EQ(slave_clock(*ctx, n).sync_active, n >= reference) << n;
        }
    }
    std::int64_t before_ = 0;
    std::string told_;  // by configdc()
};

TEST_F(ChosenInRing, TheClocksBeforeItAreNamedAndTheRestRuns) {
    build(6);
    bring_up_chosen(3);
    for (const int n : {1, 2})
        EXPECT_NE(told_.find("slave " + std::to_string(n) +
                             ": its clock is not synchronised, because it is before the reference clock of slave 3"),
                  std::string::npos)
            << told_;
    EXPECT_LE(cycles_from(3, 2000), 100);
    EXPECT_LE(before_, 500'000);
    expect_running(3);
}

// Each cable breaks and heals: before the reference and behind it.
TEST_F(ChosenInRing, BehindABreakTheClocksKeepInStep) {
    build(6);
    bring_up_chosen(3);
    (void)events();
    for (std::size_t n = 0; n < ring_cables.size(); ++n) {
        const std::uint64_t first = pulses(3);
        const std::uint64_t last = pulses(8);
        const Time begin = osal.now();
        cable(ring_cables[n], false);
        EXPECT_LE(cycles_from(3, 2000), 1000) << "broken at cable " << n;
        EXPECT_EQ(status().ring, RingState::broken);
        cable(ring_cables[n], true);
        EXPECT_LE(cycles_from(3, 300), 1000) << "no step when cable " << n << " heals";
        EXPECT_LE(cycles_from(3, 1000), 100) << "whole again after cable " << n;
        const auto passed = static_cast<double>((osal.now() - begin) / 1ms);
        EXPECT_NEAR(static_cast<double>(pulses(3) - first), passed, 2) << "no SYNC0 is missed or doubled";
        EXPECT_NEAR(static_cast<double>(pulses(8) - last), passed, 2);
        expect_running(3);
    }
    EXPECT_LE(before_, 500'000);
    const auto all = events();
    EXPECT_EQ(std::ranges::count_if(all, [](const std::string& e) { return e.find("out of sync") != e.npos; }), 0)
        << joined(all);
}

// A slave before the reference, the reference itself, and the last slave lose their power.
TEST_F(ChosenInRing, SlavesThatComeBack) {
    build(6, false);
    bring_up_chosen(3);
    for (const unsigned lost : {1U, 2U, 5U, 0U}) {
        segment.set_power(at[lost], false, osal.now());
        (void)cycles(1000);
        segment.set_power(at[lost], true, osal.now());
        ASSERT_TRUE(until_all_in_op(6000)) << lost << joined(events());
        (void)cycles(4000);
        EXPECT_LE(cycles_from(3, 300), 100) << lost << joined(events());
        expect_running(3);
    }
}

// configdc() in a ring that is open before, at or behind the reference.
TEST_F(ChosenInRing, InABrokenRing) {
    for (const std::size_t broken : {1U, 2U, 3U, 4U}) {
        SCOPED_TRACE(broken);
        ClockRingBus bus;
        bus.build(6, false);
        bus.start();
        bus.at = bus.segment.order();
        bus.cable(bus.ring_cables[broken], false);
        for (unsigned n = 0; n < 5; ++n) (void)bus.cycle();
        (void)readstate(*bus.ctx);
        const auto found = configdc(*bus.ctx, {.reference = 3, .burst_frames = 2000});
        ASSERT_TRUE(found.ok()) << bus.words(found.error());
        for (std::uint16_t n = 3; n <= 6; ++n) bus.ctx->slave(n).config.setup = &bus.every_ms;
        bus.run();
        (void)bus.cycles(3000);
        for (std::uint16_t n = 3; n <= 6; ++n) {
            EXPECT_TRUE(slave_clock(*bus.ctx, n).in_sync) << n;
            EXPECT_LE(std::abs(bus.ahead_ns(n, 3)), 1000) << n;
        }
        for (const std::uint16_t n : {std::uint16_t{1}, std::uint16_t{2}})
            EXPECT_FALSE(slave_clock(*bus.ctx, n).synchronised) << n;
    }
}

}  // namespace
}  // namespace margay
