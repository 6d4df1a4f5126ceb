// A chosen reference clock with clocks before it in the ring. The clocks before it are not synchronised, and are
// reported. All other functions work.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;
using sim::DcUnit;

// Five clocks in a line. The reference is the clock of slave 3.
struct ChosenReference : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    ClockSettings settings = kFewFrames;

    void bring_up() {
        add_line(5);
        start();
        settings.reference = 3;
        const auto reference = configdc(*ctx, settings);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ASSERT_EQ(*reference, 3);
        for (std::uint16_t n = 3; n <= 5; ++n) ctx->slave(n).config.setup = &every_ms;
    }
    std::uint64_t pulses(std::uint16_t slave) {
        segment.advance(osal.now());
        return segment.slave(slave - 1U).sync().pulses(0);
    }
    // The last difference that the control loop of a clock used: its magnitude without the filter of the chip.
    std::uint32_t difference_register_ns(std::uint16_t slave) {
        return register_of<std::uint32_t>(slave, wire::reg::kSystemTimeDifference) & 0x7FFF'FFFF;
    }
    void expect_running() {
        EXPECT_EQ(reference_clock(*ctx), 3);
        EXPECT_LE(std::abs(ahead_ns(4, 3)), 100);
        EXPECT_LE(std::abs(ahead_ns(5, 3)), 100);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
        EXPECT_LE(clock_status(*ctx, osal.now()).greatest_ns, 200U);
        for (std::uint16_t n = 1; n <= 5; ++n) {
            EXPECT_EQ(clock(n).kind, ClockKind::bits64) << n;
            EXPECT_EQ(clock(n).synchronised, n >= 3) << n;
            EXPECT_EQ(clock(n).in_sync, n >= 3) << n;
            EXPECT_EQ(clock(n).sync_active, n >= 3) << n;
        }
    }
};

TEST_F(ChosenReference, TheClocksBeforeItAreNamedAndTheRestRuns) {
    bring_up();
    auto all = events();
    EXPECT_EQ(told(all,
                   "slave 1: its clock is not synchronised, because it is before the reference clock of slave 3 in "
                   "the ring"),
              1)
        << joined(all);
    EXPECT_EQ(told(all, "slave 2: its clock is not synchronised"), 1) << joined(all);
    EXPECT_EQ(told(all, "is not synchronised"), 2) << joined(all);
    run();
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    EXPECT_EQ(told(events(), "is not synchronised"), 0) << "said once";
    cycles(2000);
    expect_running();
    EXPECT_TRUE(all_right(*ctx));
    const std::uint64_t before = pulses(5);
    const Time begin = osal.now();
    cycles(500);
    EXPECT_NEAR(static_cast<double>(pulses(5) - before), static_cast<double>((osal.now() - begin) / 1ms), 1);
    all = events();
    EXPECT_EQ(told(all, "reference clock now"), 0) << joined(all);
    EXPECT_EQ(told(all, "clock out of sync"), 0) << joined(all);
}

// The datagram passes the clocks before the reference with the time that the master expects, from the first cycle on.
TEST_F(ChosenReference, TheClocksBeforeItTakeOverNoZeros) {
    bring_up();
    ASSERT_TRUE(config_map(*ctx, image).ok());
    for (int n = 0; n < 200; ++n) {
        cycles(1);
        EXPECT_LE(difference_register_ns(1), 500'000U) << n;
        EXPECT_LE(difference_register_ns(2), 500'000U) << n;
    }
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 5) << "FRMW: all clocks take the time";
    for (std::uint16_t n = 1; n <= 2; ++n) EXPECT_LE(std::abs(ahead_ns(n, 3)), 500'000) << n;
}

TEST_F(ChosenReference, SyncOfAClockBeforeItIsRefused) {
    bring_up();
    const std::string why =
        "slave 2: activating SYNC: the reference clock does not synchronise the clock (behind it in the ring: slave "
        "3)";
    EXPECT_EQ(words(dcsync0(*ctx, 2, true, 1ms).error()), why);
    ctx->slave(2).config.setup = &every_ms;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::clock_not_reached);
    EXPECT_EQ(words(mapped.error()), why);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop) << "wants no SYNC signals";
    EXPECT_EQ(ctx->slave(4).al.state, AlState::safeop);
    EXPECT_TRUE(clock(4).sync_active);
    EXPECT_FALSE(clock(2).sync_active);
    EXPECT_TRUE(dcsync0(*ctx, 2, false, 0ms).ok());
}

// A clock that was away, or that is seen for the first time, does not replace the chosen reference.
TEST_F(ChosenReference, AClockBeforeItThatComesBackStaysUnsynchronised) {
    bring_up();
    run();
    cycles(500);
    (void)events();
    for (const unsigned lost : {1U, 0U}) {
        power(lost, false);
        cycles(100);
        power(lost, true);
        ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
        cycles(2000);
        expect_running();
    }
    const auto all = events();
    EXPECT_EQ(told(all, "reference clock now"), 0) << joined(all);
}

// The chosen reference itself comes back. It is the reference again, with its SYNC signals.
TEST_F(ChosenReference, ItComesBackItself) {
    bring_up();
    run();
    cycles(500);
    (void)events();
    power(2, false);
    cycles(300);
    power(2, true);
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    cycles(2500);
    expect_running();
}

// At a fork the next clock becomes the reference, but never a clock before the chosen reference.
TEST_F(ChosenReference, TheNextOneTakesOverWhenItIsLost) {
    auto root = clocked({.drift_ppb = 70'000});
    root.chip.ports = sim::junction().ports;
    segment.add(std::move(root).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{1}, std::uint8_t{2}}) {
        const auto n = segment.add(clocked({.drift_ppb = 20'000 * port, .start_ns = port * 1000U}).assemble());
        ASSERT_TRUE(segment.connect({0, port}, {n, 0}, kCable));
    }
    start();
    settings.reference = 3;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    run();
    cycles(500);
    (void)events();
    power(2, false);
    cycles(500);
    EXPECT_EQ(reference_clock(*ctx), 4) << joined(events());
    EXPECT_FALSE(clock(1).synchronised || clock(2).synchronised);
    power(2, true);
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    cycles(2500);
    EXPECT_EQ(reference_clock(*ctx), 3) << joined(events());
    EXPECT_LE(std::abs(ahead_ns(4, 3)), 100);
    EXPECT_FALSE(clock(1).synchronised || clock(2).synchronised);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// Overlapping cycles, which another thread may send. Each frame carries the expected time, calculated from the last
// reply.
struct OverlappingReference : ChosenReference {
    // `count` cycles of 1 ms, two of them on the wire.
    void overlapped(int count) {
        for (int n = 0; n < count; ++n) {
            osal.advance(1ms);
            (void)send_processdata(*ctx);
            if (n > 0) (void)receive_processdata(*ctx, 300us);
            (void)poll(*ctx, osal.now());
            worst_ns_ = std::max(worst_ns_, std::max(difference_register_ns(1), difference_register_ns(2)));
        }
        (void)receive_processdata(*ctx, 300us);
    }
    void start_overlapped() {
        limits.process_frames = 8;
        bring_up();
        ctx->group(0).config.cycles_in_flight = 2;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        overlapped(2000);
    }
    std::uint32_t worst_ns_ = 0;  // greatest difference at the clocks before the reference
};

TEST_F(OverlappingReference, TheClocksBeforeItTakeOverNoZeros) {
    start_overlapped();
    ASSERT_TRUE(all_in_op()) << joined(events());
    overlapped(2000);
    expect_running();
    EXPECT_LE(worst_ns_, 500'000U);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 5) << "FRMW: all clocks take the time";
    for (std::uint16_t n = 1; n <= 2; ++n) EXPECT_LE(std::abs(ahead_ns(n, 3)), 500'000) << n;
    EXPECT_EQ(told(events(), "clock out of sync"), 0);
}

// No slave answers as the reference. The other clocks get the time that the master expects. This time is not a reading
// of the reference.
TEST_F(OverlappingReference, ALostReferenceLeavesNoZeros) {
    settings.replace_lost_reference = false;
    start_overlapped();
    (void)events();
    const std::int64_t before = ahead_ns(2, 1);
    // The reference and the slaves behind it are not reached by the frames.
    segment.set_cable({2, 0}, false);
    overlapped(500);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 0) << "the time that was sent is no reading";
    EXPECT_LE(worst_ns_, 500'000U);
    EXPECT_LE(std::abs(ahead_ns(2, 1) - before), 100'000);
    segment.set_cable({2, 0}, true);
    for (int n = 0; n < 10 && !all_in_op(); ++n) overlapped(500);
    overlapped(2500);
    expect_running();
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 5);
}

// No other clock becomes the reference. The master does not continue the time that it has sent: the other clocks
// continue at their rates. The reference has lost its time, so its time reaches no clock until the reference has the
// system time again.
TEST_F(OverlappingReference, WithoutItTheOtherClocksKeepTheirRates) {
    auto root = clocked({});
    root.chip.ports = sim::junction().ports;
    segment.add(std::move(root).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{1}, std::uint8_t{2}}) {
        const auto n = segment.add(clocked({.drift_ppb = 20'000 * (port - 1), .start_ns = port * 1000U}).assemble());
        ASSERT_TRUE(segment.connect({0, port}, {n, 0}, kCable));
    }
    limits.process_frames = 8;
    start();
    settings.reference = 3;
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    ctx->group(0).config.cycles_in_flight = 2;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    overlapped(4000);
    ASSERT_TRUE(all_in_op()) << joined(events());
    (void)events();
    const auto of_master_ns = [this] {
        segment.advance(osal.now());
        return static_cast<std::int64_t>(segment.slave(3).clock().copy(osal.now())) - (osal.now() - Time{}).count();
    };
    const std::int64_t before = of_master_ns();
    power(2, false);
    overlapped(2000);
    EXPECT_LE(std::abs(of_master_ns() - before), 30'000) << "64 ns in each second cycle are 64 000";
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 0);
    const auto lost = events();
    EXPECT_EQ(reference_clock(*ctx), 3) << joined(lost);
    EXPECT_EQ(told(lost, "slave 3 with the reference clock is lost"), 1) << joined(lost);
    power(2, true);
    for (int n = 0; n < 3000; ++n) {
        overlapped(1);
        ASSERT_LE(std::abs(of_master_ns() - before), 60'000) << "a step after " << n << " ms";
    }
    EXPECT_TRUE(all_in_op()) << joined(events());
    EXPECT_EQ(reference_clock(*ctx), 3);
    EXPECT_LE(std::abs(ahead_ns(4, 3)), 100);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 4);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
}

// A group whose dc_reference is not the clock that configdc() has chosen is still refused.
TEST_F(OverlappingReference, AnotherOneIsRefused) {
    limits.process_frames = 8;
    bring_up();
    ctx->group(0).config.cycles_in_flight = 2;
    ctx->group(0).config.dc_reference = 4;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::clock_before_reference) << "not the one of configdc()";
    EXPECT_EQ(mapped.error().slave, 4);
    EXPECT_EQ(mapped.error().expected, 1U);
    ctx->group(0).config.dc_reference = 3;
    EXPECT_TRUE(config_map(*ctx, image).ok());
}

}  // namespace
}  // namespace margay
