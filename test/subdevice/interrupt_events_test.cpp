// Events that interrupt() must not see again: events that no function can serve now are masked, and events for step()
// stay active.
#include "interrupted.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

// ------------------------------------------------------------------ events that no function can serve now

TEST(EventStorm, AFullMailboxOfAMasterThatDoesNotReadKeepsTheLineQuiet) {
    Interrupted rig(RunMode::interrupts);
    int sent = 0;
    while (rig.hand.put(rig.hand.message(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)))) {
        rig.run();  // fails when the line stays active
        ASSERT_LT(++sent, 20);
    }
    EXPECT_TRUE(rig.esc.full(0)) << "the last message stays in the mailbox";
    for (; sent > 0; --sent) {
        ASSERT_FALSE(rig.hand.fetch().empty()) << sent;
        ASSERT_TRUE(rig.line()) << "the device must hear that a slot is free";
        rig.run();
    }
    EXPECT_FALSE(rig.esc.full(0));
}

TEST(EventStorm, AReplyThatWasReadLastKeepsTheLineQuiet) {
    Interrupted rig(RunMode::interrupts);
    EXPECT_FALSE(rig.exchange(sdo_request(0x40, 0x1000, 0)).empty());
    EXPECT_NE(rig.esc.events() & wire::al_event::sync_manager(1), 0u) << "active until the next reply is written";
    EXPECT_FALSE(rig.line());
}

TEST(EventStorm, InputsThatTheMasterReadsBesideOutputsKeepTheLineQuiet) {
    for (const auto mode : {RunMode::mixed, RunMode::interrupts}) {
        Interrupted rig(mode);
        ASSERT_EQ(rig.request(4).state, AlState::safeop);
        rig.put_outputs(1);
        rig.run();
        std::vector<std::byte> inputs(6);
        ASSERT_TRUE(rig.esc.ecat_read(0x1300, inputs));
        rig.run();
        EXPECT_FALSE(rig.line());
    }
}

// ------------------------------------------------------------------ events that an update must leave

// interrupt() reads the watchdog settings of the SyncManagers. The event of their change is for step().
TEST(ChangedSyncManagers, AreNoticedAfterAnInterruptThatReadsTheirSettings) {
    Interrupted rig(RunMode::interrupts);
    rig.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    rig.esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(rig.request(4).state, AlState::safeop);
    rig.put_outputs(5);
    rig.run();
    ASSERT_EQ(rig.request(8).state, AlState::safeop) << "it waits for SYNC0";
    rig.esc.configure(2, {0x1200, 4, 0x64, 0});
    (void)rig.device.interrupt(rig.esc.time);
    (void)rig.device.step(rig.esc.time);
    const AlStatus wrong{AlState::preop, true, static_cast<std::uint16_t>(AlStatusCode::invalid_output_configuration)};
    EXPECT_EQ(rig.esc.al_status(), wrong);
    rig.esc.raise(wire::al_event::kDcSync0);
    rig.run();
    EXPECT_EQ(rig.esc.al_status(), wrong);
    EXPECT_EQ(rig.application.safe, 0u);
}

TEST(ChangedSyncManagers, AreNoticedInOpWithOneOctetOfOutputs) {
    Bench bench;
    bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr,
                         RunMode::interrupts);
    bench.device->start(bench.esc.time);
    bench.configure(128);
    (void)bench.request(2);
    ASSERT_EQ(download(bench, 0x1600, 0, raw({0})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1600, 1, raw({8, 1, 0, 0x70})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1600, 0, raw({1})).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 1, 0x64, 1});
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    bench.esc.time += 2ms;
    (void)bench.step();
    (void)bench.request(8);
    ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    bench.esc.time += 2ms;
    bench.esc.configure(2, {0x1200, 1, 0x64, 0});
    (void)bench.device->interrupt(bench.esc.time);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, true, 0x001D}));
}

// The change comes while PREOP→SAFEOP is executed: after the checks, and before the process data start.
TEST(ChangedSyncManagers, AreNoticedWhenTheyChangeDuringTheTransition) {
    static Bench* at_work = nullptr;
    Bench bench;
    at_work = &bench;
    bench.application.transition_hook = [](Transition transition, Time) {
        if (transition.to == AlState::safeop) at_work->esc.configure(2, {0x1200, 4, 0x64, 0});
        return Verdict::go();
    };
    EXPECT_EQ(bench.request(4).state, AlState::safeop);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, true, 0x001D}));
}

}  // namespace
}  // namespace margay::subdevice
