// The accesses to the ESC in a step without work. On a board each access is a transfer on the SPI.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

class IdleSteps : public ::testing::TestWithParam<RunMode> {
  protected:
    IdleSteps() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
    }
    // Returns the accesses of one step, after earlier steps have done all pending work.
    std::uint64_t idle() {
        bench.settle();
        const auto before = bench.esc.accesses;
        (void)bench.step();
        return bench.esc.accesses - before;
    }
    void serve() {
        if (GetParam() != RunMode::polling) (void)bench.device->interrupt(bench.esc.time);
        bench.settle();
    }
    Bench bench;
};

TEST_P(IdleSteps, ReadTheEventsAndNothingElse) {
    EXPECT_EQ(idle(), 1u) << "PREOP";
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    EXPECT_EQ(idle(), 1u) << "a reply waits for the master";
    (void)bench.receive();
    EXPECT_EQ(idle(), 1u) << "the last reply has been read";
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(idle(), 1u) << "SAFEOP";
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    serve();
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(idle(), 1u) << "OP";
}

// With a full mailbox, the event of SM0 stays active. The device does not read the message or the status of the
// SyncManager.
TEST_P(IdleSteps, ReadTheEventsAndNothingElseWhileAllSlotsAreFull) {
    while (bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0))) bench.settle();
    EXPECT_EQ(idle(), 1u);
}

// The master has switched off the PDI interrupts of the mailboxes, so only the status octets show messages.
TEST_P(IdleSteps, AskTheSyncManagersThatRaiseNoEvents) {
    ASSERT_EQ(bench.request(1).state, AlState::init);
    bench.esc.configure(0, {0x1000, 128, 0x06, 1});
    bench.esc.configure(1, {0x1100, 128, 0x02, 1});
    ASSERT_EQ(bench.request(2).state, AlState::preop);
    EXPECT_EQ(idle(), 2u) << "the events, and the status of SM0";
    EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    EXPECT_EQ(idle(), 3u) << "and of SM1 while a reply waits";
}

// The master starts again with the mailboxes. SM1 is empty, and no event shows that the reply was read.
TEST_P(IdleSteps, AMailboxThatTheMasterHasEmptiedIsFilledAgain) {
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    bench.settle();
    ASSERT_TRUE(bench.esc.full(1));
    bench.esc.ecat_set<std::uint8_t>(0x080D, 0);  // status of SM1
    bench.esc.configure(1, {0x1100, 128, 0x22, 1});
    bench.settle();
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x2000, 0)));
    bench.settle();
    const auto reply = bench.receive();
    ASSERT_EQ(reply.size(), wire::coe::kSdoBytes);
    EXPECT_EQ(wire::coe::SdoLayout::index::load(reply), 0x2000);
}

INSTANTIATE_TEST_SUITE_P(Modes, IdleSteps, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

}  // namespace
}  // namespace margay::subdevice
