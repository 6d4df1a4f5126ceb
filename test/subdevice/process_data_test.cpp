// Process data and the three run modes: the time when data are read and applied, and the reaction when process data
// stops.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
namespace reg = wire::reg;

// Outputs: u8, i16, two bits (the second is a gap at the end of the mapping); inputs: u16, i32.
void put_outputs(Bench& bench, int a, int b, int bits) {
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({a, b & 0xFF, b >> 8, bits})));
}

AlStatus refused(AlState state, AlStatusCode code) { return {state, true, static_cast<std::uint16_t>(code)}; }

void bring_to_op(Bench& bench) {
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    put_outputs(bench, 1, 2, 1);
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
}

TEST(ProcessData, InputsAreThereWhenSafeopIs) {
    Bench bench;
    Values::in_a::store(bench.image, 0xBEEF);
    Values::in_b::store(bench.image, -2);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    std::vector<std::byte> inputs(6);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    EXPECT_EQ(inputs, raw({0xEF, 0xBE, 0xFE, 0xFF, 0xFF, 0xFF}));
}

TEST(ProcessData, OutputsInSafeopAreReadButNotApplied) {
    Bench bench;
    (void)bench.request(4);
    put_outputs(bench, 0x55, 0x1234, 1);
    (void)bench.step();
    EXPECT_EQ(bench.esc.events() & wire::al_event::sync_manager(2), 0u) << "read";
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "the initial value";
    EXPECT_FALSE(bench.application.last_valid);
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(Values::out_a::load(bench.image), 0x55) << "OP begins with what came last";
    EXPECT_EQ(Values::out_b::load(bench.image), 0x1234);
    put_outputs(bench, 7, -3, 0);
    (void)bench.step();
    EXPECT_EQ(Values::out_a::load(bench.image), 7);
    EXPECT_EQ(Values::out_b::load(bench.image), -3);
    EXPECT_EQ(Values::bit_a::load(bench.image), 0);
    EXPECT_TRUE(bench.application.last_valid);
}

TEST(ProcessData, OpWaitsForOutputsAndNotForever) {
    Bench bench;
    (void)bench.request(4);
    const auto asked = bench.esc.time;
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.step(), asked + 200ms);
    bench.esc.time = asked + 200ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::no_valid_outputs));
    (void)bench.request(0x18);
    bench.esc.time += 100ms;
    put_outputs(bench, 1, 1, 1);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

TEST(ProcessData, OutputsBeforeAnEarlierOpDoNotCount) {
    Bench bench;
    bring_to_op(bench);
    (void)bench.request(4);
    EXPECT_EQ(bench.request(8).state, AlState::safeop);
}

TEST(ProcessData, SafeValuesWhateverTheWayOutOfOp) {
    const std::uint16_t ways[] = {1, 2, 4};
    for (const auto to : ways) {
        Bench bench;
        bring_to_op(bench);
        EXPECT_EQ(Values::out_a::load(bench.image), 1);
        (void)bench.request(to);
        EXPECT_EQ(Values::out_a::load(bench.image), 9) << to;
        EXPECT_EQ(bench.application.safe, 1u);
    }
}

TEST(ProcessData, TheWatchdogOfTheEscThrowsItOut) {
    Bench bench;
    bring_to_op(bench);
    EXPECT_EQ(bench.step(), bench.esc.time + 100ms) << "0x09C4 times 40 ns times 1000";
    bench.esc.time += 60ms;
    put_outputs(bench, 4, 4, 0);
    EXPECT_EQ(bench.step(), bench.esc.time + 100ms);
    bench.esc.time += 100ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status().state, AlState::op) << "the ESC's word counts";
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    bench.esc.time += 13ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
    EXPECT_EQ(Values::out_a::load(bench.image), 9);
    EXPECT_EQ(bench.application.safe, 1u);
}

TEST(ProcessData, TheWatchdogsEventIsHeardAtOnce) {
    Bench bench;
    bring_to_op(bench);
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    bench.esc.raise(wire::al_event::kWatchdog);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
    EXPECT_EQ(bench.esc.events() & wire::al_event::kWatchdog, 0u);
}

TEST(ProcessData, AWatchdogSwitchedOffNeverBites) {
    Bench bench;
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    bring_to_op(bench);
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    EXPECT_EQ(bench.step(), kNever);
    bench.esc.time += 1h;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
}

TEST(ProcessData, TheDevicesOwnTimeoutBitesWithoutAnEsc) {
    Bench bench;
    bench.application.description_value.output_timeout = 20ms;
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    bring_to_op(bench);
    EXPECT_EQ(bench.step(), bench.esc.time + 20ms);
    bench.esc.time += 20ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
}

TEST(ProcessData, TheApplicationRunsOncePerOutputs) {
    Bench bench;
    bring_to_op(bench);
    const auto before = bench.application.cycles;
    for (int i = 0; i < 10; ++i) {
        put_outputs(bench, i, 0, 0);
        bench.settle();
    }
    EXPECT_EQ(bench.application.cycles, before + 10);
}

TEST(ProcessData, WithoutOutputsItRunsWhenInputsAreFetched) {
    Bench bench;
    ASSERT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 0, 0x64, 0});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_EQ(bench.request(8).state, AlState::op) << "there are no outputs to wait for";
    const auto before = bench.application.cycles;
    std::vector<std::byte> inputs(6);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    bench.settle();
    EXPECT_EQ(bench.application.cycles, before + 1);
}

TEST(ProcessData, FreeRunCallsTheApplicationInBetween) {
    Bench bench;
    bench.application.description_value.free_run_cycle = 5ms;
    (void)bench.request(4);
    const auto before = bench.application.cycles;
    EXPECT_EQ(bench.step(), bench.esc.time + 5ms);
    bench.esc.time += 5ms;
    EXPECT_EQ(bench.step(), bench.esc.time + 5ms);
    EXPECT_EQ(bench.application.cycles, before + 1);
}

TEST(ProcessData, OutputsAreFoundWhereTheMasterLeftTheirEventOff) {
    Bench bench;
    bench.esc.configure(2, {0x1200, 4, 0x44, 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    (void)bench.request(8);
    EXPECT_EQ(bench.step(), bench.esc.time + 1ms);
    bench.esc.ecat_set<std::uint8_t>(0x0815, 1);  // the status octet contains it
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
}

TEST(ProcessData, MappingsThatDoNotFitAreRefusedWithTheirCode) {
    Bench bench;
    // without the checks of the dictionary
    store_le(MutableBytes(bench.image), Values::rx_first::offset, std::uint32_t{0x50000108});
    EXPECT_EQ(bench.request(4), refused(AlState::preop, AlStatusCode::invalid_output_mapping));
    bench.dictionary.restore_defaults();
    store_le(MutableBytes(bench.image), Values::tx_first::offset, std::uint32_t{0x60000108});
    EXPECT_EQ(bench.request(0x14), refused(AlState::preop, AlStatusCode::invalid_input_mapping));
}

// The application needs time for PREOP→SAFEOP. Meanwhile SDOs are served.
TEST(ProcessData, AMappingThatChangesWhileSafeopWaitsIsRefused) {
    static Time ready;
    Bench bench;
    ready = bench.esc.time + 5ms;
    bench.application.transition_hook = [](Transition transition, Time now) {
        return transition.to == AlState::safeop && now < ready ? Verdict::wait(ready) : Verdict::go();
    };
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::preop, false, 0}));
    ASSERT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::none);
    bench.esc.time = ready;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::preop, AlStatusCode::invalid_output_configuration));
    ASSERT_EQ(download(bench, 0x1C12, 0, number(1, 1)).abort, Abort::none);
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}));
}

// --- Distributed clocks ---

class DcTest : public ::testing::Test {
  protected:
    DcTest() {
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    }
    void sync() {
        bench.esc.time += 1ms;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    }
    Bench bench;
};

TEST_F(DcTest, OutputsWithTheirEventApplicationWithSync0) {
    (void)bench.request(4);
    const auto before = bench.application.cycles;
    put_outputs(bench, 3, 3, 0);
    (void)bench.step();
    EXPECT_EQ(bench.application.cycles, before);
    sync();
    EXPECT_EQ(bench.application.cycles, before + 1);
    EXPECT_EQ(bench.esc.events() & wire::al_event::kDcSync0, 0u) << "acknowledged";
}

TEST_F(DcTest, OpWaitsForSync0) {
    (void)bench.request(4);
    put_outputs(bench, 1, 1, 1);
    EXPECT_EQ(bench.request(8).state, AlState::safeop);
    bench.esc.time += 200ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::no_sync_error));
    (void)bench.request(0x18);
    sync();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

// The event of a SYNC0 from an earlier activation was not acknowledged below SAFEOP.
TEST_F(DcTest, AnOldEventOfSync0DoesNotCount) {
    (void)bench.request(2);
    bench.esc.raise(wire::al_event::kDcSync0);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    put_outputs(bench, 1, 1, 1);
    EXPECT_EQ(bench.request(8).state, AlState::safeop) << "waits for the first SYNC0";
}

TEST_F(DcTest, Sync0GoneIsFatal) {
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    (void)bench.request(4);
    put_outputs(bench, 1, 1, 1);
    (void)bench.request(8);
    sync();
    ASSERT_EQ(bench.esc.al_status().state, AlState::op);
    const auto until = bench.step();
    EXPECT_EQ(until, bench.esc.time + 3ms + 1ns);
    bench.esc.time = until;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::fatal_sync_error));
}

TEST_F(DcTest, OutputsThatDoNotKeepUpWithSync0AreASyncError) {
    (void)bench.request(4);
    put_outputs(bench, 1, 1, 1);
    (void)bench.request(8);
    sync();
    for (int i = 0; i < 20; ++i) {
        put_outputs(bench, i, 0, 0);
        (void)bench.step();
        sync();
        sync();  // a single missing event is tolerated
        ASSERT_EQ(bench.esc.al_status().state, AlState::op);
    }
    for (int i = 0; i < 4; ++i) sync();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::synchronization_error));
}

// --- Interrupts ---

class InterruptTest : public ::testing::TestWithParam<RunMode> {
  protected:
    InterruptTest() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
    }
    [[nodiscard]] std::uint32_t mask() const { return bench.esc.get<std::uint32_t>(reg::kAlEventMask.address); }
    Bench bench;
};

TEST_P(InterruptTest, StepLeavesProcessDataToTheInterrupt) {
    (void)bench.request(4);
    const auto before = bench.application.cycles;
    put_outputs(bench, 1, 1, 1);
    (void)bench.step();
    EXPECT_EQ(bench.application.cycles, before);
    (void)bench.device->interrupt(bench.esc.time);
    EXPECT_EQ(bench.application.cycles, before + 1);
    EXPECT_EQ(bench.request(8).state, AlState::op);
    put_outputs(bench, 0x42, 1, 1);
    (void)bench.device->interrupt(bench.esc.time);
    EXPECT_EQ(Values::out_a::load(bench.image), 0x42);
}

TEST_P(InterruptTest, TheMaskAsksForWhatTheModeNeeds) {
    const bool all = GetParam() == RunMode::interrupts;
    const auto background =
        all ? wire::al_event::kAlControl | wire::al_event::kSmActivation | wire::al_event::sync_manager(0) : 0u;
    const auto process_data = wire::al_event::sync_manager(2) | (all ? wire::al_event::kWatchdog : 0u);
    EXPECT_EQ(mask(), background) << "nobody waits for the master to read a reply";
    (void)bench.request(4);
    EXPECT_EQ(mask(), background | process_data | wire::al_event::sync_manager(3)) << "no outputs yet";
    put_outputs(bench, 1, 1, 1);
    (void)bench.device->interrupt(bench.esc.time);
    EXPECT_EQ(mask(), background | process_data) << "the outputs drive the application";
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    (void)bench.step();
    EXPECT_EQ(mask(), background | process_data | (all ? wire::al_event::sync_manager(1) : 0u));
    (void)bench.receive();
    (void)bench.request(2);
    EXPECT_EQ(mask(), background);
}

TEST_P(InterruptTest, TheTransitionThatWaitsForOutputsIsHandedOn) {
    (void)bench.request(4);
    (void)bench.request(8);
    put_outputs(bench, 1, 1, 1);
    EXPECT_NE(bench.device->interrupt(bench.esc.time), 0u);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
}

TEST_P(InterruptTest, WhatIsLeftToStepIsMaskedUntilThen) {
    if (GetParam() == RunMode::mixed) {
        bench.esc.al_control(4);
        EXPECT_EQ(bench.device->interrupt(bench.esc.time), 0u) << "polled";
        return;
    }
    bench.esc.al_control(4);
    EXPECT_EQ(bench.device->interrupt(bench.esc.time), wire::al_event::kAlControl);
    EXPECT_EQ(mask(), 0u);
    (void)bench.step();
    EXPECT_NE(mask() & wire::al_event::kAlControl, 0u);
    EXPECT_EQ(bench.esc.al_status().state, AlState::safeop);
}

INSTANTIATE_TEST_SUITE_P(Modes, InterruptTest, ::testing::Values(RunMode::mixed, RunMode::interrupts));

TEST(DeviceTest, PartsCanBeDrivenByHand) {
    Bench bench;
    bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, RunMode::mixed);
    bench.device->start(bench.esc.time);
    bench.configure(128);
    (void)bench.request(2);
    (void)bench.request(4);
    put_outputs(bench, 1, 1, 1);
    bench.device->process(part::kOutputs, bench.esc.time);
    (void)bench.request(8);
    put_outputs(bench, 0x21, 1, 1);
    const auto before = bench.application.cycles;
    bench.device->process(part::kOutputs, bench.esc.time);
    EXPECT_EQ(Values::out_a::load(bench.image), 0x21);
    EXPECT_EQ(bench.application.cycles, before);
    bench.device->process(part::kApplication, bench.esc.time);
    EXPECT_EQ(bench.application.cycles, before + 1);
    Values::in_a::store(bench.image, 0x7777);
    bench.device->process(part::kInputs, bench.esc.time);
    EXPECT_EQ(bench.esc.get<std::uint16_t>(0x1300), 0x7777);
}

// The timer of the author executes all parts, also while the master sends nothing.
class PartsByHand : public ::testing::Test {
  protected:
    void run(int periods, unsigned parts, bool sync = false) {
        for (int n = 0; n < periods; ++n) {
            bench.esc.time += 1ms;
            bench.device->process(parts, bench.esc.time);
            if (sync) bench.esc.raise(wire::al_event::kDcSync0);
            (void)bench.step();
        }
    }
    Bench bench;
};

TEST_F(PartsByHand, DoNotTakeOutputsThatHaveNotArrived) {
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    (void)bench.request(4);
    const auto before = bench.application.cycles;
    run(3, part::kAll);
    EXPECT_EQ(bench.application.cycles, before + 3) << "the other parts are executed";
    (void)bench.request(8);
    run(200, part::kAll);
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::no_valid_outputs));
    put_outputs(bench, 5, 0, 0);
    bench.device->process(part::kOutputs, bench.esc.time);
    EXPECT_EQ(bench.request(0x18), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(Values::out_a::load(bench.image), 5);
}

TEST_F(PartsByHand, DoNotHideThatFramesAreMissing) {
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    (void)bench.request(4);
    put_outputs(bench, 1, 0, 0);
    (void)bench.request(8);
    run(1, part::kOutputs, true);
    ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    run(6, part::kOutputs, true);
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::synchronization_error));
    EXPECT_EQ(bench.process_data.counters().missed_frames, 4u);
}

TEST_F(PartsByHand, DoNotHideThatOutputsAreTooOld) {
    bench.application.description_value.output_timeout = 50ms;
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    bring_to_op(bench);
    run(49, part::kOutputs);
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
    run(1, part::kOutputs);
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
}

TEST_F(PartsByHand, DoNotMakeOldOutputsNew) {
    bench.application.description_value.output_timeout = 50ms;
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    (void)bench.request(4);
    put_outputs(bench, 1, 0, 0);
    run(60, part::kOutputs);
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0}));
}

TEST(DeviceTest, ARestartOfTheFirmwareEndsEverything) {
    Bench bench;
    bring_to_op(bench);
    bench.device->start(bench.esc.time);
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::init, false, 0}));
    EXPECT_EQ(bench.application.safe, 1u);
    EXPECT_TRUE(bench.esc.locked(0));
    EXPECT_FALSE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 4}))) << "outputs are locked out";
}

}  // namespace
}  // namespace margay::subdevice
