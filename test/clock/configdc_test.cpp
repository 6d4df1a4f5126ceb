// configdc(): the slaves that have a clock, delays, offsets, and clocks in sync.
#include "clock/clock_bus.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;
using sim::DcUnit;

struct Configdc : testing::Test, ClockBus {};

TEST_F(Configdc, BringsALineInSync) {
    add_line(6);
    start();
    const auto reference = configdc(*ctx, kFewFrames);
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    EXPECT_EQ(*reference, 1);
    EXPECT_EQ(reference_clock(*ctx), 1);
    for (std::uint16_t n = 1; n <= 6; ++n) {
        EXPECT_EQ(clock(n).kind, ClockKind::bits64) << n;
        EXPECT_TRUE(clock(n).synchronised && clock(n).in_sync) << n;
        EXPECT_NEAR(static_cast<double>(clock(n).delay_ns), static_cast<double>((n - 1) * kHop_ns), 1) << n;
        EXPECT_EQ(register_of<std::uint32_t>(n, wire::reg::kSystemTimeDelay), clock(n).delay_ns) << n;
    }
    EXPECT_LE(greatest_error_ns(6), 250);
    const auto shown = segment.slave(0).clock().copy(osal.now());
    const auto time = static_cast<std::uint64_t>(osal.now().time_since_epoch().count());
    EXPECT_NEAR(static_cast<double>(shown), static_cast<double>(time), 200'000)
        << "system time is the time of the osal";
}

TEST_F(Configdc, SystemTimeBeginsWhereTheCallerSays) {
    add_line(2);
    start();
    ClockSettings settings = kFewFrames;
    settings.system_time_at_zero = std::chrono::hours(24 * 365 * 20);
    ASSERT_TRUE(configdc(*ctx, settings).ok());
    const auto years = std::chrono::nanoseconds(static_cast<std::int64_t>(segment.slave(1).clock().copy(osal.now())));
    EXPECT_EQ(std::chrono::duration_cast<std::chrono::hours>(years).count(), 24 * 365 * 20);
}

// A clock of 32 bits among others; a slave with receive times only; a slave without clock and receive times whose
// features register announces a clock; and a clock whose features register announces none.
TEST_F(Configdc, AsksTheRegistersNotTheFeatures) {
    add({.unit = DcUnit::receive_times});
    add({.drift_ppb = 40'000, .start_ns = 0x1'8000'0000});
    add({.unit = DcUnit::none, .features = 0x01CC});
    add({.drift_ppb = -60'000, .start_ns = 0xFFFF'0000, .unit = DcUnit::bits32, .features = 0x01CC});
    add({.start_ns = 77, .features = 0x01C0});
    start();
    const auto reference = configdc(*ctx, kFewFrames);
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    EXPECT_EQ(*reference, 2) << "the first that runs";
    EXPECT_EQ(clock(1).kind, ClockKind::receive_times);
    EXPECT_EQ(clock(2).kind, ClockKind::bits64);
    EXPECT_EQ(clock(3).kind, ClockKind::none);
    EXPECT_EQ(clock(4).kind, ClockKind::bits32);
    EXPECT_EQ(clock(5).kind, ClockKind::bits64);
    EXPECT_FALSE(clock(1).synchronised);
    EXPECT_FALSE(clock(3).synchronised);
    // Slave 3 counts as cable, so half of its own asymmetry is unknown.
    EXPECT_NEAR(static_cast<double>(clock(4).delay_ns), 2.0 * kHop_ns, 50);
    EXPECT_LE(std::abs(static_cast<std::int32_t>(static_cast<std::uint32_t>(ahead_ns(4, 2)))), 300);
    EXPECT_LE(std::abs(ahead_ns(5, 2)), 300);
    EXPECT_EQ(ctx->slave(3).dl.dc, false);
    EXPECT_EQ(ctx->slave(5).dl.dc, true);
}

TEST_F(Configdc, ATreeWithBranches) {
    const auto junction = [this](std::int32_t drift) {
        auto made = clocked({.drift_ppb = drift, .start_ns = 0xFFFF'FFFF'0000'0000});
        made.chip.ports = sim::junction().ports;
        return segment.add(std::move(made).assemble());
    };
    const auto root = junction(20'000);
    ASSERT_TRUE(segment.connect_master({root, 0}));
    const auto a = junction(-90'000);
    const auto b = junction(80'000);
    const auto c = junction(1'000);
    const auto d = junction(0);
    ASSERT_TRUE(segment.connect({root, 3}, {a, 0}, 300ns));
    ASSERT_TRUE(segment.connect({root, 1}, {b, 0}, 900ns));
    ASSERT_TRUE(segment.connect({root, 2}, {c, 0}, 100ns));
    ASSERT_TRUE(segment.connect({b, 3}, {d, 0}, 2000ns));
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t n = 1; n <= 5; ++n) EXPECT_EQ(clock(n).kind, ClockKind::bits64) << n;
    EXPECT_LE(greatest_error_ns(5), 300);
}

// A chip whose processing unit has a longer delay than the chips of the data sheets. The delay of all slaves behind it
// is wrong by half of the difference, unless the configuration contains the delay.
TEST_F(Configdc, AChipWithAnotherProcessingDelay) {
    for (unsigned n = 0; n < 3; ++n) {
        auto made = clocked({.start_ns = n * 77});
        if (n == 0) made.chip.processing_delay = made.chip.forwarding_delay + 240ns;
        segment.add(std::move(made).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}, kCable));
    }
    start();
    constexpr std::int64_t kThrough = 260 + 2 * 140 + 500;
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_NEAR(static_cast<double>(clock(2).delay_ns), static_cast<double>(kThrough - 100), 1);
    const SlaveSetup setup{.dc = {.processing_ns = 240}};
    ctx->slave(1).config.setup = &setup;
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_NEAR(static_cast<double>(clock(2).delay_ns), static_cast<double>(kThrough), 1);
    EXPECT_NEAR(static_cast<double>(clock(3).delay_ns), static_cast<double>(kThrough + kHop_ns), 1);
    EXPECT_LE(std::abs(ahead_ns(3)), 100);
}

// Real chips: steps of 10 ns, and a receiver with a jitter of 5 ns. One measurement may be wrong by more than 10 ns.
TEST_F(Configdc, TimesInStepsAndWithJitter) {
    for (unsigned n = 0; n < 8; ++n) {
        auto made = clocked({.drift_ppb = static_cast<std::int32_t>(n * 9'000) - 30'000, .start_ns = n * 1'234'567});
        made.chip.clock.step_ns = 10;
        made.chip.clock.jitter_ns = 5;
        segment.add(std::move(made).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}, kCable));
    }
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t n = 2; n <= 8; ++n)
        EXPECT_NEAR(static_cast<double>(clock(n).delay_ns), static_cast<double>((n - 1) * kHop_ns), 10) << n;
}

TEST_F(Configdc, WithoutAnyClockSaysSo) {
    add({.unit = DcUnit::none});
    add({.unit = DcUnit::receive_times});
    start();
    const auto reference = configdc(*ctx, kFewFrames);
    EXPECT_EQ(reference.error().code, Errc::no_clock);
    EXPECT_EQ(words(reference.error()), "synchronising the clocks: no clock that runs");
    EXPECT_EQ(reference_clock(*ctx), 0);
}

// A junction whose cables are not equally long.
TEST_F(Configdc, DelaysThatAreNotMeasuredAreNamed) {
    add({});
    add({.start_ns = 5});
    auto junction = clocked({.unit = DcUnit::none});
    junction.chip.ports = sim::junction().ports;
    segment.add(std::move(junction).assemble());
    ASSERT_TRUE(segment.connect({1, 1}, {2, 0}, kCable));
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{1}}) {
        const auto n = segment.add(clocked({.start_ns = port}).assemble());
        ASSERT_TRUE(segment.connect({2, port}, {n, 0}, port == 3 ? kCable + 3us : kCable));
    }
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    const auto all = events();
    EXPECT_EQ(told(all,
                   "slave 3: it has branches and no receive times, so the delays of 2 clocks are not measured: they "
                   "are right if all its cables are equally long"),
              1)
        << joined(all);
    EXPECT_EQ(told(all, "receive times"), 1) << joined(all);
    EXPECT_FALSE(clock(1).delay_assumed || clock(2).delay_assumed);
    EXPECT_TRUE(clock(4).delay_assumed && clock(5).delay_assumed);
    EXPECT_GT(std::abs(ahead_ns(4, 2)), 500) << "as the words say";
}

TEST_F(Configdc, DelaysAtAFirstJunctionWithoutReceiveTimesAreNamed) {
    auto junction = clocked({.unit = DcUnit::none});
    junction.chip.ports = sim::junction().ports;
    segment.add(std::move(junction).assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{1}}) {
        const auto n = segment.add(clocked({.start_ns = port}).assemble());
        ASSERT_TRUE(segment.connect({0, port}, {n, 0}, kCable));
    }
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_EQ(told(events(),
                   "slave 1: it has branches and no receive times, so the delays of 1 clock are not measured: they are "
                   "wrong by all that its cables need, because no slave before it has receive times"),
              1);
    EXPECT_FALSE(clock(2).delay_assumed) << "the reference";
    EXPECT_TRUE(clock(3).delay_assumed);
}

// A junction without receive times, behind it a slave without receive times in a line, and a second junction. The text
// names each junction with its own clocks.
TEST_F(Configdc, EachJunctionWithoutReceiveTimesIsNamed) {
    const auto without = [this](bool junction) {
        auto made = clocked({.unit = DcUnit::none});
        if (junction) made.chip.ports = sim::junction().ports;
        return segment.add(std::move(made).assemble());
    };
    add({});
    const auto first = without(true);  // slave 2
    ASSERT_TRUE(segment.connect({0, 1}, {first, 0}, kCable));
    const auto line = without(false);  // slave 3
    ASSERT_TRUE(segment.connect({first, 3}, {line, 0}, kCable));
    const auto behind = segment.add(clocked({.start_ns = 7}).assemble());  // slave 4
    ASSERT_TRUE(segment.connect({line, 1}, {behind, 0}, kCable));
    const auto beside = segment.add(clocked({.start_ns = 9}).assemble());  // slave 5
    ASSERT_TRUE(segment.connect({first, 1}, {beside, 0}, kCable));
    const auto second = without(true);  // slave 6
    ASSERT_TRUE(segment.connect({beside, 1}, {second, 0}, kCable));
    for (const std::uint8_t port : {std::uint8_t{3}, std::uint8_t{1}, std::uint8_t{2}}) {
        const auto n = segment.add(clocked({.start_ns = port}).assemble());  // slaves 7 to 9
        ASSERT_TRUE(segment.connect({second, port}, {n, 0}, kCable));
    }
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    const auto all = events();
    EXPECT_EQ(told(all, "slave 2: it has branches and no receive times, so the delays of 2 clocks"), 1) << joined(all);
    EXPECT_EQ(told(all, "slave 6: it has branches and no receive times, so the delays of 3 clocks"), 1) << joined(all);
    EXPECT_EQ(told(all, "receive times"), 2) << joined(all);
    for (const int n : {4, 5, 7, 8, 9}) EXPECT_TRUE(clock(static_cast<std::uint16_t>(n)).delay_assumed) << n;
}

// In a line the cables at both sides may differ: the frame passes each of them there and back.
TEST_F(Configdc, ASlaveWithoutReceiveTimesInALine) {
    add({});
    add({.start_ns = 5});
    const auto without = segment.add(clocked({.unit = DcUnit::none}).assemble());
    ASSERT_TRUE(segment.connect({1, 1}, {without, 0}, kCable));
    const auto behind = segment.add(clocked({.start_ns = 7}).assemble());
    ASSERT_TRUE(segment.connect({without, 1}, {behind, 0}, kCable + 3us));
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_EQ(told(events(), "receive times"), 0);
    EXPECT_FALSE(clock(4).delay_assumed);
    EXPECT_LE(std::abs(ahead_ns(4, 2)), 50) << "the delay of its processing unit is not known";
}

TEST_F(Configdc, BehindAFirstSlaveWithoutReceiveTimesDelaysAreMeasured) {
    add({.unit = DcUnit::none});
    add({});
    add({.start_ns = 5});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    EXPECT_FALSE(clock(2).delay_assumed || clock(3).delay_assumed);
}

TEST_F(Configdc, WithOneClockIsInSync) {
    add({.unit = DcUnit::none});
    add({.drift_ppb = 100'000});
    start();
    const auto reference = configdc(*ctx, kFewFrames);
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    EXPECT_EQ(*reference, 2);
}

TEST_F(Configdc, AClockBeforeTheReferenceOfAGroupIsRefused) {
    add({.unit = DcUnit::none});
    add_line(0);
    add({});
    add({});
    start();
    EXPECT_EQ(configdc(*ctx, {.reference = 1, .burst_frames = 100}).error().code, Errc::no_clock);
    EXPECT_TRUE(configdc(*ctx, {.reference = 2, .burst_frames = 100}).ok());
    ctx->group(0).config.dc_reference = 3;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::clock_before_reference);
    EXPECT_EQ(mapped.error().slave, 3);
    EXPECT_EQ(mapped.error().expected, 2U);
    EXPECT_EQ(words(mapped.error()),
              "slave 3: mapping process data: a slave before the reference clock in the ring has a clock, which the "
              "reference cannot synchronise (slave 2)");
}

// The error is that the slave is missing, and not that it has no clock.
TEST_F(Configdc, AReferenceThatIsMissingIsSaid) {
    add({});
    add({});
    add({});
    start();
    power(2, false);
    (void)readstate(*ctx);
    EXPECT_EQ(words(configdc(*ctx, {.reference = 3, .burst_frames = 100}).error()),
              "slave 3: synchronising the clocks: the slave is missing");
}

// A line of three slaves. From step `cut` of the request on there is a fault for 20 us: set(false), set(true).
template <class Set>
void run_with_fault(ClockBus& bus, ClockRequest& request, int cut, const Set& set) {
    bus.add_line(3);
    bus.start();
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    for (int n = 0; request.busy() && n < 1'000'000; ++n) {
        if (n == cut || n == cut + 1) set(n != cut);
        bus.osal.advance(20us);
        (void)poll(*bus.ctx, bus.osal.now());
    }
}

// The chosen reference loses its power for a moment while the library reads its registers. The error says that the
// slave is lost, and not that it has no clock.
TEST(ConfigdcWithoutPower, ALostSlaveIsNotCalledOneWithoutAClock) {
    int failed = 0;
    for (int cut = 0; cut < 40; ++cut) {
        ClockBus bus;
        ClockRequest request;
        request.settings = kFewFrames;
        request.settings.reference = 2;
        run_with_fault(bus, request, cut, [&](bool right) { bus.segment.set_power(1, right, bus.osal.now()); });
        if (request.state() == RequestState::success) continue;
        ++failed;
        EXPECT_NE(request.error().code, Errc::no_clock) << cut << ": " << bus.words(request.error());
    }
    EXPECT_GT(failed, 10);
}

// The cable to slaves 2 and 3 is broken for 20 us, which is much shorter than a step of the start-up. One frame is
// lost.
TEST(ConfigdcWithoutCable, ABreakForOneFrameHidesNoClock) {
    for (int cut = 0; cut < 40; ++cut) {
        ClockBus bus;
        ClockRequest request;
        request.settings = kFewFrames;
        run_with_fault(bus, request, cut, [&](bool right) { bus.segment.set_cable({1, 0}, right); });
        if (request.state() != RequestState::success) continue;
        for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_EQ(bus.clock(n).kind, ClockKind::bits64) << n << ", cut " << cut;
    }
}

// No cycle would carry the time.
TEST_F(Configdc, AGroupThatDoesNotExistIsRefused) {
    add({});
    start();
    const auto refused = configdc(*ctx, {.group = 77, .burst_frames = 100});
    EXPECT_EQ(refused.error().code, Errc::invalid_argument);
    EXPECT_EQ(words(refused.error()),
              "synchronising the clocks: argument out of range: ClockSettings: measurements and burst_bulk at least 1, "
              "times from 0 to 100 years, cycle above zero, group below Limits::groups");
    // An earlier version named another cause: that ClockSettings::start_time had returned a time that has passed.
    EXPECT_EQ(configdc(*ctx, {.start_delay = Duration::max()}).error().code, Errc::invalid_argument);
    EXPECT_EQ(configdc(*ctx, {.cycle = Duration::max()}).error().code, Errc::invalid_argument);
    EXPECT_TRUE(configdc(*ctx, {.burst_frames = 100, .system_time_at_zero = Duration::max()}).ok());
}

// Slaves in OP would continue without the SYNC signals that they need, and no error would report this.
TEST_F(Configdc, WhileASlaveRunsWithSyncIsRefused) {
    add_line(3);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    const SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application}};
    ctx->slave(2).config.setup = &every_ms;
    run();
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    EXPECT_EQ(words(configdc(*ctx, kFewFrames).error()),
              "slave 2: synchronising the clocks: not possible in this state (it is in OP and needs its SYNC signals: "
              "bring it to PREOP before)");
    cycles(10);
    EXPECT_TRUE(clock(2).sync_active);
    EXPECT_TRUE(all_right(*ctx));
    ASSERT_TRUE(set_target(*ctx, 0, AlState::preop).ok());
    ASSERT_TRUE(until([&] { return ctx->slave(2).al.state == AlState::preop; }));
    EXPECT_TRUE(configdc(*ctx, kFewFrames).ok());
}

// The facts contain the present differences, also while all clocks are within the limit.
TEST_F(Configdc, TheSupervisionReadsTheDifferencesOfClocksInSync) {
    add({});
    add({.drift_ppb = 90'000});
    add({.drift_ppb = -70'000});
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    cycles(3000);
    for (std::uint16_t n = 2; n <= 3; ++n) {
        EXPECT_LE(std::abs(clock(n).difference_ns), 10) << n << ": it has settled since configdc()";
        EXPECT_LE(register_of<std::uint32_t>(n, wire::reg::kSystemTimeDifference) & 0x7FFF'FFFF, 10U) << n;
    }
}

// A clock with 2000 ppm, more than a chip can follow. The slave is reported with its difference, and the other clocks
// are in sync.
TEST_F(Configdc, AClockThatCannotFollowIsNamed) {
    add({});
    add({.drift_ppb = 2'000'000});
    add({.drift_ppb = 50'000});
    start();
    ClockSettings settings = kFewFrames;
    settings.timeout = 500ms;
    const auto reference = configdc(*ctx, settings);
    EXPECT_EQ(reference.error().code, Errc::not_in_sync);
    EXPECT_EQ(reference.error().slave, 2);
    EXPECT_NE(words(reference.error()).find("ns ahead, the limit is 200 ns"), std::string::npos)
        << words(reference.error());
    EXPECT_LE(std::abs(ahead_ns(3)), 300);
    EXPECT_EQ(reference_clock(*ctx), 1);
}

TEST_F(Configdc, SettingsOutOfRangeAreRefused) {
    add_line(1);
    start();
    EXPECT_EQ(configdc(*ctx, {.measurements = 0}).error().code, Errc::invalid_argument);
    EXPECT_EQ(configdc(*ctx, {.burst_bulk = 0}).error().code, Errc::invalid_argument);
    EXPECT_EQ(configdc(*ctx, {.cycle = 0ms}).error().code, Errc::invalid_argument);
    EXPECT_EQ(configdc(*ctx, {.start_delay = -1ms}).error().code, Errc::invalid_argument);
    EXPECT_EQ(configdc(*ctx, {.reference = 9}).error().code, Errc::unknown_slave);
    HostContext empty({.slaves = 1});
    EXPECT_EQ(configdc(empty).error().code, Errc::wrong_state);
}

TEST_F(Configdc, EndsWhenFramesAreLost) {
    add_line(3);
    start();
    segment.set_noise({.lost = 0.01, .seed = 3});
    const auto reference = configdc(*ctx, kFewFrames);
    EXPECT_TRUE(reference.ok()) << words(reference.error());
    segment.set_power(1, false, osal.now());
    EXPECT_FALSE(configdc(*ctx, kFewFrames).ok());
}

}  // namespace
}  // namespace margay
