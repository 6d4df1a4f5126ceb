// The clock of the NIC as the reference of the bus.
#include "clock/clock_bus.hpp"

#include <margay/link_layer_clock.hpp>

#include <cmath>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(SendTimesTest, FindsTheNewestFrameByItsHead) {
    SendTimes times;
    std::array<std::byte, 64> frame{};
    const auto head = Bytes(frame).first(SendClock::kHeadBytes);
    EXPECT_FALSE(times.find(head));
    times.add(frame, 100);
    frame[14] = std::byte{5};  // the length changes with the datagrams that travel in the frame
    EXPECT_EQ(times.find(head), 100U);
    times.add(frame, 200);
    EXPECT_EQ(times.find(head), 200U);
    frame[17] = std::byte{9};  // the index
    EXPECT_FALSE(times.find(head));
    times.add(Bytes(frame).first(10), 300);
    EXPECT_FALSE(times.find(head));
    EXPECT_FALSE(times.find(head.first(10)));
    for (unsigned n = 0; n < SendTimes::kMost; ++n) {
        frame[17] = static_cast<std::byte>(100 + n);
        times.add(frame, n);
    }
    frame[17] = std::byte{100};
    EXPECT_EQ(times.find(head), 0U);
    times.add(frame, 1000);
    frame[17] = std::byte{101};
    EXPECT_EQ(times.find(head), 1U);
}

// The time comes after the frame was noted. A frame whose time is lost does not have the time of an older frame.
TEST(SendTimesTest, ALostTimeIsNotThatOfAnOlderFrame) {
    SendTimes times;
    std::array<std::byte, 64> frame{};
    const auto head = Bytes(frame).first(SendClock::kHeadBytes);
    for (std::uint64_t n = 0; n < SendTimes::kMost; ++n) {
        frame[17] = static_cast<std::byte>(n);
        times.add(frame, std::nullopt);
        EXPECT_FALSE(times.find(head));
        times.add(frame, 1000 + n);
    }
    for (std::uint64_t n = 0; n < SendTimes::kMost; ++n) {
        frame[17] = static_cast<std::byte>(n);
        EXPECT_EQ(times.find(head), 1000 + n) << "each frame has one entry";
    }
    frame[17] = std::byte{3};
    times.add(frame, std::nullopt);
    EXPECT_FALSE(times.find(head)) << "the time of the frame 256 frames ago";
    times.add(frame, 5000);
    EXPECT_EQ(times.find(head), 5000U);
    // Or the NIC counts its frames, also over the wrap of the counter.
    SendTimes counted;
    counted.add(frame, 7000, 0xFFFF'FFF0);
    EXPECT_EQ(counted.find(head, 0xFFFF'FFF1), 7000U);
    EXPECT_EQ(counted.find(head, 40), 7000U);
    EXPECT_FALSE(counted.find(head, 0xF0)) << "256 frames later";
    EXPECT_FALSE(counted.find(head, 0x30)) << "64 frames later: beside overlapping cycles";
}

// A NIC whose clock is 60 ppm faster than the clock of the host, and two slaves that drift. The host does not know the
// time between the wake-up and the wire.
struct LinkLayerClockTest : testing::Test, ClockBus {
    std::mt19937 random{3};
    Time due{};
    std::int64_t hidden_ns = 30'000;
    double squares = 0;
    double most = 0;
    int counted = 0;

    void bring_up(bool stamps = true, Duration round_trip = Duration{0}) {
        add({.drift_ppb = -80'000, .start_ns = 99});
        add({.drift_ppb = 40'000});
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal,
                                             SimulatedNic::Options{.round_trip = round_trip,
                                                                   .time_stamps = stamps,
                                                                   .clock_drift_ppb = 60'000,
                                                                   .clock_start_ns = 0x1234'5678'9ABC});
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
        ASSERT_TRUE(config_map(*ctx, image).ok());
        due = osal.now() + 10ms;
    }
    // The system time minus the time of the NIC, within a cycle.
    double phase() {
        const Time now = osal.now();
        const std::uint64_t away = segment.slave(0).clock().copy(now) % 1'000'000 + 1'000'000;
        return static_cast<double>(phase_error_ns(away - nic->clock_ns(now) % 1'000'000, 1'000'000, 0));
    }
    void run_cycles(LinkLayerClock& clock, int count, double wanted) {
        std::uniform_int_distribution<std::int64_t> hidden(0, hidden_ns);
        for (int n = 0; n < count; ++n) {
            osal.wait(due + Duration{hidden(random)}, -1);
            ASSERT_TRUE(send_processdata(*ctx).ok());
            (void)receive_processdata(*ctx, reply_timeout);
            const double error = phase() - wanted;
            squares += error * error;
            most = std::max(most, std::abs(error));
            ++counted;
            const Duration earlier = clock.update(*ctx, Duration{0});
            (void)poll(*ctx, osal.now());
            due += 1ms - earlier;
        }
    }
    void forget() { squares = most = counted = 0; }
};

TEST_F(LinkLayerClockTest, TheBusFollowsTheClockOfTheNic) {
    bring_up();
    LinkLayerClock clock(*nic, {.set_value = -200us, .phase = {.cycle = 1ms, .settle = 100ms}});
    EXPECT_EQ(clock.state(), PhaseState::idle);
    run_cycles(clock, 4000, -200'000);
    EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
    forget();
    run_cycles(clock, 5000, -200'000);
    // The reference receives a frame 140 ns after the NIC has sent it, because of the port. This delay is not
    // compensated.
    EXPECT_LE(most, 700) << "30 µs of jitter that the host does not know move nothing";
    EXPECT_LE(greatest_error_ns(2), 200) << "140 ns between both references in each cycle";
    EXPECT_NEAR(clock.cycle().drift_ppb(), 60'000, 10'000) << "the cycle is faster, as the NIC is";
    EXPECT_EQ(clock.without_stamp(), 0U);
    // When a frame leaves, the NIC shows a whole millisecond, up to the jitter.
    const auto sent = static_cast<double>(phase_error_ns(nic->clock_ns(due), 1'000'000, 0));
    EXPECT_NEAR(sent, -15'000, 8'000) << "in the mean of 0 to 30 µs";
}

// The same jitter without time stamps: the master treats the jitter as an error of the clock.
TEST_F(LinkLayerClockTest, WithoutItTheJitterOfTheHostMovesTheBus) {
    bring_up();
    MasterClock clock({.mode = MasterClock::Mode::bus_shift, .phase = {.cycle = 1ms, .outlier_ns = 50'000}});
    std::int64_t seen = 0;
    for (int n = 0; n < 5000; ++n) {
        std::uniform_int_distribution<std::int64_t> hidden(0, hidden_ns);
        osal.wait(due + Duration{hidden(random)}, -1);
        ASSERT_TRUE(send_processdata(*ctx).ok());
        (void)receive_processdata(*ctx, reply_timeout);
        (void)clock.update(*ctx, Duration{0});
        (void)poll(*ctx, osal.now());
        if (n > 4000) seen = std::max(seen, std::abs(clock.error_ns()));
        due += 1ms;
    }
    EXPECT_GE(seen, 10'000);
}

TEST_F(LinkLayerClockTest, LostFramesAndCyclesWithoutStampsKeepTheRate) {
    bring_up();
    LinkLayerClock clock(*nic, {.phase = {.cycle = 1ms}});
    run_cycles(clock, 4000, 0);
    segment.set_noise({.lost = 0.05, .seed = 5});
    forget();
    run_cycles(clock, 5000, 0);
    EXPECT_LE(most, 3000);
    EXPECT_NEAR(clock.reference().drift_ppb(), -140'000, 10'000);
}

TEST_F(LinkLayerClockTest, ANicWithoutStampsCorrectsNothingAndSaysSo) {
    bring_up(false);
    LinkLayerClock clock(*nic, {.phase = {.cycle = 1ms}});
    run_cycles(clock, 100, 0);
    EXPECT_EQ(clock.state(), PhaseState::idle);
    EXPECT_GE(clock.without_stamp(), 95U);
    EXPECT_FALSE(clock.record().read);
    LinkLayerClock wrong(*nic, {.set_value = 1ms, .phase = {.cycle = 1ms}});
    EXPECT_EQ(wrong.state(), PhaseState::set_value_wrong);
    EXPECT_EQ(wrong.record().state, PhaseState::set_value_wrong) << "for the log";
    EXPECT_EQ(wrong.update(*ctx, 0us), Duration{0});
}

// A NIC that gives time stamps for some time only.
struct StampsThatStop final : SendClock {
    SimulatedNic& nic;
    bool stopped = false;

    explicit StampsThatStop(SimulatedNic& of) : nic(of) {}
    std::optional<std::uint64_t> send_time_ns(Bytes head) noexcept override {
        if (stopped) return std::nullopt;
        return nic.send_time_ns(head);
    }
};

TEST_F(LinkLayerClockTest, WithoutReadingsTheStateIsNotInSync) {
    bring_up();
    StampsThatStop stamps(*nic);
    LinkLayerClock clock(stamps, {.phase = {.cycle = 1ms}});
    run_cycles(clock, 4000, 0);
    ASSERT_EQ(clock.state(), PhaseState::in_sync);
    stamps.stopped = true;
    const std::int64_t before = clock.record().adjusted_ns;
    run_cycles(clock, 900, 0);
    EXPECT_EQ(clock.state(), PhaseState::in_sync) << "the rate that was learned is kept";
    EXPECT_NEAR(static_cast<double>(clock.record().adjusted_ns - before), -140.0 * 900, 140.0 * 90) << "for the log";
    run_cycles(clock, 200, 0);
    EXPECT_EQ(clock.state(), PhaseState::busy);
    EXPECT_EQ(clock.record().state, PhaseState::busy);
    stamps.stopped = false;
    run_cycles(clock, 4000, 0);
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    segment.set_noise({.lost = 1});
    run_cycles(clock, 1100, 0);
    EXPECT_EQ(clock.state(), PhaseState::busy);
}

TEST_F(LinkLayerClockTest, ACycleThatIsNotThatOfTheSettingsIsSaid) {
    bring_up();
    LinkLayerClock clock(*nic, {.phase = {.cycle = 2ms}});
    run_cycles(clock, 4000, 0);
    EXPECT_EQ(clock.state(), PhaseState::cycle_wrong) << to_text(clock.state());
    EXPECT_EQ(clock.record().state, PhaseState::cycle_wrong);
}

// A NIC whose time stamps are readable one cycle late.
struct LateStamps final : SendClock {
    SimulatedNic& nic;
    std::array<std::byte, kHeadBytes> last{};

    explicit LateStamps(SimulatedNic& of) : nic(of) {}
    std::optional<std::uint64_t> send_time_ns(Bytes head) noexcept override {
        if (std::ranges::equal(last, head.first(kHeadBytes))) return nic.send_time_ns(head);
        std::ranges::copy(head.first(kHeadBytes), last.begin());
        return std::nullopt;
    }
};

struct LinkLayerClockOf : LinkLayerClockTest, testing::WithParamInterface<std::tuple<int, bool>> {};

// With cycles of 10 ms and more, a correction is sent at once.
TEST_P(LinkLayerClockOf, ComesIntoSyncAndLosesNoFrame) {
    const Duration cycle = std::chrono::milliseconds(std::get<int>(GetParam()));
    bring_up();
    LateStamps late(*nic);
    SendClock& stamps = std::get<bool>(GetParam()) ? static_cast<SendClock&>(late) : *nic;
    const std::uint64_t lost = ctx->statistics().lost;
    for (const int part : {2, -3, 6}) {
        SCOPED_TRACE(part);
        LinkLayerClock clock(stamps, {.set_value = -cycle / part, .phase = {.cycle = cycle}});
        std::int64_t greatest = 0;
        for (int n = 0; n < 3000; ++n) {
            osal.wait(due, -1);
            ASSERT_TRUE(send_processdata(*ctx).ok());
            (void)receive_processdata(*ctx, reply_timeout);
            due += cycle - clock.update(*ctx, 0us);
            (void)poll(*ctx, osal.now());
            if (n > 2500) greatest = std::max(greatest, std::abs(clock.error_ns()));
        }
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        EXPECT_LE(greatest, 1000);
    }
    EXPECT_EQ(ctx->statistics().lost, lost);
}

INSTANTIATE_TEST_SUITE_P(MillisecondsAndLateStamps, LinkLayerClockOf,
                         testing::Combine(testing::Values(1, 9, 10, 12, 20), testing::Bool()));

// The orders of receive (R), send (S), update (U) and poll (P) in a cycle. In some orders, the next cycle is under way
// when the reading of the last one is compared, or poll() has read its frame. `polls`: until the next cycle is due.
struct LinkLayerOrder {
    const char* calls;
    bool polls;
};
struct LinkLayerClockIn : LinkLayerClockTest, testing::WithParamInterface<LinkLayerOrder> {};

TEST_P(LinkLayerClockIn, EachOrderOfCallsTheJitterOfTheHostMovesNothing) {
    bring_up(true, 20us);
    for (const Duration cycle : {1ms, 12ms}) {
        SCOPED_TRACE(cycle / 1ms);
        LinkLayerClock clock(*nic, {.set_value = -200us, .phase = {.cycle = cycle}});
        std::uniform_int_distribution<std::int64_t> hidden(0, 30'000);
        std::int64_t greatest = 0;
        for (int n = 0; n < 4000; ++n) {
            const Time begin = due + Duration{hidden(random)};
            while (osal.now() < begin) {
                const Time next = GetParam().polls ? poll(*ctx, osal.now()) : begin;
                osal.advance(std::clamp<Duration>(next - osal.now(), 5us, begin - osal.now()));
            }
            Duration earlier{};
            for (const char* call = GetParam().calls; *call != '\0'; ++call) {
                if (*call == 'R') (void)receive_processdata(*ctx, reply_timeout);
                if (*call == 'S') {
                    ASSERT_TRUE(send_processdata(*ctx).ok());
                }
                if (*call == 'U') earlier = clock.update(*ctx, 0us);
                if (*call == 'P') (void)poll(*ctx, osal.now());
            }
            due += cycle - earlier;
            if (n > 3000) greatest = std::max(greatest, std::abs(clock.error_ns()));
        }
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        EXPECT_LE(greatest, 1000);
    }
}

INSTANTIATE_TEST_SUITE_P(Orders, LinkLayerClockIn,
                         testing::Values(LinkLayerOrder{"SRUP", false}, LinkLayerOrder{"SRUP", true},
                                         LinkLayerOrder{"RSUP", false}, LinkLayerOrder{"RSUP", true},
                                         LinkLayerOrder{"RUSP", false}, LinkLayerOrder{"RUSP", true},
                                         LinkLayerOrder{"PRSU", false}, LinkLayerOrder{"RSPU", false},
                                         LinkLayerOrder{"RPSU", true}, LinkLayerOrder{"PRUS", false},
                                         LinkLayerOrder{"SPRU", false}, LinkLayerOrder{"SUPR", false},
                                         LinkLayerOrder{"SUPR", true}),
                         [](const testing::TestParamInfo<LinkLayerOrder>& order) {
                             return std::string(order.param.calls) + (order.param.polls ? "Polls" : "");
                         });

TEST_F(LinkLayerClockTest, RunCycleFollowsIt) {
    bring_up();
    LinkLayerClock clock(*nic, {.set_value = -300us, .phase = {.cycle = 1ms, .settle = 100ms}});
    int done = 0;
    double worst = 0;
    const auto work = [&](const CycleInfo&) {
        if (++done > 3000) worst = std::max(worst, std::abs(phase() + 300'000));
        return done < 6000;
    };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .clock = &clock}, work).ok());
    EXPECT_EQ(clock.state(), PhaseState::in_sync);
    EXPECT_LE(worst, 700);
}

}  // namespace
}  // namespace margay
