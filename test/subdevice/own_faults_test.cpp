// Device::fall_back() in the functions of the author that a transition calls. The fault is never lost, and the master
// never reads a success before the fault.
#include "bench_device.hpp"

#include <utility>

namespace margay::subdevice::testing {
namespace {

constexpr auto kOwn = AlStatusCode::external_hardware_not_ready;
constexpr auto kOther = AlStatusCode::unspecified;

AlStatus fault(AlState state, AlStatusCode why = kOwn) { return {state, true, static_cast<std::uint16_t>(why)}; }

// Each AL status that the device has written, in order.
class StatusLog final : public EscAccess {
  public:
    explicit StatusLog(PlainEsc& esc) : esc_(esc) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override { esc_.read(address, into); }
    void write(std::uint16_t address, Bytes data) noexcept override {
        esc_.write(address, data);
        if (address == 0x0130) written.push_back(esc_.al_status());
    }
    [[nodiscard]] Time now() noexcept override { return esc_.now(); }
    [[nodiscard]] std::uint32_t lock() noexcept override { return depth++; }
    void unlock(std::uint32_t before) noexcept override { depth = before; }

    std::vector<AlStatus> written;
    std::uint32_t depth = 0;

  private:
    PlainEsc& esc_;
};

class OwnFaults : public ::testing::Test {
  protected:
    OwnFaults() {
        bench.dictionary.set_lock(&log);
        bench.device.emplace(log, bench.application, process_data, &mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(128);
        EXPECT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
        log.written.clear();
    }
    void fall(AlState to, AlStatusCode why = kOwn) { bench.device->fall_back(to, why, bench.esc.time); }
    void to_op() {
        ASSERT_EQ(bench.request(4).state, AlState::safeop);
        (void)bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0}));
        ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
        log.written.clear();
    }

    Bench bench;
    StatusLog log{bench.esc};
    ProcessData process_data{log, bench.application, bench.dictionary, bench.process_memory};
    std::array<std::byte, 256> receive_memory{};
    std::array<std::byte, 1024> send_memory{};
    std::array<MailboxProtocol, 1> protocols{{{wire::MailboxType::coe, &bench.coe}}};
    Mailbox mailbox{log, MutableBytes(receive_memory), MutableBytes(send_memory), protocols};
};

TEST_F(OwnFaults, OfTheFirstCycleIsReportedWithSafeop) {
    for (const AlState to : {AlState::init, AlState::preop, AlState::safeop}) {
        bench.application.during_cycle = [&] { fall(to); };
        EXPECT_EQ(bench.request(4), fault(to));
        EXPECT_EQ(bench.device->state(), to);
        EXPECT_EQ(log.written.front(), fault(AlState::safeop)) << "no status without the error";
        for (const AlStatus& status : log.written) EXPECT_TRUE(status.error);
        bench.application.during_cycle = [] {};
        (void)bench.request(0x11);
        bench.configure(128);
        ASSERT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
        log.written.clear();
    }
}

TEST_F(OwnFaults, InBeforeRefuseTheTransition) {
    bench.application.transition_hook = [&](Transition, Time) { return fall(AlState::preop), Verdict::go(); };
    EXPECT_EQ(bench.request(4), fault(AlState::preop));
    EXPECT_EQ(log.written, std::vector{fault(AlState::preop)});
    EXPECT_EQ(bench.application.cycles, 0u);
    bench.application.transition_hook = [&](Transition, Time) { return fall(AlState::init), Verdict::wait(Time{}); };
    EXPECT_EQ(bench.request(0x14), fault(AlState::init));
    EXPECT_FALSE(mailbox.running());
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), fault(AlState::init));
}

// The same in a transition to a lower state: the device stays in its state, and each request is refused.
TEST_F(OwnFaults, InBeforeOfARequestForALowerStateEnd) {
    to_op();
    bench.application.transition_hook = [&](Transition, Time) { return fall(AlState::safeop), Verdict::go(); };
    EXPECT_EQ(bench.request(2), fault(AlState::safeop));
    EXPECT_EQ(bench.request(0x12), fault(AlState::safeop));
    bench.application.transition_hook = nullptr;
    EXPECT_EQ(bench.request(0x12), (AlStatus{AlState::preop, false, 0}));
}

TEST_F(OwnFaults, InSafeOutputsAreReportedWithTheNewState) {
    to_op();
    bench.application.during_safe = [&] { fall(AlState::init); };
    EXPECT_EQ(bench.request(4), fault(AlState::init));
    EXPECT_EQ(log.written, (std::vector{fault(AlState::safeop), fault(AlState::init)}));
    EXPECT_EQ(bench.application.safe, 1u);
}

// The device leaves OP without a request, and safe_outputs() has a fault, too.
TEST_F(OwnFaults, OneAfterAnother) {
    to_op();
    bench.application.during_safe = [&] { fall(AlState::preop, kOther); };
    fall(AlState::safeop);
    EXPECT_EQ(bench.esc.al_status(), fault(AlState::preop, kOther));
    EXPECT_EQ(log.written, (std::vector{fault(AlState::safeop, kOther), fault(AlState::preop, kOther)}));
}

TEST_F(OwnFaults, TheLowestStateCounts) {
    bench.application.during_cycle = [&] {
        fall(AlState::init);
        fall(AlState::safeop, kOther);
    };
    EXPECT_EQ(bench.request(4), fault(AlState::init));
}

TEST_F(OwnFaults, InACycleOfStepEndTheStateWithoutTheLock) {
    to_op();
    std::uint32_t depth = 7;
    bench.application.during_after = [&] { depth = log.depth; };
    bench.application.during_cycle = [&] { fall(AlState::safeop); };
    (void)bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0}));
    bench.esc.raise(wire::al_event::sync_manager(2));
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), fault(AlState::safeop));
    EXPECT_EQ(depth, 0u) << "after() is called without the lock";
}

TEST_F(OwnFaults, InAfterEndTheNewState) {
    bool first = true;
    bench.application.during_after = [&] {
        if (std::exchange(first, false)) fall(AlState::preop);
    };
    EXPECT_EQ(bench.request(4), fault(AlState::preop));
    EXPECT_FALSE(process_data.running());
}

// dropped() is called because of the first fault. The device goes to the lower of the two states.
TEST_F(OwnFaults, OfATransitionThatIsDroppedForAFault) {
    to_op();
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    bench.application.transition_hook = [&](Transition, Time) { return fall(AlState::init), Verdict::go(); };
    bench.application.during_dropped = [&] { fall(AlState::preop, kOther); };
    (void)bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0}));
    EXPECT_EQ(bench.request(8), fault(AlState::init));
}

// The acknowledge of the master is for the error that the master has read, and not for an error that the device reports
// meanwhile.
TEST_F(OwnFaults, AreNotAcknowledgedByTheRequestThatRaisesThem) {
    bench.application.transition_hook = [](Transition, Time) { return Verdict::wait(kNever); };
    bench.application.during_dropped = [&] { fall(AlState::init); };
    for (const std::uint16_t other : {std::uint16_t{0x12}, std::uint16_t{0x02}}) {
        ASSERT_EQ(bench.request(4), (AlStatus{AlState::preop, false, 0}));
        EXPECT_EQ(bench.request(other), fault(AlState::init)) << other;
        bench.application.transition_hook = nullptr;
        (void)bench.request(0x11);
        bench.configure(128);
        ASSERT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
        bench.application.transition_hook = [](Transition, Time) { return Verdict::wait(kNever); };
    }
}

TEST_F(OwnFaults, ARestartInAnyFunctionIsNoTransition) {
    const AlStatus started{AlState::init, false, 0};
    const auto restart = [&] { bench.device->start(bench.esc.time); };
    const auto again = [&] {
        bench.application.transition_hook = nullptr;
        bench.application.during_cycle = bench.application.during_safe = bench.application.during_after = [] {};
        bench.configure(128);
        ASSERT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
    };
    bench.application.transition_hook = [&](Transition, Time) { return restart(), Verdict::go(); };
    EXPECT_EQ(bench.request(4), started);
    again();
    bench.application.during_cycle = restart;
    EXPECT_EQ(bench.request(4), started);
    again();
    bool first_state = true;
    bench.application.during_after = [&] {
        if (std::exchange(first_state, false)) restart();
    };
    EXPECT_EQ(bench.request(4), started);
    again();
    to_op();
    bool first = true;
    bench.application.during_safe = [&] {
        if (std::exchange(first, false)) restart();
    };
    EXPECT_EQ(bench.request(4), started);
    again();
    EXPECT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
}

}  // namespace
}  // namespace margay::subdevice::testing
