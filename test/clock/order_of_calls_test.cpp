// The application chooses the order of receive_processdata(), send_processdata(), MasterClock::update() and poll() in a
// cycle, and may call poll() until the next cycle is due. In some orders poll() reads the frames of the cycle.
#include "clock/clock_bus.hpp"

#include <margay/master_clock.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct Order {
    const char* calls;  // R: receive, S: send, U: update, P: poll
    bool polls;         // until the next cycle is due
};

struct OrderOfCalls : testing::TestWithParam<Order>, ClockBus {
    static constexpr Duration kCycle = 1ms;
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = kCycle}};
    Time due{};
    unsigned wrong = 0;  // cycles in which the system time differs from the reference clock by more than 100 µs

    void begin(unsigned slaves) {
        nic_options.round_trip = 20us;
        add_line(slaves);
        start();
        ASSERT_TRUE(configdc(*ctx, {.burst_frames = 2000, .cycle = kCycle}).ok());
        for (std::uint16_t n = 1; n <= slaves; ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        due = osal.now();
    }
    void wait() {
        while (osal.now() < due) {
            const Time next = GetParam().polls ? poll(*ctx, osal.now()) : due;
            osal.advance(std::clamp<Duration>(next - osal.now(), 5us, due - osal.now()));
        }
    }
    void exchange(MasterClock& clock) {
        wait();
        Duration earlier{};
        for (const char* call = GetParam().calls; *call != '\0'; ++call) {
            if (*call == 'R') (void)receive_processdata(*ctx, 500us);
            if (*call == 'S') (void)send_processdata(*ctx);
            if (*call == 'U') earlier = clock.update(*ctx, Duration{});
            if (*call == 'P') (void)poll(*ctx, osal.now());
        }
        due += kCycle - earlier;
        (void)events();
    }
    std::int64_t away_ns() {
        const ClockStatus status = clock_status(*ctx, osal.now());
        const bool shown = status.reference != 0 && is_powered(status.reference) && in_op(status.reference);
        if (!shown) return 0;
        return static_cast<std::int64_t>(status.system_time_ns -
                                         segment.slave(status.reference - 1U).clock().copy(osal.now()));
    }
    void exchange_for(Duration time, MasterClock& clock) {
        const Time end = osal.now() + time;
        while (osal.now() < end) {
            exchange(clock);
            segment.advance(osal.now());
            if (std::abs(away_ns()) > 100'000) ++wrong;
        }
    }
};

INSTANTIATE_TEST_SUITE_P(Calls, OrderOfCalls,
                         testing::Values(Order{"RPSU", true}, Order{"RUSP", true}, Order{"PRUS", false},
                                         Order{"RPSU", false}, Order{"RUSP", false}, Order{"SRUP", true},
                                         Order{"RSPU", true}, Order{"SPRU", false}),
                         [](const testing::TestParamInfo<Order>& order) {
                             return std::string(order.param.calls) + (order.param.polls ? "Polls" : "");
                         });

TEST_P(OrderOfCalls, TheSystemTimeIsThatOfTheReference) {
    for (const auto mode : {MasterClock::Mode::off, MasterClock::Mode::master_shift, MasterClock::Mode::bus_shift,
                            MasterClock::Mode::master_reference}) {
        SCOPED_TRACE(static_cast<int>(mode));
        MasterClock clock({.mode = mode, .set_value = -kCycle / 2, .phase = {.cycle = kCycle}});
        if (segment.size() == 0) begin(4);
        wrong = 0;
        exchange_for(6s, clock);
        EXPECT_EQ(wrong, 0U) << away_ns() << " ns at the end";
        EXPECT_EQ(clock.state() == PhaseState::in_sync, mode != MasterClock::Mode::off) << to_text(clock.state());
    }
}

// The slave with the reference clock loses its power. Behind it no slave is reached.
TEST_P(OrderOfCalls, TheSystemTimeIsRightAfterALossOfPower) {
    begin(4);
    MasterClock clock({.mode = MasterClock::Mode::off, .phase = {.cycle = kCycle}});
    exchange_for(1s, clock);
    segment.set_power(0, false, osal.now());
    exchange_for(1500ms, clock);
    segment.set_power(0, true, osal.now());
    exchange_for(100ms, clock);  // until the library has seen that slave 1 was away
    wrong = 0;
    exchange_for(10s, clock);
    EXPECT_EQ(wrong, 0U) << away_ns() << " ns at the end";
    EXPECT_EQ(reference_clock(*ctx), 1);
    EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync);
    for (std::uint16_t s = 2; s <= 4; ++s) EXPECT_LE(std::abs(ahead_ns(s)), 400) << s;
}

}  // namespace
}  // namespace margay
