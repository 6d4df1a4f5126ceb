// Frames of the cycle that are sent at a given time, and the time stamps of the NIC for these frames.
#include "clock/clock_bus.hpp"

#include <margay/cycle_stamps.hpp>
#include <margay/master_clock.hpp>
#include <margay/redundancy.hpp>
#include <margay/timed_send.hpp>

#include <cmath>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

// The virtual clock of a machine that wakes up late, by up to `jitter`.
class LateOsal final : public Osal {
  public:
    explicit LateOsal(VirtualOsal& clock) : clock_(clock) {}
    Duration jitter{0};
    std::uintptr_t thread = 1;  // the thread that calls

    [[nodiscard]] Time now() noexcept override { return clock_.now(); }
    void wait(Time until, WaitHandles nics) noexcept override {
        if (until > clock_.now() && until != kNever) until += Duration(late_(random_) * jitter.count() / 1000);
        clock_.wait(until, nics);
    }

  private:
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override { return thread; }

    VirtualOsal& clock_;
    std::mt19937 random_{7};
    std::uniform_int_distribution<Duration::rep> late_{0, 1000};
};

struct TimedSendTest : testing::Test, ClockBus {
    static constexpr Duration kLead = 80us;
    LateOsal late{osal};
    double most_late_ns = 0;  // the greatest time by which frames were sent too late
    double least_late_ns = 1e9;

    void bring_up(const SimulatedNic::Options& options = {.time_stamps = true, .timed_frames = 8}) {
        add({.drift_ppb = -80'000, .start_ns = 99});
        add({.drift_ppb = 40'000});
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, late, options);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, late).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
        ASSERT_TRUE(config_map(*ctx, image).ok());
        late.jitter = 50us;
    }
    void forget() {
        most_late_ns = 0;
        least_late_ns = 1e9;
    }
    // The clock of the NIC shows the time of the osal.
    Time sent() {
        const CycleStamps stamps = cycle_stamps(*ctx, nic->timing());
        EXPECT_TRUE(stamps.sent_ns);
        return Time(Duration(static_cast<Duration::rep>(stamps.sent_ns.value_or(0))));
    }
    void note(const CycleInfo& cycle) {
        EXPECT_EQ(cycle.error.code, Errc::none);
        const auto away = static_cast<double>((sent() - cycle.due).count());
        most_late_ns = std::max(most_late_ns, away);
        least_late_ns = std::min(least_late_ns, away);
    }
    void run_cycles(std::uint64_t count, CycleSettings settings) {
        const auto work = [&](const CycleInfo& cycle) {
            note(cycle);
            return cycle.number < count;
        };
        ASSERT_TRUE(run_cycle(*ctx, settings, work).ok());
    }
};

TEST_F(TimedSendTest, FramesLeaveExactlyAtTheirTimeWhateverTheWakeUp) {
    bring_up();
    run_cycles(2000, {.period = 1ms});
    EXPECT_GT(most_late_ns, 45'000) << "without a time, the jitter of the wake-up is on the wire";
    forget();
    run_cycles(2000, {.period = 1ms, .send_at = nic.get(), .send_lead = kLead});
    EXPECT_EQ(least_late_ns, 80'000);
    EXPECT_EQ(most_late_ns, 80'000);
    EXPECT_EQ(nic->missed(), 0U);
}

// The phase of the frames in the time of the slaves, relative to SYNC0.
TEST_F(TimedSendTest, ThePhaseAgainstSync0DoesNotDependOnTheWakeUp) {
    for (const bool timed : {false, true}) {
        SCOPED_TRACE(timed);
        if (!nic) bring_up();
        MasterClock clock({.set_value = -300us, .phase = {.cycle = 1ms, .settle = 100ms}});
        CycleSettings settings{.period = 1ms, .clock = &clock};
        if (timed) settings.send_at = nic.get();
        if (timed) settings.send_lead = kLead;
        double most = 0;
        const auto work = [&](const CycleInfo& cycle) {
            const std::uint64_t system = segment.slave(0).clock().copy(sent());
            const auto phase = static_cast<double>(phase_error_ns(system, 1'000'000, -300'000));
            if (cycle.number > 4000) most = std::max(most, std::abs(phase));
            return cycle.number < 6000;
        };
        ASSERT_TRUE(run_cycle(*ctx, settings, work).ok());
        EXPECT_EQ(clock.state(), PhaseState::in_sync) << to_text(clock.state());
        if (timed)
            EXPECT_LE(most, 500) << "140 ns of port, and the controller";
        else
            EXPECT_GT(most, 40'000);
    }
}

TEST_F(TimedSendTest, ACycleThatBeginsTooLateSendsAtOnceAndIsCounted) {
    bring_up();
    late.jitter = 0us;
    std::uint64_t slow = 0;
    const auto work = [&](const CycleInfo& cycle) {
        EXPECT_EQ(cycle.error.code, Errc::none);
        if (cycle.number % 10 == 1 && cycle.number > 1) {
            ++slow;
            EXPECT_EQ(sent() - cycle.due, 500us) << "at once, " << cycle.number;
        } else {
            EXPECT_EQ(sent() - cycle.due, kLead) << cycle.number;
        }
        if (cycle.number % 10 == 0) osal.advance(cycle.due + 1500us - osal.now());
        return cycle.number < 95;
    };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .send_at = nic.get(), .send_lead = kLead}, work).ok());
    EXPECT_EQ(slow, 9U);
    EXPECT_EQ(nic->missed(), 9U);
    EXPECT_EQ(nic->timing().send_at, nic.get());
}

TEST_F(TimedSendTest, ALeadOutsideOfThePeriodIsRefused) {
    bring_up();
    for (const Duration lead : {Duration(-1us), Duration(0us), Duration(1ms)}) {
        const auto ran = run_cycle(*ctx, {.period = 1ms, .send_at = nic.get(), .send_lead = lead},
                                   [](const CycleInfo&) { return false; });
        ASSERT_EQ(ran.error().code, Errc::invalid_argument);
        std::array<char, 256> text{};
        const std::string said(describe(ran.error(), text));
        EXPECT_NE(said.find("the send lead must be longer than 0 and shorter than the period"), std::string::npos)
            << said;
        EXPECT_FALSE(reach(*ctx, AlState::safeop, 1s, {.send_at = nic.get(), .send_lead = lead}).ok());
    }
    const auto without = run_cycle(*ctx, {.period = 1ms, .send_lead = -1us}, [](const CycleInfo&) { return false; });
    EXPECT_TRUE(without.ok()) << "without effect";
}

TEST_F(TimedSendTest, ALoopOfOnesOwn) {
    bring_up();
    ASSERT_TRUE(reach(*ctx, AlState::op, 5s, {.period = 1ms, .send_at = nic.get(), .send_lead = kLead}).ok());
    Time at = osal.now() + 700us;
    for (int n = 0; n < 200; ++n, at += 1ms) {
        late.wait(at - kLead, -1);
        ASSERT_TRUE(send_processdata_at(*ctx, *nic, at).ok());
        EXPECT_LE(osal.now(), at) << "nothing waits";
        const auto counter = receive_processdata(*ctx, 300us);
        ASSERT_TRUE(counter.ok()) << n;
        EXPECT_EQ(*counter, ctx->group(0).expected_wkc);
        EXPECT_EQ(sent(), at);
        (void)poll(*ctx, osal.now());
    }
    EXPECT_EQ(nic->missed(), 0U);
    // The timeout begins at the send time of the frames.
    late.jitter = 0us;
    segment.set_noise({.lost = 1.0, .seed = 5});
    at = osal.now() + 200us;
    ASSERT_TRUE(send_processdata_at(*ctx, *nic, at).ok());
    EXPECT_FALSE(receive_processdata(*ctx, 300us).ok());
    EXPECT_EQ(osal.now(), at + 300us);
}

TEST_F(TimedSendTest, AnotherThreadSendsNothing) {
    bring_up();
    late.thread = 2;
    EXPECT_EQ(send_processdata_at(*ctx, *nic, osal.now() + 1ms).error().code, Errc::not_owner);
    const CycleStamps stamps = cycle_stamps(*ctx, nic->timing());
    EXPECT_FALSE(stamps.sent_ns || stamps.received_ns);
    late.thread = 1;
    EXPECT_EQ(nic->next_arrival(), kNever);
}

// Acyclic datagrams are sent with the cycle, or at once by poll(). In both cases they come back in time.
TEST_F(TimedSendTest, RequestsBesideTheCycleDoNotTimeOut) {
    bring_up();
    const CycleSettings settings{.period = 4ms, .send_at = nic.get(), .send_lead = 3ms};
    ctx->group(0).config.acyclic_bytes = 500;
    RegisterReadRequest request;
    std::array<std::byte, 2> status{};
    request.slave = 2;
    request.address = 0x0130;
    request.data = status;
    std::uint64_t done = 0;
    const auto work = [&](const CycleInfo& cycle) {
        EXPECT_EQ(cycle.error.code, Errc::none);
        if (!request.busy() && cycle.number < 200) {
            EXPECT_TRUE(cycle.number == 1 || request.state() == RequestState::success);
            ++done;
            EXPECT_TRUE(submit(*ctx, request).ok());
        }
        return cycle.number < 200 || request.busy();
    };
    ASSERT_TRUE(run_cycle(*ctx, settings, work).ok());
    EXPECT_GE(done, 100U);
    EXPECT_EQ(ctx->statistics().lost, 0U);
    EXPECT_TRUE(errors().empty());
}

// Both copies of a frame leave at the same time.
TEST_F(TimedSendTest, BothNicsOfARingSendAtTheTime) {
    add({.drift_ppb = -80'000, .start_ns = 99});
    add({.drift_ppb = 40'000});
    ASSERT_TRUE(segment.connect_master({1, 1}, 1));
    segment.power_up(osal.now());
    nic = std::make_unique<SimulatedNic>(segment, late, SimulatedNic::Options{.time_stamps = true, .timed_frames = 8});
    SimulatedNic second(segment, late,
                        {.master_port = 1, .mac = {0, 1, 2, 3, 4, 5}, .time_stamps = true, .timed_frames = 8});
    nic->set_other_end(&second);
    second.set_other_end(nic.get());
    limits.redundancy = true;
    ctx = std::make_unique<HostContext>(limits);
    ASSERT_TRUE(init_redundant(*ctx, *nic, second, late).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    late.jitter = 50us;
    TimedPair both(*nic, second);
    const auto work = [&](const CycleInfo& cycle) {
        EXPECT_EQ(cycle.error.code, Errc::none) << cycle.number;
        EXPECT_EQ(sent() - cycle.due, kLead);
        // The first copy has come back at the second NIC.
        EXPECT_TRUE(cycle_stamps(*ctx, {.sent = nic.get(), .received = &second}).round_trip());
        return cycle.number < 500;
    };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms, .send_at = &both, .send_lead = kLead}, work).ok());
    EXPECT_EQ(both.missed(), 0U);
    EXPECT_EQ(second.frames_sent(), nic->frames_sent());
    ctx.reset();
    nic.reset();
}

TEST_F(TimedSendTest, TheRoundTripIsThatOfTheWire) {
    bring_up({.round_trip = 200us, .time_stamps = true, .clock_drift_ppb = 0, .clock_start_ns = 1'000'000});
    std::optional<Duration> first;
    const auto work = [&](const CycleInfo& cycle) {
        const CycleStamps stamps = cycle_stamps(*ctx, nic->timing());
        const auto trip = stamps.round_trip();
        EXPECT_TRUE(trip);
        if (!trip) return false;
        if (!first) first = trip;
        EXPECT_EQ(trip, first) << "jitter and delay of the host are not in it";
        EXPECT_EQ(*stamps.sent_ns - 1'000'000,
                  static_cast<std::uint64_t>((cycle.due + cycle.lateness).time_since_epoch().count()));
        return cycle.number < 500;
    };
    ASSERT_TRUE(run_cycle(*ctx, {.period = 1ms}, work).ok());
    // There and back through two slaves: the delay that configdc() has measured, and the ports of the last slave.
    EXPECT_GT(first, Duration(2 * kHop_ns));
    EXPECT_LT(first, Duration(4 * kHop_ns));
}

TEST_F(TimedSendTest, NoTimesWhereThereAreNone) {
    bring_up();
    const FrameTiming timing = nic->timing();
    const auto none = [](const CycleStamps& stamps) { return !stamps.sent_ns && !stamps.received_ns; };
    EXPECT_TRUE(none(cycle_stamps(*ctx, timing))) << "no cycle yet";
    ASSERT_TRUE(send_processdata(*ctx).ok());
    EXPECT_TRUE(none(cycle_stamps(*ctx, timing))) << "not received yet";
    (void)receive_processdata(*ctx, reply_timeout);
    EXPECT_TRUE(cycle_stamps(*ctx, timing).round_trip());
    EXPECT_TRUE(none(cycle_stamps(*ctx, {}))) << "a NIC without clocks";
    EXPECT_TRUE(cycle_stamps(*ctx, {.sent = timing.sent}).sent_ns);
    EXPECT_FALSE(cycle_stamps(*ctx, {.sent = timing.sent}).round_trip());
    EXPECT_TRUE(none(cycle_stamps(*ctx, timing, 1))) << "the group has one frame";
    EXPECT_TRUE(none(cycle_stamps(*ctx, timing, 0, 1))) << "no such group";
    segment.set_noise({.lost = 1.0, .seed = 5});
    ASSERT_TRUE(send_processdata(*ctx).ok());
    (void)receive_processdata(*ctx, reply_timeout);
    EXPECT_TRUE(none(cycle_stamps(*ctx, timing))) << "the frame is lost";
    HostContext empty(limits);
    EXPECT_TRUE(none(cycle_stamps(empty, timing)));
    EXPECT_EQ(send_processdata_at(empty, *nic, osal.now()).error().code, Errc::wrong_state);
}

}  // namespace
}  // namespace margay
