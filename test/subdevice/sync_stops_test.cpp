// A SYNC0 that stops, or that was active before SAFEOP. Neither of them leads to OP, and inputs stay present without
// SYNC0.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
namespace reg = wire::reg;

AlStatus refused_by_sync(AlState state, AlStatusCode code) { return {state, true, static_cast<std::uint16_t>(code)}; }

unsigned asked_for_op = 0;  // number of calls of the application for SAFEOP→OP

Verdict count_op(Transition transition, Time) {
    asked_for_op += transition == Transition{AlState::safeop, AlState::op} ? 1 : 0;
    return Verdict::go();
}

class SyncStops : public ::testing::TestWithParam<RunMode> {
  protected:
    SyncStops() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
        bench.esc.ecat_set<std::uint16_t>(0x0420, 0);  // only SYNC0 is monitored
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
        bench.application.transition_hook = count_op;
        asked_for_op = 0;
    }
    [[nodiscard]] bool line() const {
        return (bench.esc.events() & bench.esc.get<std::uint32_t>(reg::kAlEventMask.address)) != 0;
    }
    Time run() {
        if (GetParam() != RunMode::polling && line()) (void)bench.device->interrupt(bench.esc.time);
        return bench.step();
    }
    AlStatus request(std::uint16_t control) {
        bench.esc.al_control(control);
        (void)run();
        return bench.esc.al_status();
    }
    void put_outputs(int value) {
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({value, 0, 0, 0})));
        (void)run();
    }
    void sync(Duration after = 1ms) {
        bench.esc.time += after;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)run();
    }
    // Frames with outputs each millisecond, and no SYNC0.
    void frames(int count, int value) {
        for (int n = 0; n < count; ++n) {
            bench.esc.time += 1ms;
            put_outputs(value);
        }
    }
    void bring_to_op() {
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        put_outputs(1);
        sync();
        ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
    }
    Bench bench;
};

TEST_P(SyncStops, AMasterThatAsksForOpAgainDoesNotGetItWithoutANewSync0) {
    bring_to_op();
    frames(6, 50);
    ASSERT_EQ(bench.esc.al_status(), refused_by_sync(AlState::safeop, AlStatusCode::fatal_sync_error));
    asked_for_op = 0;
    for (int n = 0; n < 3; ++n) {
        EXPECT_EQ(request(0x14), (AlStatus{AlState::safeop, false, 0}));
        EXPECT_EQ(request(8), (AlStatus{AlState::safeop, false, 0})) << "the device waits for SYNC0";
        frames(201, 60 + n);
        EXPECT_EQ(bench.esc.al_status(), refused_by_sync(AlState::safeop, AlStatusCode::no_sync_error));
    }
    EXPECT_EQ(asked_for_op, 0u);
    EXPECT_EQ(bench.application.safe, 1u) << "it was never in OP again";
    EXPECT_EQ(Values::out_a::load(bench.image), 9);
    (void)request(0x14);
    (void)request(8);
    sync();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(Values::out_a::load(bench.image), 62);
}

TEST_P(SyncStops, Sync0OfLongAgoDoesNotLeadToOp) {
    ASSERT_EQ(request(4).state, AlState::safeop);
    sync();
    put_outputs(1);
    bench.esc.time += 10s;  // without any step
    EXPECT_EQ(request(8), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(asked_for_op, 0u);
    sync();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

TEST_P(SyncStops, InputsAreAsPresentAsBeforeTheFirstSync0) {
    ASSERT_EQ(request(4).state, AlState::safeop);
    sync();
    sync();
    const auto lost = bench.esc.time + 3ms + 1ns;
    EXPECT_EQ(run(), lost) << "the time at which SYNC0 counts as lost";
    bench.esc.time = lost;
    (void)run();
    std::vector<std::byte> inputs(6);
    for (int n = 0; n < 10; ++n) {
        bench.esc.time += 10ms;
        Values::in_a::store(bench.image, static_cast<std::uint16_t>(100 + n));
        ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
        (void)run();
        ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
        EXPECT_EQ(load_le<std::uint16_t>(inputs), 100 + n);
    }
}

TEST_P(SyncStops, InputsThatRaiseNoEventsAreUpdatedEachMillisecond) {
    bench.esc.configure(3, {0x1300, 6, 0x00, 1});
    ASSERT_EQ(request(4).state, AlState::safeop);
    sync();
    bench.esc.time += 3ms + 1ns;
    EXPECT_EQ(run(), bench.esc.time + 1ms);
    const auto before = bench.application.cycles;
    for (int n = 0; n < 10; ++n) {
        bench.esc.time += 1ms;
        (void)run();
    }
    EXPECT_EQ(bench.application.cycles, before + 10);
}

TEST_P(SyncStops, TheStepThatLeavesOpAsksForNoOther) {
    bring_to_op();
    bench.esc.time += 3ms + 1ns;
    EXPECT_EQ(run(), kNever);
    EXPECT_EQ(bench.esc.al_status(), refused_by_sync(AlState::safeop, AlStatusCode::fatal_sync_error));
}

// The cyclic function must not be executed in OP by the SYNC0 cycle and also by the reads of the master.
TEST_P(SyncStops, Sync0DrivesAgainWhenItComesBack) {
    ASSERT_EQ(request(4).state, AlState::safeop);
    sync();
    bench.esc.time += 20ms;
    (void)run();
    sync();
    const auto before = bench.application.cycles;
    std::vector<std::byte> inputs(6);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    (void)run();
    EXPECT_EQ(bench.application.cycles, before);
    sync();
    EXPECT_EQ(bench.application.cycles, before + 1);
}

TEST_P(SyncStops, MissedSync0AreCountedAlsoWhenTheyCountedAsLost) {
    ASSERT_EQ(request(4).state, AlState::safeop);
    for (int n = 0; n < 3; ++n) sync();
    bench.esc.time += 3ms + 1ns;
    (void)run();
    sync(2ms - 1ns);
    EXPECT_EQ(bench.process_data.counters().missed_syncs, 4u);
}

TEST_P(SyncStops, TheControlLoopOfADriveLocksAgain) {
    bench.application.description_value.dc.pll = true;
    ASSERT_EQ(request(4).state, AlState::safeop);
    const auto period = [&](int n) {
        bench.esc.time += 500us;
        put_outputs(n);
        sync(500us);
    };
    for (int n = 0; n < 8; ++n) period(n);
    bench.esc.time += 10s;
    period(20);  // the first SYNC0 after the silence
    EXPECT_EQ(request(8), (AlStatus{AlState::safeop, false, 0})) << "one period does not lock it";
    EXPECT_EQ(asked_for_op, 0u);
    for (int n = 0; n < 4; ++n) period(n);
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

// A master that was started again: a SYNC0 from before the start still waits, and the new start time is in the future.
TEST_P(SyncStops, SyncSignalsFromBeforeSafeopDoNotCount) {
    bench.application.description_value.dc.sync1 = true;
    bench.esc.ecat_set<std::uint8_t>(0x0981, 7);
    bench.esc.raise(wire::al_event::kDcSync0 | wire::al_event::kDcSync1);
    bench.esc.time += 10s;
    (void)run();
    const auto before = bench.application.cycles;
    ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    (void)run();
    EXPECT_EQ(bench.application.cycles, before + 1) << "the first inputs";
    EXPECT_EQ(bench.application.syncs1, 0u);
    put_outputs(7);
    EXPECT_EQ(request(8), (AlStatus{AlState::safeop, false, 0}));
    bench.esc.time += 200ms;
    (void)run();
    EXPECT_EQ(bench.esc.al_status(), refused_by_sync(AlState::safeop, AlStatusCode::no_sync_error));
    EXPECT_EQ(asked_for_op, 0u);
    (void)request(0x18);
    sync();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

INSTANTIATE_TEST_SUITE_P(Modes, SyncStops, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

}  // namespace
}  // namespace margay::subdevice
