// Objects 0x1C32 and 0x1C33 with their counters and measured times, and the timestamp object 0x10F8.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

class MeasuredTimes : public ::testing::Test {
  protected:
    std::uint64_t read(int index, int subindex) {
        const auto got = upload(bench, index, subindex);
        EXPECT_EQ(got.abort, Abort::none) << std::hex << index << ":" << subindex;
        return got.number();
    }
    void begin_measurement(int value) { ASSERT_EQ(download(bench, 0x1C32, 8, raw({value, 0})).abort, Abort::none); }
    void update(Duration work, Duration copying) {
        bench.application.work = work;
        bench.application.copying = copying;
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0})));
        (void)bench.step();
    }
    Bench bench;
};

TEST_F(MeasuredTimes, TheLongestTimesOfAMeasurementAreKept) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    update(9us, 3us);
    EXPECT_EQ(read(0x1C32, 6), 0U) << "nobody has asked for a measurement";
    begin_measurement(1);
    update(20us, 4us);
    update(15us, 6us);
    EXPECT_EQ(read(0x1C32, 6), 20'000U);
    EXPECT_EQ(read(0x1C33, 6), 6'000U);
    EXPECT_EQ(read(0x1C33, 8), 1U) << "one command for both";
    begin_measurement(0);
    update(90us, 90us);
    EXPECT_EQ(read(0x1C32, 6), 20'000U) << "the result stays when the measurement is over";
    begin_measurement(1);
    update(2us, 1us);
    EXPECT_EQ(read(0x1C32, 6), 2'000U) << "a new measurement begins at zero";
    EXPECT_EQ(read(0x1C33, 6), 1'000U);
    EXPECT_EQ(download(bench, 0x1C32, 8, raw({2, 0})).abort, Abort::value_too_high);
    EXPECT_EQ(download(bench, 0x1C32, 6, raw({0, 0, 0, 0})).abort, Abort::read_only);
}

TEST_F(MeasuredTimes, UpdatesThatTakeLongerThanTheSyncCycleAreCounted) {
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    for (const Duration work : {900'000ns, 1'000'001ns, 5'000'000ns}) {
        bench.application.work = work;
        bench.esc.time += 1ms;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    }
    EXPECT_EQ(read(0x1C32, 0x0C), 2U);
}

TEST_F(MeasuredTimes, TheSyncErrorIsShownUntilTheNextOp) {
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    const auto sync = [&] {
        bench.esc.time += 1ms;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    };
    const auto to_op = [&](std::uint16_t al_control) {
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0})));
        (void)bench.request(al_control);
        sync();
        ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    };
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    to_op(8);
    EXPECT_EQ(read(0x1C32, 0x20), 0U);
    for (int n = 0; n < 6; ++n) sync();
    ASSERT_EQ(bench.esc.al_status().code, static_cast<std::uint16_t>(AlStatusCode::synchronization_error));
    EXPECT_EQ(read(0x1C32, 0x20), 1U);
    (void)bench.request(0x14);
    EXPECT_EQ(read(0x1C32, 0x20), 1U) << "the acknowledge keeps it for the master";
    to_op(8);
    EXPECT_EQ(read(0x1C32, 0x20), 0U);
}

TEST_F(MeasuredTimes, TheSync0CycleInUseIsShown) {
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(read(0x1C32, 0x0A), 0U) << "SYNC0 is off";
    (void)bench.request(2);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(read(0x1C32, 0x0A), 1'000'000U);
    EXPECT_EQ(read(0x1C33, 0x0A), 1'000'000U);
}

TEST_F(MeasuredTimes, InputsShowTheCountersOfTheDevice) {
    using Sync = SyncValues<Values::sync>;
    Sync::missed_frames::store(bench.image, 0x0102);
    Sync::cycle_exceeded::store(bench.image, 0x0304);
    Sync::sync_error::store(bench.image, 1);
    for (const int index : {0x1C32, 0x1C33}) {
        EXPECT_EQ(read(index, 0x0B), 0x0102U);
        EXPECT_EQ(read(index, 0x0C), 0x0304U);
        EXPECT_EQ(read(index, 0x20), 1U);
    }
}

TEST_F(MeasuredTimes, TimesOfTheHardwareAreThoseOfTheDescription) {
    EXPECT_EQ(read(0x10F1, 1), 3U);
    EXPECT_EQ(upload(bench, 0x10F1, 1).data.size(), 4U);
    EXPECT_EQ(read(0x1C32, 3), 50'000U);
    EXPECT_EQ(read(0x1C32, 7), 2'000U);
    EXPECT_EQ(read(0x1C32, 9), 7'000U);
    EXPECT_EQ(read(0x1C33, 3), 11'000U);
    EXPECT_EQ(read(0x1C33, 7), 0U);
    EXPECT_EQ(read(0x1C33, 9), 1'000U);
    EXPECT_EQ(download(bench, 0x1C32, 3, raw({1, 0, 0, 0})).abort, Abort::read_only);
    EXPECT_EQ(upload(bench, 0x1C33, 0, true).abort, Abort::none);
}

// With a shift time, the outputs must be used within it after SYNC0.
TEST_F(MeasuredTimes, OutputsThatAreUsedAfterTheShiftTimeAreCounted) {
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    const auto sync = [&](Duration work) {
        bench.application.work = work;
        bench.esc.time += 1ms;
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0})));
        (void)bench.step();
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    };
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    sync(60us);
    EXPECT_EQ(read(0x1C32, 0x0D), 0U) << "no outputs are used in SAFEOP";
    (void)bench.request(8);
    ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    sync(50us);
    EXPECT_EQ(read(0x1C32, 0x0D), 0U);
    sync(51us);
    sync(900us);
    EXPECT_EQ(read(0x1C32, 0x0D), 2U);
    EXPECT_EQ(read(0x1C33, 0x0D), 2U) << "one counter for the device";
    EXPECT_EQ(read(0x1C32, 0x0C), 0U) << "the cycle was not exceeded";
    bench.application.description_value.output_times.shift = {};
    sync(900us);
    EXPECT_EQ(read(0x1C32, 0x0D), 2U) << "without a shift time nothing is counted";
}

TEST_F(MeasuredTimes, TheTimestampIsTheTimeOfTheDevice) {
    bench.esc.time = Time{} + 5s;
    EXPECT_EQ(read(0x10F8, 0), 5'000'001'000U);
    // When the object is mapped, its value is the time of the copy of the inputs.
    ASSERT_EQ(download(bench, 0x1A00, 0, raw({0})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 1, raw({0x40, 0x00, 0xF8, 0x10})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 0, raw({1})).abort, Abort::none);
    bench.esc.configure(3, {0x1300, 8, 0x20, 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.esc.time += 7ns;
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0})));
    (void)bench.step();
    std::vector<std::byte> inputs(8);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    EXPECT_EQ(load_le<std::uint64_t>(inputs), 5'000'001'007U);
}

// Without any event, the steps are frequent enough for the PDI watchdog.
TEST_F(MeasuredTimes, StepsFeedThePdiWatchdog) {
    EXPECT_EQ(bench.step(), kNever);
    bench.application.description_value.pdi_watchdog = 20ms;
    EXPECT_EQ(bench.step(), bench.esc.time + 20ms);
}

TEST(SyncObjects, TheMasterSetsTheLimitAndTheCycleTime) {
    Bench bench;
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 200'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    EXPECT_EQ(upload(bench, 0x10F1, 2).number(), 4u) << "the description's limit";
    ASSERT_EQ(download(bench, 0x10F1, 2, number(1, 2)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1C32, 2, number(1'000'000, 4)).abort, Abort::none);
    const auto sync = [&] {
        bench.esc.time += 200us;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    };
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(bench.process_data.syncs_per_frame(), 5u);
    EXPECT_EQ(download(bench, 0x10F1, 2, number(9, 2)).abort, Abort::device_state);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    (void)bench.request(8);
    sync();
    ASSERT_EQ(bench.esc.al_status().state, AlState::op);
    for (int n = 0; n < 20; ++n) {
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
        (void)bench.step();
        for (int k = 0; k < 5; ++k) sync();
    }
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
    EXPECT_EQ(upload(bench, 0x1C32, 0x0B).number(), 0u);
    for (int n = 0; n < 5; ++n) sync();
    EXPECT_EQ(bench.esc.al_status().code, static_cast<std::uint16_t>(AlStatusCode::synchronization_error));
    EXPECT_EQ(upload(bench, 0x1C32, 0x0B).number(), 1u);
    EXPECT_EQ(upload(bench, 0x1C32, 0x20).number(), 1u);
    EXPECT_EQ(upload(bench, 0x1C33, 4).number(), 6u) << "SM event, DC SYNC0";
}

}  // namespace
}  // namespace margay::subdevice
