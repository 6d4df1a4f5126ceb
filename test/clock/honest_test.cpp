// The library reports no clock as in sync that is not in sync, whatever happens while the clock is measured, set, or
// brought back.
#include "clock/clock_bus.hpp"
#include "clock/port_times.hpp"

#include <margay/master_clock.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct HonestBus : ClockBus {
    void bring_up(const ClockSettings& settings) {
        start();
        ASSERT_TRUE(configdc(*ctx, settings).ok());
        run();
        cycles(300);
        (void)events();
    }
    // Executes cycles of 1 ms with bus shift.
    void shifted(MasterClock& master, int count, unsigned polls_in_cycle = 6) {
        Time next = osal.now();
        for (int n = 0; n < count; ++n) {
            next = std::max(next + 1ms, osal.now());
            osal.advance(next - osal.now());
            (void)send_processdata(*ctx);  // the segment may be silent
            (void)receive_processdata(*ctx, 300us);
            (void)master.update(*ctx, 0ms);
            for (unsigned polls = 0; polls < polls_in_cycle; ++polls) {
                (void)poll(*ctx, osal.now());
                osal.advance(50us);
            }
        }
    }
    struct Apart {
        std::int64_t all = 0;      // greatest difference between any two clocks
        std::int64_t in_sync = 0;  // greatest difference from the reference of a clock that is reported in sync
        unsigned longest = 0;      // cycles in succession without the time
    };
    // Executes 4000 cycles while the bus is shifted. `lost`: the share of lost frames in 8000 further cycles; then the
    // result is about these cycles.
    Apart seek(MasterClock& master, Duration cycle, double lost = 0) {
        constexpr int kSeeks = 4000;
        Apart apart;
        unsigned without = 0;
        Time next = osal.now();
        for (int n = 0; n < (lost > 0 ? 3 * kSeeks : kSeeks); ++n) {
            if (n == kSeeks) apart = {};
            if (n == kSeeks) segment.set_noise({.lost = lost, .seed = 77});
            next += cycle;
            while (osal.now() + 50us < next) {
                osal.advance(50us);
                (void)poll(*ctx, osal.now());
            }
            osal.advance(next - osal.now());
            (void)send_processdata(*ctx);  // frames may be lost
            (void)receive_processdata(*ctx, 300us);
            (void)master.update(*ctx, 0ms);
            without = master.record().read ? 0 : without + 1;
            apart.longest = std::max(apart.longest, without);
            apart.all = std::max(apart.all, greatest_error_ns(4));
            for (std::uint16_t s = 2; s <= 4; ++s)
                if (clock(s).in_sync) apart.in_sync = std::max(apart.in_sync, std::abs(ahead_ns(s)));
        }
        return apart;
    }
    void all_come_back(std::uint16_t slaves) {
        cycles(1000);  // now the supervision has noticed the event
        const auto all_in_sync = [&] {
            for (std::uint16_t s = 1; s <= slaves; ++s)
                if (!clock(s).in_sync) return false;
            return all_in_op();
        };
        ASSERT_TRUE(until(all_in_sync, 5000)) << joined(events());
        cycles(1000);
        EXPECT_LE(greatest_error_ns(slaves), 300) << joined(events());
        for (std::uint16_t s = 1; s <= slaves; ++s)
            EXPECT_EQ(register_of<std::uint32_t>(s, wire::reg::kSystemTimeDelay), clock(s).delay_ns) << s;
    }
};

struct Honest : testing::Test, HonestBus {};

// Slave 2 loses its power for a moment, at every step of configdc().
TEST(HonestConfigdc, ASlaveThatWasResetMeanwhileIsNotInSync) {
    unsigned failed = 0;
    for (unsigned moment = 0; moment < 60; ++moment) {
        SCOPED_TRACE(moment);
        ClockBus bus;
        bus.add_line(3);
        bus.start();
        ClockRequest request;
        request.settings = {.burst_frames = 300, .timeout = 50ms};
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        for (unsigned n = 0; n < 4000 && request.busy(); ++n) {
            if (n == moment * 20) {
                bus.power(1, false);
                bus.power(1, true);
            }
            bus.osal.advance(50us);
            (void)poll(*bus.ctx, bus.osal.now());
        }
        ASSERT_FALSE(request.busy());
        if (request.state() == RequestState::error) {
            ++failed;
            EXPECT_EQ(request.error().slave, 2) << ClockBus::words(request.error());
        }
        if (bus.clock(2).in_sync && bus.register_of<std::uint16_t>(2, wire::reg::kStationAddress) != 0) {
            EXPECT_LE(std::abs(bus.ahead_ns(2)), 300);
        } else {
            EXPECT_FALSE(bus.clock(2).in_sync) << "it has lost its clock";
        }
    }
    EXPECT_GE(failed, 5U) << "the moments are those of configdc()";
}

TEST_F(Honest, AShorterTimeThanTheSettleTimeIsNotInSync) {
    add({});
    add({.start_ns = 1'234'567});
    start();
    const auto reference = configdc(*ctx, {.burst_frames = 300, .settle = 1s, .timeout = 200ms});
    EXPECT_EQ(reference.error().code, Errc::not_in_sync);
    EXPECT_NE(words(reference.error()).find("it was not within the limit for ClockSettings::settle"), std::string::npos)
        << words(reference.error());
    EXPECT_FALSE(clock(2).in_sync);
}

// Before its loss is known, the reset slave answers by its position with its own time.
TEST_F(Honest, AnAnswerOfAResetReferenceIsNoSystemTime) {
    for (const int out : {3, 6, 9, 15, 40}) {
        SCOPED_TRACE(out);
        HonestBus bus;
        for (unsigned n = 0; n < 3; ++n)
            bus.add({.drift_ppb = static_cast<std::int32_t>(n) * 30'000, .start_ns = (n + 1) * 0x1234'5678'9ABCULL});
        ClockSettings settings = kFewFrames;
        settings.by_position = true;
        settings.replace_lost_reference = false;
        bus.bring_up(settings);
        bus.cycles(1000);
        bus.power(0, false);
        bus.cycles(out);
        bus.power(0, true);
        bus.all_come_back(3);
    }
}

// Both slaves are reset. While the library brings them back, the first slave is reset again, so the second slave
// becomes the reference before it has its delay again. Meanwhile the master writes its offset with each cycle.
TEST_F(Honest, AReferenceThatWasResetGetsItsDelayWhileTheBusIsShifted) {
    add({});
    add({.drift_ppb = 30'000, .start_ns = 0x1234'5678'9ABCULL});
    bring_up(kFewFrames);
    MasterClock master({.mode = MasterClock::Mode::bus_shift, .set_value = -200us, .phase = {.cycle = 1ms}});
    shifted(master, 3000);
    ASSERT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
    for (const int found : {1, 3, 5, 8}) {
        for (const std::uint32_t lost : {0U, 1U}) power(lost, false);
        shifted(master, 40, 1);
        for (const std::uint32_t lost : {0U, 1U}) power(lost, true);
        for (int n = 0; n < 1000 && ctx->slave(1).al.state == AlState::none; ++n) shifted(master, 1, 1);
        shifted(master, found, 1);
        power(0, false);
        shifted(master, 10, 1);
        power(0, true);
        shifted(master, 300, 1);
        shifted(master, 6000);
        EXPECT_TRUE(clock(1).in_sync && clock(2).in_sync) << joined(events());
        EXPECT_LE(greatest_error_ns(2), 300) << found;
        for (std::uint16_t s = 1; s <= 2; ++s)
            EXPECT_EQ(register_of<std::uint32_t>(s, wire::reg::kSystemTimeDelay), clock(s).delay_ns) << s;
    }
}

// The cycle begins half a cycle away from its phase. The reference moves by 600 ns per millisecond, and the other
// clocks follow with a delay.
TEST(HonestBusShift, NoClockThatLagsIsInSync) {
    for (const Duration cycle : {1ms, 2ms, 4ms}) {
        HonestBus bus;
        bus.add_line(4);
        bus.bring_up(kFewFrames);
        for (const Duration phase : {-200us, -700us, -230us}) {
            SCOPED_TRACE(testing::Message() << phase.count() << " of " << cycle.count());
            MasterClock master({.mode = MasterClock::Mode::bus_shift, .set_value = phase, .phase = {.cycle = cycle}});
            const auto seen = bus.seek(master, cycle);
            EXPECT_GT(seen.all, 2000) << "it seeks";
            EXPECT_LE(seen.in_sync, 800) << "four times the limit";
            for (std::uint16_t s = 1; s <= 4; ++s) EXPECT_TRUE(bus.clock(s).in_sync) << s << bus.joined(bus.events());
            EXPECT_EQ(master.state(), PhaseState::in_sync);
        }
    }
}

// In a lost cycle the reference moves by the learned drift, so the next times are as expected.
TEST(HonestBusShift, SingleLostFramesMoveNoClock) {
    for (const std::int32_t drift_ppb : {-76'300, -63'700, -54'370, 54'370}) {
        SCOPED_TRACE(drift_ppb);
        HonestBus bus;
        bus.add({.drift_ppb = drift_ppb});
        for (unsigned n = 1; n <= 3; ++n)
            bus.add({.drift_ppb = static_cast<std::int32_t>(n) * 10'000, .start_ns = n * 0x1234'5678ULL});
        bus.bring_up(kFewFrames);
        MasterClock master({.mode = MasterClock::Mode::bus_shift, .set_value = -500us, .phase = {.cycle = 1ms}});
        const auto seen = bus.seek(master, 1ms, 0.01);
        EXPECT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
        EXPECT_LE(seen.longest, 3U);
        EXPECT_LE(seen.all, 100) << bus.joined(bus.events());
    }
}

// The delays are measured without a pause, 16 times one after the other. Meanwhile the clocks are compared.
TEST_F(Honest, WhileTheDelaysAreMeasuredNoClockThatDriftsIsInSync) {
    add_line(4);
    ClockSettings settings = kFewFrames;
    settings.delay_interval = 1ms;
    bring_up(settings);
    cycles(1000);
    std::int64_t most = 0;
    for (int moment = 0; moment < 12; ++moment) {
        segment.slave(2).set_drift(moment % 2 == 0 ? 80'000 : -80'000, osal.now());
        for (int n = 0; n < 700 + 7 * moment; ++n) {
            cycles(1);
            if (clock(3).in_sync) most = std::max(most, std::abs(ahead_ns(3)));
        }
        EXPECT_TRUE(clock(3).in_sync) << moment;
    }
    EXPECT_LE(most, 4000) << "160 ppm for 25 ms";
}

// A slave that config_init() has not found was inserted between two other slaves.
TEST_F(Honest, ASlaveThatWasNotFoundIsNoticed) {
    add({});
    add({.start_ns = 1'234'567});
    start();
    const auto between = segment.add(clocked({.unit = sim::DcUnit::none, .features = 0}).assemble());
    segment.disconnect({1, 0});
    ASSERT_TRUE(segment.connect({0, 1}, {between, 0}, kCable));
    ASSERT_TRUE(segment.connect({between, 1}, {1, 0}, kCable));
    power(between, true);
    osal.advance(1s);
    const auto reference = configdc(*ctx, kFewFrames);
    EXPECT_EQ(words(reference.error()),
              "synchronising the clocks: the slaves, or their connections, have changed meanwhile (more slaves answer "
              "than were found: search again)");
}

TEST_F(Honest, ALostSlaveLeavesTheOthersInSync) {
    add_line(3);
    bring_up(kFewFrames);
    power(2, false);
    cycles(500);
    unsigned others_not_in_sync = 0;
    for (unsigned n = 0; n < 2000; ++n) {
        cycles(1);
        others_not_in_sync += clock_status(*ctx, osal.now()).in_sync ? 0U : 1U;
    }
    EXPECT_EQ(others_not_in_sync, 0U) << joined(events());
    EXPECT_FALSE(clock(3).in_sync);
}

// An unexpected device has a clock, and the master does not set this clock.
TEST_F(Honest, AnUnexpectedClockDoesNotCount) {
    add_line(3);
    bring_up(kFewFrames);
    const auto unexpected = segment.add(clocked({.drift_ppb = 1000}).assemble());
    power(unexpected, true);
    ASSERT_TRUE(segment.connect({2, 1}, {unexpected, 0}, kCable));
    cycles(3000);
    const std::string told = joined(events());
    ASSERT_NE(told.find("an unexpected slave"), std::string::npos) << told;
    const ClockStatus status = clock_status(*ctx, osal.now());
    EXPECT_TRUE(status.in_sync);
    EXPECT_LE(status.greatest_ns, 500U);
}

// After a loss of power the SYNC signals cannot be activated again.
TEST_F(Honest, SyncSignalsThatDoNotRunAreNotSaidToBeActive) {
    SlaveSetup by_sii{.dc = {.source = SyncSettings::Source::sii}};
    add_line(3);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t s = 1; s <= 3; ++s) ctx->slave(s).config.setup = &by_sii;
    run();
    for (const std::uint16_t s : {std::uint16_t{2}, std::uint16_t{1}}) {
        EXPECT_TRUE(clock(s).sync_active) << s;
        by_sii.dc.sii_mode = 9;
        power(s - 1U, false);
        cycles(s == 1 ? 5 : 200);
        power(s - 1U, true);
        cycles(3000);
        EXPECT_EQ(ctx->slave(s).al.state, AlState::preop) << joined(events());
        EXPECT_FALSE(clock(s).sync_active) << s;
        by_sii.dc.sii_mode = 0;
    }
}

// The setup of slave 2 does not want SYNC signals any more. The slave is mapped again, started again, or brought to
// PREOP and SAFEOP.
TEST_F(Honest, SyncSignalsThatTheSetupDoesNotWantAnyMoreAreSwitchedOff) {
    SlaveSetup wanted{.dc = {.source = SyncSettings::Source::application}};
    add_line(3);
    start();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    for (std::uint16_t s = 1; s <= 3; ++s) ctx->slave(s).config.setup = &wanted;
    run();
    SlaveSetup other = wanted;
    ctx->slave(2).config.setup = &other;
    for (const int way : {0, 1, 2}) {
        SCOPED_TRACE(way);
        other.dc.source = SyncSettings::Source::application;
        ASSERT_TRUE(reconfigure_slave(*ctx, 2).ok());
        ASSERT_TRUE(until([this] { return all_in_op(); }));
        EXPECT_TRUE(clock(2).sync_active);
        EXPECT_NE(clock(2).sync_start_ns, 0U);
        other.dc.source = SyncSettings::Source::none;
        const AlState before = way == 1 ? AlState::preop : AlState::init;
        EXPECT_TRUE((way == 0 ? reconfigure_slave(*ctx, 2) : set_target(*ctx, 2, before)).ok());
        cycles(300);
        EXPECT_TRUE(set_target(*ctx, 2, AlState::none).ok());
        ASSERT_TRUE(until([this] { return all_in_op(); }));
        EXPECT_EQ(register_of<std::uint8_t>(2, wire::reg::kSyncActivation), 0);
        EXPECT_FALSE(clock(2).sync_active);
        EXPECT_EQ(clock(2).sync_start_ns, 0U);
        EXPECT_TRUE(clock(1).sync_active && clock(3).sync_active);
    }
}

// Slave 1 is back, and the reference is lost before the clock of slave 1 is set. The system time does not change.
TEST_F(Honest, ASlaveThatDoesNotHaveItsClockYetIsNoReference) {
    add_line(2);
    bring_up(kFewFrames);
    for (int wait = 0; wait < 12; ++wait) {
        SCOPED_TRACE(wait);
        power(0, false);
        cycles(300);
        power(0, true);
        ASSERT_TRUE(until([this] { return reference_clock(*ctx) == 2 && ctx->slave(1).al.state == AlState::preop; }));
        cycles(wait);
        segment.set_cable({1, 0}, false);
        cycles(200);
        segment.set_cable({1, 0}, true);
        ASSERT_TRUE(until([this] { return all_in_op() && clock_status(*ctx, osal.now()).in_sync; }, 10'000));
        const std::uint64_t expected = static_cast<std::uint64_t>((osal.now() - Time{}).count());
        const auto away = static_cast<std::int64_t>(clock_status(*ctx, osal.now()).system_time_ns - expected);
        EXPECT_LE(std::abs(away), 100'000'000) << joined(events());
    }
}

// With cycles of 10 ms and more, and without room for queued datagrams, a correction does not wait for the cycle. The
// next reading shows it.
TEST(BusShiftOfLongCycles, ComesIntoSync) {
    struct Case {
        Duration cycle;
        std::int32_t drift_ppb;
        std::uint16_t acyclic_bytes;
    };
    for (const Case& one : {Case{9ms, 10'000, 1498}, {9ms, 10'000, 0}, {10ms, 40'000, 1498}, {20ms, 10'000, 1498}}) {
        SCOPED_TRACE(one.cycle.count());
        ClockBus bus;
        bus.add({.drift_ppb = one.drift_ppb});
        bus.add({.drift_ppb = -30'000, .start_ns = 77});
        bus.start();
        bus.ctx->group(0).config.acyclic_bytes = one.acyclic_bytes;
        ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
        bus.run();
        MasterClock master(
            {.mode = MasterClock::Mode::bus_shift, .set_value = -one.cycle / 2, .phase = {.cycle = one.cycle}});
        std::int64_t most = 0;
        const std::uint64_t lost = bus.ctx->statistics().lost;
        const Time begin = bus.osal.now();
        const auto each = [&](const CycleInfo&) {
            if (bus.osal.now() > begin + 30s) most = std::max(most, std::abs(master.error_ns()));
            return bus.osal.now() < begin + 40s;
        };
        ASSERT_TRUE(run_cycle(*bus.ctx, {.period = one.cycle, .clock = &master}, each).ok());
        EXPECT_EQ(master.state(), PhaseState::in_sync);
        EXPECT_LE(most, 100);
        EXPECT_EQ(bus.ctx->statistics().lost, lost);
    }
}

// The order of the calls in a cycle.
enum class Calls { send_receive_poll, receive_send_poll, receive_poll_send };

struct BusShiftOf : testing::TestWithParam<std::tuple<Calls, Duration>> {
    ClockBus bus;
    Duration cycle = std::get<Duration>(GetParam());
    Time due{};

    void one(MasterClock& master) {
        const Calls calls = std::get<Calls>(GetParam());
        bus.osal.wait(due, -1);
        if (calls == Calls::send_receive_poll) (void)send_processdata(*bus.ctx);
        (void)receive_processdata(*bus.ctx, cycle / 2);
        (void)master.update(*bus.ctx, 0ms);
        if (calls == Calls::receive_send_poll) (void)send_processdata(*bus.ctx);
        (void)poll(*bus.ctx, bus.osal.now());
        if (calls == Calls::receive_poll_send) (void)send_processdata(*bus.ctx);
        due += cycle;
    }
};

// Slave 2 has learned the rate, 600 ppm, at which slave 1 was shifted to its phase. Then slave 2 becomes the reference.
TEST_P(BusShiftOf, ARateThatWasAShiftIsNotKept) {
    bus.add_line(4);
    bus.start();
    ASSERT_TRUE(configdc(*bus.ctx, kFewFrames).ok());
    bus.run();
    const std::uint64_t from = clock_status(*bus.ctx, bus.osal.now()).system_time_ns;
    const auto cycle_ns = static_cast<std::uint64_t>(cycle.count());
    const Duration farthest(static_cast<std::int64_t>((from + cycle_ns / 2) % cycle_ns));
    MasterClock master({.mode = MasterClock::Mode::bus_shift, .set_value = farthest, .phase = {.cycle = cycle}});
    due = bus.osal.now() + cycle;
    const Time earliest = due + cycle * 200;
    for (int n = 0; n < 400 && (due < earliest || std::abs(bus.clock(2).difference_ns) >= 1000); ++n) one(master);
    EXPECT_GT(std::abs(master.error_ns()), cycle.count() / 20) << "it is still being shifted";
    bus.segment.disconnect({0, 0});
    bus.segment.disconnect({0, 1});
    EXPECT_TRUE(bus.segment.connect_master({1, 0}));
    bus.segment.reconsider();
    for (const Time end = due + 12s; due < end;) one(master);
    EXPECT_EQ(reference_clock(*bus.ctx), 2);
    EXPECT_EQ(master.state(), PhaseState::in_sync) << to_text(master.state());
    EXPECT_LE(std::abs(master.drift_ppb()), 120'000);
    for (std::uint16_t s = 3; s <= 4; ++s) EXPECT_TRUE(bus.clock(s).in_sync) << s;
}

INSTANTIATE_TEST_SUITE_P(AllOrders, BusShiftOf,
                         testing::Combine(testing::Values(Calls::send_receive_poll, Calls::receive_send_poll,
                                                          Calls::receive_poll_send),
                                          testing::Values(1ms, 2ms, 5ms)));

TEST(PortTimesThatDiffer, AreOld) {
    PortTimes times;
    times.add({.port_ns = {1000, 1500, 7, 0}}, 0);
    times.add({.port_ns = {501'000, 501'505, 7, 0}}, 0);
    EXPECT_FALSE(times.differ(1)) << "jitter";
    EXPECT_TRUE(times.differ(2)) << "no frame has arrived";
}

}  // namespace
}  // namespace margay
