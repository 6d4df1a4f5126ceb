// Two segments and one clock: a bridge device between them. The master of one segment follows the other segment.
#include "clock/clock_bus.hpp"
#include "sim/clock_bridge.hpp"
#include "sim/library/library.hpp"

#include <margay/external_clock.hpp>

#include <cmath>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A segment with its own master, in the time of another object: two slaves with clocks and the bridge, which has the
// position `place` in the line.
struct HalfOfTwo {
    Osal& osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> nic;
    static constexpr Limits kLimits{.slaves = 8};
    HostContext ctx{kLimits};
    std::vector<std::byte> image = std::vector<std::byte>(512);
    SlaveSetup every_ms{
        .dc = {.source = SyncSettings::Source::application, .sync0_cycle = std::chrono::milliseconds(1)}};
    SuperviseRequest supervision;
    Time due{};
    Duration period = 1ms;
    std::uint32_t bridge = 0;
    int in_flight = 1;  // cycles
    int sent = 0;

    explicit HalfOfTwo(Osal& system) : osal(system) {}

    void build(ClockBus& bus, std::uint32_t place, std::int32_t drift, std::uint64_t start_ns) {
        bridge = place;
        for (std::uint32_t n = 0; n < 3; ++n) {
            auto made = n == place ? sim::make_device("dc_bridge") : std::optional(bus.clocked({}));
            ASSERT_TRUE(made);
            made->chip.clock = {n == 0 ? drift : -drift, start_ns + n * 77};
            segment.add(std::move(*made).assemble());
        }
        ASSERT_TRUE(segment.connect_master({0, 0}));
        ASSERT_TRUE(segment.connect({0, 1}, {1, 0}, 200ns));
        ASSERT_TRUE(segment.connect({1, 1}, {2, 0}, 200ns));
        segment.power_up(osal.now());
    }
    void start(std::span<EntryHandle* const> entries = {}) {
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ASSERT_TRUE(init(ctx, *nic, osal).ok());
        ASSERT_TRUE(config_init(ctx).ok());
        ASSERT_TRUE(configdc(ctx, kFewFrames).ok());
        for (std::uint16_t n = 1; n <= 3; ++n)
            if (n != bridge + 1) ctx.slave(n).config.setup = &every_ms;
        ctx.group(0).config.entries = entries;
        ctx.group(0).config.cycles_in_flight = static_cast<std::uint8_t>(in_flight);
        const auto mapped = config_map(ctx, image);
        ASSERT_TRUE(mapped.ok()) << ClockBus::words(mapped.error());
        ASSERT_TRUE(submit(ctx, supervision).ok());
    }
    void cycle(CycleClock* clock) {
        const Duration late = osal.now() - due;  // the other master has been waiting
        ASSERT_TRUE(send_processdata(ctx).ok());
        const bool received = ++sent >= in_flight;
        if (received) (void)receive_processdata(ctx, 400us);
        due += period;
        if (received && clock != nullptr) due -= clock->follow(ctx, late);
        (void)poll(ctx, osal.now());
    }
    std::uint64_t system(Time at, std::uint32_t slave) { return segment.slave(slave).clock().copy(at); }
};

struct TwoSegments : testing::Test {
    ClockBus bus;  // provides the time and makes the devices
    HalfOfTwo first{bus.osal};
    HalfOfTwo second{bus.osal};
    std::unique_ptr<sim::ClockBridge> bridge;
    std::unique_ptr<MasterClock> of_first;
    std::unique_ptr<ExternalClock> of_second;
    double most = 0;
    double squares = 0;
    int counted = 0;

    // The bridge is the second slave of the first segment.
    void bring_up(Duration offset = Duration{0}, std::uint32_t place = 0, Duration period = 1ms) {
        first.period = second.period = period;
        first.build(bus, 1, 60'000, 1000);
        second.build(bus, place, -40'000, 0x55'5555'5555);
        bridge = std::make_unique<sim::ClockBridge>(first.segment, 1, second.segment, place);
        ASSERT_TRUE(bridge->valid());
        first.start();
        of_first = std::make_unique<MasterClock>(MasterClockSettings{.set_value = -300us, .phase = {.cycle = period}});
        of_second = std::make_unique<ExternalClock>(
            static_cast<std::uint16_t>(place + 1),
            ExternalClockSettings{.cycle = {.set_value = -300us, .phase = {.cycle = period}}, .offset = offset});
        const auto entries = of_second->entries();
        second.start(entries);
        EXPECT_EQ(of_second->state(), PhaseState::idle);
        first.due = bus.osal.now() + 5ms;
        second.due = bus.osal.now() + 5ms + 410us;
    }
    // The difference of the clock of the second segment to the clock of the first segment, within a millisecond.
    double difference(std::uint32_t slave = 0) {
        const Time now = bus.osal.now();
        const std::uint64_t ahead = second.system(now, slave) % 1'000'000 + 1'000'000;
        return static_cast<double>(phase_error_ns(ahead - first.system(now, slave) % 1'000'000, 1'000'000, 0));
    }
    void run(int cycles, double wanted = 0) {
        for (int n = 0; n < 2 * cycles; ++n) {
            const bool one = first.due <= second.due;
            bus.osal.wait(one ? first.due : second.due, -1);
            one ? first.cycle(of_first.get()) : second.cycle(of_second.get());
            if (one) continue;
            const double error = difference() - wanted;
            most = std::max(most, std::abs(error));
            squares += error * error;
            ++counted;
        }
    }
    void forget() { most = squares = counted = 0; }
    bool all_in_op(HalfOfTwo& half) {
        return std::ranges::all_of(half.ctx.slaves(), [](const Slave& slave) {
            return slave.al == AlStatus{AlState::op, false, 0};
        });
    }
};

TEST_F(TwoSegments, HaveOneClock) {
    bring_up();
    run(5000);
    EXPECT_TRUE(all_in_op(first) && all_in_op(second));
    EXPECT_EQ(of_second->state(), PhaseState::in_sync) << to_text(of_second->state());
    forget();
    run(5000);
    EXPECT_LE(most, 500) << "100 ppm between both, 100 ns in a cycle";
    EXPECT_TRUE(of_second->connected());
    EXPECT_EQ(of_second->cycle().state(), PhaseState::in_sync) << "the cycle follows its own reference clock";
    EXPECT_NEAR(of_second->reference().drift_ppb(), -100'000, 5'000);
    // SYNC0 of both segments at the same time.
    EXPECT_LE(std::abs(difference(2)), 600);
    EXPECT_TRUE(clock_status(second.ctx, bus.osal.now()).in_sync) << "the other clocks of the segment follow";
}

// The bridge stores both times each millisecond, which is an even number of times in these cycles.
struct CyclesOfTwoSegments : TwoSegments, testing::WithParamInterface<int> {};

TEST_P(CyclesOfTwoSegments, SeveralTimeStampsInACycle) {
    bring_up(0us, 0, std::chrono::milliseconds(GetParam()));
    run(6000);
    EXPECT_EQ(of_second->state(), PhaseState::in_sync) << to_text(of_second->state());
    EXPECT_TRUE(of_second->connected());
    forget();
    run(500);
    EXPECT_LE(most, 400 + 110 * GetParam()) << "100 ppm between both, 100 ns in each millisecond";
}

INSTANTIATE_TEST_SUITE_P(Milliseconds, CyclesOfTwoSegments, testing::Values(2, 4, 10, 20));

// Cycles that are on the wire when a correction is sent do not contain the correction yet.
struct OverlappedCyclesOfTwoSegments : TwoSegments, testing::WithParamInterface<int> {};

TEST_P(OverlappedCyclesOfTwoSegments, HaveOneClock) {
    second.in_flight = GetParam();
    bring_up();
    run(8000);
    EXPECT_EQ(of_second->state(), PhaseState::in_sync) << to_text(of_second->state());
    forget();
    run(1000);
    EXPECT_LE(most, 600);
}

INSTANTIATE_TEST_SUITE_P(InFlight, OverlappedCyclesOfTwoSegments, testing::Values(2, 3, 4));

TEST_F(TwoSegments, OrWithAnOffset) {
    bring_up(250us);
    run(6000);
    forget();
    run(3000, 250'000);
    EXPECT_LE(most, 500);
    const std::int64_t shown = of_second->difference_ns() % 1'000'000;
    EXPECT_NEAR(static_cast<double>((shown + 1'000'000) % 1'000'000), 250'000, 500) << "as the bridge shows it";
}

// The other half is switched off, and the segment keeps its rate. When the half is back, both segments are in step
// again.
TEST_F(TwoSegments, ABridgeThatIsLostKeepsTheRate) {
    bring_up();
    run(6000);
    first.segment.set_power(1, false, bus.osal.now());
    forget();
    run(1000);
    EXPECT_FALSE(of_second->connected());
    EXPECT_LE(most, 10'000) << "without the rate that was learned: 100 µs";
    EXPECT_TRUE(all_in_op(second)) << "nothing else happens to the segment";
    first.segment.set_power(1, true, bus.osal.now());
    run(6000);
    EXPECT_TRUE(of_second->connected());
    EXPECT_TRUE(all_in_op(first));
    forget();
    run(1000);
    EXPECT_LE(most, 500);
}

// Without time stamps, a change of the drift is not seen.
TEST_F(TwoSegments, WithoutTimeStampsTheStateIsNotInSync) {
    bring_up();
    run(6000);
    ASSERT_EQ(of_second->state(), PhaseState::in_sync);
    first.segment.set_power(1, false, bus.osal.now());
    run(900);
    EXPECT_EQ(of_second->state(), PhaseState::in_sync) << "the rate that was learned is kept";
    run(200);
    EXPECT_EQ(of_second->state(), PhaseState::busy);
    EXPECT_EQ(of_second->cycle().state(), PhaseState::in_sync) << "the cycle follows its own reference clock";
    first.segment.set_power(1, true, bus.osal.now());
    run(6000);
    EXPECT_EQ(of_second->state(), PhaseState::in_sync);
    // No frame comes back, so nothing is known of the bridge.
    second.segment.set_noise({.lost = 1});
    run(20);
    EXPECT_FALSE(of_second->connected());
    run(1100);
    EXPECT_EQ(of_second->state(), PhaseState::busy);
}

// The bridge carries process data too.
TEST_F(TwoSegments, OutputsOfOneHalfAreInputsOfTheOther) {
    bring_up();
    Output<std::uint32_t> out{2, 0x7000};
    EntryHandle* const entries[] = {&out};
    first.supervision.cancel();
    first.ctx.group(0).config.entries = entries;
    ASSERT_TRUE(config_map(first.ctx, first.image).ok());
    ASSERT_TRUE(submit(first.ctx, first.supervision).ok());
    run(1000);
    ASSERT_TRUE(all_in_op(first));
    out.write(0x1234'5678);
    run(10);
    const std::size_t at = second.ctx.slave(1).image.inputs.offset_bits / 8;
    EXPECT_EQ(load_le<std::uint32_t>(second.ctx.group(0).image, at), 0x1234'5678U);
}

TEST_F(TwoSegments, MistakesAreSaid) {
    bring_up(0us, 1);
    run(100);
    EXPECT_EQ(to_text(of_second->state()), "the bridge is not the reference clock of its segment");
    EXPECT_EQ(of_second->reference().state(), PhaseState::idle) << "nothing steers the reference clock";
    ExternalClock clock(2, {.cycle = {.mode = MasterClock::Mode::bus_shift}});
    EXPECT_EQ(to_text(clock.state()), "the mode of the cycle steers the reference clock too");
    ExternalClock no_cycle(2, {.cycle = {.mode = MasterClock::Mode::off, .phase = {.cycle = 0us}}});
    EXPECT_EQ(no_cycle.state(), PhaseState::set_value_wrong);
    EXPECT_EQ(no_cycle.update(second.ctx, 0us), 0us);
    // The settings that the clock of the cycle refuses are refused with a grid, too.
    ExternalClock grid_alone(2, {.cycle = {.mode = MasterClock::Mode::off, .phase = {.cycle = 0us}}, .grid = 1ms});
    EXPECT_EQ(grid_alone.state(), PhaseState::set_value_wrong);
    ExternalClock no_group(2, {.cycle = {.group = 200, .phase = {.cycle = 1ms}}});
    EXPECT_EQ(no_group.update(second.ctx, 0us), 0us);
    EXPECT_FALSE(no_group.connected());
    ExternalClock outside(2, {.cycle = {.set_value = 2ms, .phase = {.cycle = 1ms}}});
    EXPECT_EQ(outside.cycle().state(), PhaseState::set_value_wrong);
    EXPECT_EQ(outside.state(), PhaseState::set_value_wrong);
    sim::Segment other;
    other.add(bus.clocked({}).assemble());
    EXPECT_FALSE(sim::ClockBridge(first.segment, 1, other, 0).valid()) << "no half of a bridge";
}

}  // namespace
}  // namespace margay
