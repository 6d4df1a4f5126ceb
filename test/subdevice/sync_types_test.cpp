// The synchronization type, subindex 1 of objects 0x1C32 and 0x1C33: the values that a master may write, the mode that
// follows, and the values of the objects.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

AlStatus refused(AlStatusCode code) { return {AlState::preop, true, static_cast<std::uint16_t>(code)}; }

class SyncTypes : public ::testing::Test {
  protected:
    DeviceDescription& description() { return bench.application.description_value; }
    std::uint64_t type(int index) { return upload(bench, index, 1).number(); }
    Abort write(int index, unsigned value) { return download(bench, index, 1, number(value, 2)).abort; }
    void activate_sync0() {
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    }
    // The accepted types, out of all possible values.
    std::vector<unsigned> accepted(int index) {
        std::vector<unsigned> found;
        for (unsigned value = 0; value < 0x100; ++value) {
            const auto before = type(index);
            const auto answer = write(index, value);
            if (answer == Abort::none)
                found.push_back(value);
            else
                EXPECT_EQ(answer, Abort::value_range) << value;
            EXPECT_EQ(type(index), answer == Abort::none ? value : before);
        }
        EXPECT_EQ(write(index, 0xFFFF), Abort::value_range);
        EXPECT_EQ(write(index, 0x0102), Abort::value_range);
        return found;
    }
    Bench bench;
};

TEST_F(SyncTypes, TheInitialTypesAreThoseOfTheDevice) {
    EXPECT_EQ(type(0x1C32), 1u) << "SM event";
    EXPECT_EQ(type(0x1C33), 0x22u) << "the event of SM2";
    constexpr DeviceDescription kInputsOnly{.inputs = {.sync_manager = 3, .start = 0x1300, .max_bytes = 4}};
    EXPECT_EQ(sync_input_entries<0>(kInputsOnly)[1].initial(), 1u);
    constexpr DeviceDescription kNeedsDc{.outputs = {.sync_manager = 2, .start = 0x1200, .max_bytes = 4},
                                         .dc = {.supported = true, .required = true}};
    EXPECT_EQ(sync_output_entries<0>(kNeedsDc)[1].initial(), 2u);
    EXPECT_EQ(sync_input_entries<0>(kNeedsDc)[1].initial(), 2u);
}

TEST_F(SyncTypes, OnlyTypesOfTheDeviceAreAccepted) {
    using Types = std::vector<unsigned>;
    EXPECT_EQ(accepted(0x1C32), (Types{1, 2}));
    EXPECT_EQ(accepted(0x1C33), (Types{1, 2, 0x22}));
    description().free_run_cycle = 5ms;
    description().dc.supported = false;
    EXPECT_EQ(accepted(0x1C32), (Types{0, 1}));
    EXPECT_EQ(accepted(0x1C33), (Types{0, 1, 0x22}));
    description().dc = {.supported = true, .required = true};
    EXPECT_EQ(accepted(0x1C32), (Types{2}));
}

TEST_F(SyncTypes, CompleteAccessIsCheckedToo) {
    auto all = upload(bench, 0x1C32, 0, true).data;
    ASSERT_GT(all.size(), 4u);
    all[2] = std::byte{0x34};  // behind subindex 0 and its gap
    EXPECT_EQ(download(bench, 0x1C32, 0, all, true).abort, Abort::value_range);
    all[2] = std::byte{2};
    EXPECT_EQ(download(bench, 0x1C32, 0, all, true).abort, Abort::none);
    EXPECT_EQ(type(0x1C32), 2u);
    all[2] = std::byte{0x34};
    all.erase(all.begin(), all.begin() + 2);
    EXPECT_EQ(download(bench, 0x1C32, 1, all, true).abort, Abort::value_range);
    EXPECT_EQ(type(0x1C32), 2u);
}

TEST_F(SyncTypes, TheObjectsShowTheModeInUse) {
    activate_sync0();
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0})) << "a master need not write the type";
    EXPECT_EQ(bench.process_data.mode(), SyncMode::dc_sync0);
    EXPECT_EQ(type(0x1C32), 2u);
    EXPECT_EQ(type(0x1C33), 2u);
    EXPECT_EQ(write(0x1C32, 1), Abort::device_state);
    ASSERT_EQ(bench.request(2).state, AlState::preop);
    EXPECT_EQ(type(0x1C32), 1u) << "what was there before";
    EXPECT_EQ(type(0x1C33), 0x22u);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 0);
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(type(0x1C32), 1u);
    EXPECT_EQ(type(0x1C33), 0x22u);
}

TEST_F(SyncTypes, InputsWithoutOutputsFollowTheirOwnEvent) {
    ASSERT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 0, 0x64, 0});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(type(0x1C33), 1u);
    bench.device->start(bench.esc.time);
    EXPECT_EQ(SyncValues<Values::sync>::input_type::load(bench.image), 0x22u) << "also after a restart of the firmware";
}

TEST_F(SyncTypes, DcWithoutSync0IsRefused) {
    ASSERT_EQ(write(0x1C32, 2), Abort::none);
    EXPECT_EQ(bench.request(4), refused(AlStatusCode::invalid_dc_sync_configuration));
    activate_sync0();
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_EQ(bench.request(2).state, AlState::preop);
    ASSERT_EQ(write(0x1C32, 1), Abort::none);
    ASSERT_EQ(write(0x1C33, 2), Abort::none);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 0);
    EXPECT_EQ(bench.request(4), refused(AlStatusCode::invalid_dc_sync_configuration));
}

// The application runs each free run cycle, and outputs do not start it.
TEST_F(SyncTypes, FreeRun) {
    description().free_run_cycle = 5ms;
    ASSERT_EQ(write(0x1C32, 0), Abort::none);
    ASSERT_EQ(write(0x1C33, 0), Abort::none);
    activate_sync0();
    EXPECT_EQ(bench.request(4), refused(AlStatusCode::invalid_dc_sync_configuration)) << "SYNC0 and free run";
    bench.esc.ecat_set<std::uint8_t>(0x0981, 0);
    ASSERT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.process_data.mode(), SyncMode::free_run);
    EXPECT_EQ(type(0x1C32), 0u);
    EXPECT_EQ(type(0x1C33), 0u);
    const auto before = bench.application.cycles;
    std::vector<std::byte> inputs(6);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    (void)bench.step();
    EXPECT_EQ(bench.application.cycles, before) << "the reads of the master do not start it";
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 0, 0, 0})));
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    for (int n = 0; n < 50; ++n) {
        bench.esc.time += 1ms;
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({n, 0, 0, 0})));
        (void)bench.step();
        EXPECT_EQ(Values::out_a::load(bench.image), n) << "outputs are there for the next cycle";
    }
    EXPECT_EQ(bench.application.cycles, before + 10);
}

// A firmware that sets the values itself.
TEST_F(SyncTypes, TypesThatTheDeviceDoesNotSupportRefuseSafeop) {
    using V = SyncValues<Values::sync>;
    V::output_type::store(bench.image, 0);
    EXPECT_EQ(bench.request(4), refused(AlStatusCode::free_run_not_supported));
    V::output_type::store(bench.image, 3);
    EXPECT_EQ(bench.request(0x14), refused(AlStatusCode::sync_mode_not_supported));
    V::output_type::store(bench.image, 1);
    V::input_type::store(bench.image, 3);
    EXPECT_EQ(bench.request(0x14), refused(AlStatusCode::sync_mode_not_supported));
    description().free_run_cycle = 5ms;
    V::input_type::store(bench.image, 0);
    EXPECT_EQ(bench.request(0x14), refused(AlStatusCode::sync_mode_not_supported)) << "inputs alone cannot run free";
    V::input_type::store(bench.image, 1);
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}));
}

}  // namespace
}  // namespace margay::subdevice
