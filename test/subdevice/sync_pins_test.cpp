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

TEST_P(SyncPins, Sync1CallsTheApplication) {
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 0u) << "no process data in PREOP";
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 1u);
}

// The master switches the signals on in PREOP. Without an acknowledge, a handler of a level is called for ever.
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
