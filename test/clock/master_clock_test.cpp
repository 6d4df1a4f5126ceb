// The clock of the master and the reference clock: master shift, bus shift, and the time of the master as reference.
#include "clock/clock_bus.hpp"
#include "osal/cyclic_schedule.hpp"

#include <margay/master_clock.hpp>

#include <cmath>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(CyclicScheduleShift, MovesAllFurtherDeadlines) {
    CyclicSchedule schedule(1ms, 0us);
    schedule.start(Time{10ms});
    const Time first = schedule.deadline();
    EXPECT_EQ(schedule.wake(first).deadline, first);
    schedule.adjust(-30us);
    EXPECT_EQ(schedule.deadline(), first + 970us);
    const CyclicTick tick = schedule.wake(first + 975us);
    EXPECT_EQ(tick.lateness, 5us);
    EXPECT_EQ(schedule.deadline(), first + 1970us);
}

// A segment whose reference clock drifts against the master, and a cycle with jitter.
struct MasterClockTest : testing::Test, ClockBus {
    std::mt19937 random{1};
    std::int64_t jitter_ns = 10'000;
    Time due{};
    double squares = 0;
    int counted = 0;
    double most = 0;

    void bring_up(std::int32_t drift_ppb, bool others = true) {
        add({.drift_ppb = drift_ppb, .start_ns = 99});
        if (others) add({.drift_ppb = -30'000});
        if (others) add({.drift_ppb = 50'000, .start_ns = 0x7'1234'5678});
        start();
        const auto reference = configdc(*ctx, {.burst_frames = 300});
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ASSERT_TRUE(config_map(*ctx, image).ok());
        due = osal.now() + 10ms;
    }
    // The time at which the frame that is sent at `due` passes the reference clock, relative to the whole milliseconds
    // of this clock.
    double phase_at_due() {
        const std::uint64_t shown = segment.slave(0).clock().copy(osal.now());
        const auto then = shown - static_cast<std::uint64_t>((osal.now() - due).count());
        const auto into = static_cast<std::int64_t>(then % 1'000'000);
        return static_cast<double>(into > 500'000 ? into - 1'000'000 : into);
    }
    void run_cycles(MasterClock& clock, int count, double set_value_ns = 0) {
        std::uniform_int_distribution<std::int64_t> jitter(0, jitter_ns);
        for (int n = 0; n < count; ++n) {
            const Duration late{jitter(random)};
            osal.wait(due + late, -1);
            ASSERT_TRUE(send_processdata(*ctx).ok());
            (void)receive_processdata(*ctx, reply_timeout);
            const double error = phase_at_due() - set_value_ns;
            squares += error * error;
            most = std::max(most, std::abs(error));
            ++counted;
            const Duration earlier = clock.update(*ctx, late);
            (void)poll(*ctx, osal.now());
            due += 1ms - earlier;
        }
    }
    void forget() { squares = most = counted = 0; }
    double rms() const { return std::sqrt(squares / counted); }
};

// The reference clock loses the rate that it is steered to, because nothing writes its offset. The other clocks
// continue at this rate.
TEST_F(MasterClockTest, WithoutFramesASteeredReferenceIsNotInStepWithTheOthers) {
    bring_up(100'000);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    MasterClock clock({.mode = MasterClock::Mode::bus_shift, .set_value = -300us, .phase = {.cycle = 1ms}});
    run_cycles(clock, 8000);
    ASSERT_EQ(clock.state(), PhaseState::in_sync);
    ASSERT_TRUE(slave_clock(*ctx, 2).in_sync && slave_clock(*ctx, 3).in_sync);
    segment.set_noise({.lost = 1, .seed = 5});
    for (int n = 0; n < 500; ++n) {
        run_cycles(clock, 1);
        const bool in_sync = slave_clock(*ctx, 2).in_sync || slave_clock(*ctx, 3).in_sync;
        EXPECT_TRUE(!in_sync || greatest_error_ns(3) <= 1000) << n;
        EXPECT_TRUE(clock.state() != PhaseState::in_sync || std::abs(phase_at_due() + 300'000) <= 6000) << n;
        EXPECT_TRUE(n != 3 || (in_sync && clock.state() == PhaseState::in_sync)) << "a few lost frames end nothing";
    }
    EXPECT_EQ(clock.state(), PhaseState::busy);
    EXPECT_FALSE(clock_status(*ctx, osal.now()).in_sync);
    segment.set_noise({});
    run_cycles(clock, 8000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    EXPECT_TRUE(slave_clock(*ctx, 2).in_sync && slave_clock(*ctx, 3).in_sync);
}

TEST_F(MasterClockTest, TheCycleFollowsTheReferenceClock) {
    bring_up(80'000);
    MasterClock clock(
        {.mode = MasterClock::Mode::master_shift, .set_value = -200us, .phase = {.cycle = 1ms, .settle = 50ms}});
    EXPECT_EQ(clock.state(), PhaseState::idle);
    run_cycles(clock, 200, -200'000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    forget();
    run_cycles(clock, 5000, -200'000);
    EXPECT_LE(rms(), 1000) << "the target: 1 µs at 10 µs of jitter";
    EXPECT_LE(most, 1000);
    EXPECT_NEAR(clock.drift_ppb(), 80'000, 3'000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    EXPECT_LE(clock.error_ns(), 1000);
    EXPECT_LE(greatest_error_ns(3), 100);
}

TEST_F(MasterClockTest, TheReferenceClockFollowsTheCycle) {
    bring_up(-60'000);
    MasterClock clock({.mode = MasterClock::Mode::bus_shift, .phase = {.cycle = 1ms, .settle = 100ms}});
    run_cycles(clock, 4000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
    forget();
    const Time begin = osal.now();
    const std::uint64_t shown = segment.slave(0).clock().copy(begin);
    run_cycles(clock, 5000);
    EXPECT_LE(rms(), 1000);
    EXPECT_LE(most, 2000);
    EXPECT_NEAR(static_cast<double>(segment.slave(0).clock().copy(osal.now()) - shown),
                static_cast<double>((osal.now() - begin).count()), 2000)
        << "the reference clock runs at the rate of the master";
    EXPECT_LE(greatest_error_ns(3), 100) << "and the other clocks follow it";
}

TEST_F(MasterClockTest, TheTimeOfTheMasterIsTheReference) {
    bring_up(40'000);
    jitter_ns = 0;
    MasterClock clock({.mode = MasterClock::Mode::master_reference, .phase = {.cycle = 1ms}});
    run_cycles(clock, 3000);
    const Time begin = osal.now();
    const std::uint64_t shown = segment.slave(0).clock().copy(begin);
    run_cycles(clock, 5000);
    EXPECT_NEAR(static_cast<double>(segment.slave(0).clock().copy(osal.now()) - shown),
                static_cast<double>((osal.now() - begin).count()), 1000);
    EXPECT_LE(greatest_error_ns(3), 200);
}

TEST_F(MasterClockTest, TheTimeOfTheMasterComesInSync) {
    bring_up(40'000);
    jitter_ns = 0;
    MasterClock clock({.mode = MasterClock::Mode::master_reference, .set_value = -300us, .phase = {.cycle = 1ms}});
    run_cycles(clock, 6000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state()) << ", " << clock.error_ns() << " ns";
    EXPECT_LE(std::abs(clock.drift_ppb()), 500) << "the reference clock runs at the rate of the master";
    EXPECT_EQ(clock.record().adjusted_ns, 0);
    const auto all = events();
    EXPECT_EQ(told(all, "cycle in sync, "), 1) << joined(all);
}

// With long cycles, and without room for queued datagrams, the time does not wait for the next cycle.
TEST(TheTimeOfTheMaster, ComesInSyncWithLongCycles) {
    struct Case {
        Duration cycle;
        std::uint16_t acyclic_bytes;
    };
    for (const Case& one : {Case{1ms, 0}, {9ms, 1498}, {9ms, 0}, {10ms, 1498}, {20ms, 1498}}) {
        SCOPED_TRACE(one.cycle.count());
        ClockBus bus;
        bus.add({.drift_ppb = 40'000});
        bus.add({.drift_ppb = -30'000, .start_ns = 77});
        bus.start();
        bus.ctx->group(0).config.acyclic_bytes = one.acyclic_bytes;
        ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
        bus.run();
        MasterClock clock(
            {.mode = MasterClock::Mode::master_reference, .set_value = -300us, .phase = {.cycle = one.cycle}});
        std::int64_t most = 0;
        const Time begin = bus.osal.now();
        const auto each = [&](const CycleInfo&) {
            if (bus.osal.now() > begin + 20s) most = std::max(most, std::abs(clock.error_ns()));
            return bus.osal.now() < begin + 25s;
        };
        ASSERT_TRUE(run_cycle(*bus.ctx, {.period = one.cycle, .clock = &clock}, each).ok());
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        EXPECT_LE(most, 2000);
    }
}

// The loop of an application that sends before it reads the clock: the time belongs to the cycle that carries it.
TEST(TheTimeOfTheMaster, IsRightWhileACycleIsUnderWay) {
    ClockBus bus;
    bus.add({.drift_ppb = 40'000});
    bus.start();
    ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
    bus.run();
    MasterClock clock({.mode = MasterClock::Mode::master_reference, .phase = {.cycle = 1ms}});
    Time due = bus.osal.now() + 5ms;
    for (int n = 0; n < 10'000; ++n) {
        bus.osal.wait(due, -1);
        if (n > 0) (void)receive_processdata(*bus.ctx, 200us);
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        if (n > 0) (void)clock.update(*bus.ctx, 0us);
        due += 1ms;
        (void)poll(*bus.ctx, bus.osal.now());
    }
    const Time now = bus.osal.now();
    const auto ahead = static_cast<std::int64_t>(bus.segment.slave(0).clock().copy(now)) - (now - Time{}).count();
    EXPECT_LE(std::abs(ahead), 500'000 + 20'000) << "less than half of a cycle, for the phase of the set value";
}

// Cycles that are on the wire when a correction is sent do not contain the correction yet.
TEST(BusShiftOfOverlappedCycles, ComesIntoSync) {
    for (const int sets : {2, 3, 4}) {
        SCOPED_TRACE(sets);
        ClockBus bus;
        bus.add({.drift_ppb = 28'000});
        bus.add({.drift_ppb = -30'000, .start_ns = 77});
        bus.start();
        bus.ctx->group(0).config.cycles_in_flight = static_cast<std::uint8_t>(sets);
        ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
        bus.run();
        MasterClock clock({.mode = MasterClock::Mode::bus_shift, .set_value = -300us, .phase = {.cycle = 1ms}});
        std::int64_t most = 0;
        Time due = bus.osal.now() + 5ms;
        for (int n = 0; n < 12'000; ++n) {
            bus.osal.wait(due, -1);
            ASSERT_TRUE(send_processdata(*bus.ctx).ok());
            if (n >= sets - 1) {
                (void)receive_processdata(*bus.ctx, 200us);
                EXPECT_EQ(clock.update(*bus.ctx, 0us), 0us);
            }
            due += 1ms;
            (void)poll(*bus.ctx, bus.osal.now());
            if (n > 10'000) most = std::max(most, std::abs(clock.error_ns()));
        }
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        EXPECT_LE(most, 100);
    }
}

// Without corrections the phase moves through the whole cycle, and the drift is the difference of the two clocks.
TEST_F(MasterClockTest, OffShowsTheNaturalDrift) {
    for (const int drift : {80'000, -50'000}) {
        ClockBus other;
        other.add({.drift_ppb = drift});
        other.start();
        ASSERT_TRUE(configdc(*other.ctx, kFewFrames).ok());
        ASSERT_TRUE(config_map(*other.ctx, other.image).ok());
        MasterClock clock({.mode = MasterClock::Mode::off, .phase = {.cycle = 1ms}});
        int done = 0;
        int least = INT32_MAX;
        int most_drift = INT32_MIN;
        bool wrapped = false;
        const auto work = [&](const CycleInfo&) {
            if (++done < 300) return true;
            wrapped |= std::abs(clock.error_ns()) > 499'000;
            least = std::min(least, clock.drift_ppb());
            most_drift = std::max(most_drift, clock.drift_ppb());
            EXPECT_NE(clock.state(), PhaseState::drift_too_high) << done;
            return done < 20'000;
        };
        ASSERT_TRUE(run_cycle(*other.ctx, {.period = 1ms, .clock = &clock}, work).ok());
        EXPECT_TRUE(wrapped);
        EXPECT_NEAR(least, drift, 500);
        EXPECT_NEAR(most_drift, drift, 500);
        EXPECT_EQ(clock.record().drift_ppb, clock.drift_ppb());
        EXPECT_EQ(clock.record().adjusted_ns, 0);
    }
}

TEST_F(MasterClockTest, ADriftThatIsTooHighIsSaid) {
    bring_up(800'000, false);
    MasterClock clock({.mode = MasterClock::Mode::master_shift, .phase = {.cycle = 1ms}});
    run_cycles(clock, 500);
    EXPECT_EQ(clock.state(), PhaseState::drift_too_high);
    MasterClock off({.mode = MasterClock::Mode::off, .phase = {.cycle = 1ms}});
    run_cycles(off, 500);
    EXPECT_EQ(off.state(), PhaseState::drift_too_high);
    EXPECT_EQ(to_text(clock.state()), "the drift between both clocks is too high");
}

// The phase of the cycle that run_cycle() keeps itself, from reach() on.
TEST_F(MasterClockTest, RunCycleFollowsTheReferenceClock) {
    bring_up(80'000);
    MasterClock clock({.set_value = -200us, .phase = {.cycle = 1ms, .settle = 50ms}});
    const CycleSettings settings{.period = 1ms, .clock = &clock};
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s, settings).ok());
    double worst = 0;
    int done = 0;
    const auto work = [&](const CycleInfo& cycle) {
        due = cycle.due;
        if (++done > 500) worst = std::max(worst, std::abs(phase_at_due() + 200'000));
        return done < 3000;
    };
    ASSERT_TRUE(run_cycle(*ctx, settings, work).ok());
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    EXPECT_LE(worst, 1000);
    EXPECT_NEAR(clock.drift_ppb(), 80'000, 3'000);
    const auto all = events();
    EXPECT_EQ(told(all, "cycle in sync, "), 1) << joined(all);
    EXPECT_EQ(told(all, "cycle out of sync"), 0) << joined(all);
}

// The reference clock has 32 bits and wraps every 4.29 s, which is not a multiple of the cycle.
TEST_F(MasterClockTest, ATimeThatWrapsMakesNoStep) {
    for (const auto mode : {MasterClock::Mode::master_shift, MasterClock::Mode::bus_shift}) {
        ClockBus other;
        other.add({.drift_ppb = 50'000, .start_ns = 0xC000'0000, .unit = sim::DcUnit::bits32});
        other.start();
        ASSERT_TRUE(configdc(*other.ctx, kFewFrames).ok());
        ASSERT_TRUE(config_map(*other.ctx, other.image).ok());
        MasterClock clock({.mode = mode, .set_value = -100us, .phase = {.cycle = 1ms, .settle = 50ms}});
        const CycleSettings settings{.period = 1ms, .clock = &clock};
        int done = 0;
        std::int64_t worst = 0;
        const auto work = [&](const CycleInfo&) {
            if (++done > 2000) worst = std::max(worst, std::abs(clock.error_ns()));
            return done < 10'000;
        };
        ASSERT_TRUE(run_cycle(*other.ctx, settings, work).ok());
        EXPECT_LE(worst, 1000) << static_cast<int>(mode);
        EXPECT_EQ(clock.state(), PhaseState::in_sync);
    }
}

// The line of a cycle, with the columns of its head; the text is exact.
TEST_F(MasterClockTest, TheLogHasOneLineForEachCycle) {
    bring_up(80'000);
    MasterClock clock({.set_value = -200us, .phase = {.cycle = 1ms, .settle = 50ms}});
    run_cycles(clock, 300, -200'000);
    std::array<char, 400> head{};
    std::array<char, 300> line{};
    const auto columns = [](std::string_view text) { return 1 + std::count(text.begin(), text.end(), ','); };
    EXPECT_EQ(columns(write_clock_log_head(head)), 16);
    const ClockRecord& last = clock.record();
    EXPECT_EQ(columns(write_clock_log(last, line)), 16);
    EXPECT_TRUE(last.read);
    EXPECT_EQ(last.state, PhaseState::in_sync);
    EXPECT_EQ(last.error_ns, clock.error_ns());
    EXPECT_EQ(last.bus_time_off_ns, last.bus_time_ns % 1'000'000);
    EXPECT_NEAR(static_cast<double>(last.adjust_ns), 80, 40) << "80 ppm of a millisecond";
    const ClockRecord record{.at = Time{1'234'567us},
                             .set_value_ns = -200'000,
                             .bus_time_ns = 5'000'800'100,
                             .bus_time_off_ns = 800'100,
                             .adjust_ns = -83,
                             .error_ns = -1'500,
                             .filtered_ns = 7,
                             .drift_ppb = -80'005,
                             .cycle_ns = 1'000'000,
                             .adjusted_ns = -2'400,
                             .state = PhaseState::in_sync,
                             .clocks_in_sync = true,
                             .difference_ns = 31,
                             .start_time_ns = 5'000'000'000};
    EXPECT_EQ(write_clock_log(record, line),
              "1234.567,-200000,5000800100,800100,-83,-1500,7,-80.005,-15,-80.005,-2400,"
              "5000000000,2,1,1,31\n");
    EXPECT_EQ(write_clock_log({.error_ns = INT64_MIN, .drift_ppb = INT32_MIN, .cycle_ns = INT64_MAX}, line),
              "0.000,0,0,0,0,-9223372036854775808,0,-2147483.648,0,-9903520314282.209,0,0,0,0,0,0\n");
    EXPECT_EQ(write_clock_log({.error_ns = -20'000'000'000'000'000, .cycle_ns = 1'000'000'000}, line),
              "0.000,0,0,0,0,-20000000000000000,0,0.000,-9223372036,0.000,0,0,0,0,0,0\n");
}

TEST_F(MasterClockTest, WrongSettingsAreSaid) {
    bring_up(0, false);
    MasterClock far({.set_value = 1ms, .phase = {.cycle = 1ms}});
    EXPECT_EQ(to_text(far.state()), "the set value is not less than a cycle, or there is no cycle");
    for (const Duration wrong : {Duration::min(), Duration::max(), -1'000'000ns})
        EXPECT_EQ(MasterClock({.set_value = wrong, .phase = {.cycle = 1ms}}).state(), PhaseState::set_value_wrong);
    EXPECT_EQ(MasterClock({.phase = {.cycle = Duration::min()}}).state(), PhaseState::set_value_wrong);
    run_cycles(far, 3);
    EXPECT_EQ(far.state(), PhaseState::set_value_wrong);
    EXPECT_EQ(far.record().state, PhaseState::set_value_wrong) << "for the log";
    MasterClock other({.mode = MasterClock::Mode::off, .phase = {.cycle = 800us}});
    run_cycles(other, 30);
    EXPECT_EQ(to_text(other.state()), "the cycle is not that of the settings");
    MasterClock right({.phase = {.cycle = 1ms, .settle = 50ms}});
    run_cycles(right, 200);
    EXPECT_EQ(right.state(), PhaseState::in_sync);
    right.restart();
    EXPECT_EQ(right.state(), PhaseState::idle);
}

// No frame comes back for 2 s, so the phase is unknown. The cycle keeps the drift that it has learned. A reference
// clock whose offset nobody writes loses this drift: 50 ns in each cycle.
TEST_F(MasterClockTest, WithoutATimeTheStateIsNotInSync) {
    bring_up(50'000);
    for (const auto mode : {MasterClock::Mode::master_shift, MasterClock::Mode::bus_shift}) {
        SCOPED_TRACE(static_cast<int>(mode));
        MasterClock clock({.mode = mode, .phase = {.cycle = 1ms, .settle = 50ms}});
        run_cycles(clock, 6000);
        ASSERT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        (void)events();
        segment.set_noise({.lost = 1, .seed = 5});
        const bool cycle_follows = mode == MasterClock::Mode::master_shift;
        run_cycles(clock, cycle_follows ? 900 : 75);
        EXPECT_EQ(clock.state(), PhaseState::in_sync);
        run_cycles(clock, cycle_follows ? 200 : 10);
        EXPECT_EQ(clock.state(), PhaseState::busy);
        run_cycles(clock, 1900);
        EXPECT_EQ(clock.state(), PhaseState::busy);
        EXPECT_EQ(clock.record().state, PhaseState::busy);
        segment.set_noise({});
        run_cycles(clock, 3000);
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        const auto all = events();
        EXPECT_EQ(told(all, "cycle out of sync"), 1) << joined(all);
        EXPECT_EQ(told(all, "cycle in sync, "), 1) << joined(all);
    }
}

TEST_F(MasterClockTest, CyclesThatAreLostKeepTheRate) {
    bring_up(50'000);
    MasterClock clock({.mode = MasterClock::Mode::master_shift, .phase = {.cycle = 1ms}});
    run_cycles(clock, 1000);
    segment.set_noise({.lost = 0.05, .seed = 5});
    forget();
    run_cycles(clock, 3000);
    EXPECT_LE(most, 1500);
}

}  // namespace
}  // namespace margay
