// SYNC signals at pins of the processor, and their registers in the SII.
#include "bench_device.hpp"

#include "subdevice/sii_image.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

class SyncPins : public ::testing::TestWithParam<RunMode> {
  protected:
    SyncPins() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    }
    void sync(Duration after = 1ms) {
        bench.esc.time += after;
        bench.device->sync0(bench.esc.time);
        (void)bench.step();
    }
    Bench bench;
};

TEST_P(SyncPins, Sync0RunsTheApplicationWithTheOutputsThatHaveArrived) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    const auto before = bench.application.cycles;
    sync();
    EXPECT_EQ(bench.application.cycles, before + 1);
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0x42, 2, 0, 1})));
    sync();
    EXPECT_EQ(Values::out_a::load(bench.image), 0x42);
    EXPECT_EQ(bench.application.cycles, before + 2);
    EXPECT_TRUE(bench.application.last_valid);
    bench.esc.raise(wire::al_event::kDcSync0);  // the signal is also mapped as an event
    (void)bench.device->interrupt(bench.esc.time);
    (void)bench.step();
    EXPECT_EQ(bench.application.cycles, before + 2) << "not twice";
    EXPECT_EQ(bench.esc.get<std::uint32_t>(0x0204) & wire::al_event::kDcSync0, 0u);
}

TEST_P(SyncPins, MissedSync0AreCounted) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    for (int n = 0; n < 5; ++n) sync();
    sync(1100us);
    EXPECT_EQ(bench.process_data.counters().missed_syncs, 0u) << "jitter";
    sync(4ms);
    EXPECT_EQ(bench.process_data.counters().missed_syncs, 3u);
    sync(10s);
    EXPECT_NE(bench.process_data.counters().missed_syncs, 3u);
}

TEST_P(SyncPins, LateSync0AreNotMissed) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    const auto missed = [&] { return bench.process_data.counters().missed_syncs; };
    const Time begin = bench.esc.time;
    const auto serve_at = [&](Duration time) { sync(begin + time - bench.esc.time); };
    serve_at(1600us);  // the first call is late
    for (int n = 2; n < 40; ++n) serve_at(n * 1ms + (n % 3 == 0 ? 850us : n % 5 == 0 ? 300us : 0us));
    EXPECT_EQ(missed(), 0u);
    serve_at(42ms);
    EXPECT_EQ(missed(), 2u);
    serve_at(44ms + 700us);
    EXPECT_EQ(missed(), 3u) << "one is missed, and the next one is late";
    for (int n = 45; n < 60; ++n) serve_at(n * 1ms);
    EXPECT_EQ(missed(), 3u);
}

// The clock of the processor and the clock of the ESC differ.
TEST_P(SyncPins, DriftIsNoMissedSync0) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    for (const Duration cycle : {1'000'500ns, 999'500ns}) {
        const auto before = bench.process_data.counters().missed_syncs;
        for (int n = 0; n < 5000; ++n) sync(cycle);
        EXPECT_EQ(bench.process_data.counters().missed_syncs, before);
        sync(3 * cycle);
        EXPECT_EQ(bench.process_data.counters().missed_syncs, before + 2);
    }
}

// A device without outputs has no event except SYNC0 while OP waits for SYNC0.
TEST(SyncPinWakes, TheTaskOfADeviceWithoutOutputs) {
    Bench bench;
    bench.application.description_value.outputs = {};
    bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr,
                         RunMode::interrupts);
    bench.device->start(bench.esc.time);
    Values::rx_assign_count::store(bench.image, 0);
    SyncValues<Values::sync>::input_type::store(bench.image, sync_type::kDcSync0);
    bench.configure(128);
    bench.esc.configure(2, {});
    ASSERT_EQ(bench.request(2).state, AlState::preop);
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    const auto sync = [&] { return bench.device->sync0(bench.esc.time += 1ms); };
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_NE(sync(), 0u) << "from now on SYNC0 has a deadline";
    EXPECT_EQ(bench.step(), bench.esc.time + 3ms + 1ns);
    EXPECT_EQ(sync(), 0u);
    bench.esc.time += 100ms;
    (void)bench.step();  // SYNC0 has stopped
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0})) << "it waits for SYNC0";
    EXPECT_NE(sync(), 0u);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(sync(), 0u);
}

TEST_P(SyncPins, Sync1CallsTheApplication) {
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 0u) << "no process data in PREOP";
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 1u);
}

// The master switches the signals on in PREOP. Without an acknowledge, a handler of a level-triggered interrupt would
// be called for ever.
TEST_P(SyncPins, SignalsBeforeSafeopAreAcknowledged) {
    bench.esc.raise(wire::al_event::kDcSync0 | wire::al_event::kDcSync1);
    bench.device->sync0(bench.esc.time);
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.esc.events() & (wire::al_event::kDcSync0 | wire::al_event::kDcSync1), 0u);
}

TEST_P(SyncPins, Sync1AsAnEventCallsTheApplication) {
    bench.application.description_value.dc.sync1 = true;
    bench.esc.ecat_set<std::uint8_t>(0x0981, 7);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.esc.raise(wire::al_event::kDcSync1);
    if (GetParam() == RunMode::polling) {
        (void)bench.step();
    } else {
        EXPECT_NE(bench.esc.get<std::uint32_t>(0x0204) & wire::al_event::kDcSync1, 0u);
        (void)bench.device->interrupt(bench.esc.time);
    }
    EXPECT_EQ(bench.application.syncs1, 1u);
}

INSTANTIATE_TEST_SUITE_P(Modes, SyncPins, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

TEST(SyncSii, MapsTheSignalsThatTheDeviceNeeds) {
    Bench bench;
    auto& d = bench.application.description_value;
    const auto octet = [&](const BoardDescription& board) {
        std::array<std::byte, 2048> eeprom{};
        SiiWorkspace<8, 32> workspace;
        EXPECT_TRUE(write_sii(d, board, bench.dictionary, workspace, eeprom).ok());
        return std::to_integer<unsigned>(eeprom[3]);
    };
    EXPECT_EQ(octet({}), 0x0Cu) << "SYNC0 is an output and an AL event";
    d.dc.sync1 = true;
    EXPECT_EQ(octet({}), 0xCCu);
    EXPECT_EQ(octet({.sync0 = SyncPin{.output = true}, .sync1 = SyncPin{.output = true, .active_high = true}}), 0x64u);
    d.dc = {};
    EXPECT_EQ(octet({}), 0x00u) << "latch inputs";
}

}  // namespace
}  // namespace margay::subdevice
