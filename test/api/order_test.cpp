// The order of requests and events. A request that can begin does not wait for another event. Each change of a slave is
// reported, no matter which part of the program reads it first. The end of a supervision is reported.
#include "segment/bench.hpp"

#include <margay/hooked_slave.hpp>

#include <algorithm>
#include <memory>
#include <utility>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A NIC whose frames arrive during poll(), after the first call of receive().
class LateNic final : public Nic {
  public:
    explicit LateNic(Nic& nic) : nic_(nic) {}
    bool late = false;
    SendStatus send(std::span<const std::byte> frame) noexcept override { return nic_.send(frame); }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        return std::exchange(late, false) ? 0 : nic_.receive(into);
    }
    LinkState link_state() noexcept override { return nic_.link_state(); }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  private:
    Nic& nic_;
};

class Order : public SegmentTest {
  protected:
    std::array<std::byte, 512> image{};

    void begin(Nic& nic) {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up(nic));
        ASSERT_TRUE(config_map(ctx, image));
    }
    void begin() { begin(wire); }
    Time step() {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 100us), -1);
        segment.advance(osal.now());
        return next;
    }
    void steps(int count) {
        while (count-- > 0) (void)step();
    }
    void cycles(int count) {
        while (count-- > 0) {
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, 500us);
            (void)step();
        }
    }
    [[nodiscard]] bool ends(const Request& request) {
        for (int n = 0; n < 100'000 && request.busy(); ++n) (void)step();
        return !request.busy();
    }
    template <class Which>
    int count_events(Which which) {
        int count = 0;
        while (const auto event = ctx.events().take()) count += which(*event) ? 1 : 0;
        return count;
    }
    int ends_of_supervision() {
        return count_events([](const Event& e) { return e.kind == EventKind::unsupervised; });
    }
};

// ------------------------------------------------------------------ requests that wait

TEST_F(Order, ARequestBeginsWhenTheOneBeforeEndsByAFrameThatArrivesDuringPoll) {
    LateNic late(wire);
    begin(late);
    RecoverRequest first;
    RecoverRequest second;
    ASSERT_TRUE(submit(ctx, first));
    ASSERT_TRUE(submit(ctx, second));
    for (int n = 0; n < 1'000 && second.busy(); ++n) {
        late.late = first.busy();
        const Time next = poll(ctx, osal.now());
        late.late = false;
        ASSERT_TRUE(!second.busy() || next != kNever) << "the owner would sleep for ever";
        osal.wait(next, -1);
        segment.advance(osal.now());
    }
    EXPECT_EQ(second.state(), RequestState::success) << words(second.error());
}

TEST_F(Order, TheHighestPriorityBeginsFirstAmongRequestsForTheSegment) {
    begin();
    RecoverRequest low;
    MapRequest high;
    high.image = image;
    high.priority = 3;
    ASSERT_TRUE(submit(ctx, low));
    ASSERT_TRUE(submit(ctx, high));
    while (low.busy() && high.busy()) (void)step();
    EXPECT_TRUE(low.busy()) << "it has the lowest priority";
    ASSERT_TRUE(ends(low) && ends(high));
    WriteStateRequest all;
    all.wanted = AlState::preop;
    StateRequest one;
    one.slave = 1;
    one.wanted = AlState::preop;
    one.priority = 3;
    ASSERT_TRUE(submit(ctx, all));
    ASSERT_TRUE(submit(ctx, one));
    while (all.busy() && one.busy()) (void)step();
    EXPECT_TRUE(all.busy()) << "it has the lowest priority";
    ASSERT_TRUE(ends(all) && ends(one));
}

// ------------------------------------------------------------------ events of the supervision

// The application reads the states before the supervision does.
TEST_F(Order, ALostSlaveIsReportedWhoeverReadsItsStateFirst) {
    begin();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const auto lost = [](const Event& e) { return e.kind == EventKind::lost && e.slave == 2; };
    for (int reader = 0; reader < 5; ++reader) {
        cycles(6'000);
        ASSERT_EQ(ctx.slave(2).al.state, AlState::op) << reader;
        (void)count_events(lost);
        segment.set_power(1, false, osal.now());
        switch (reader) {
            case 0: break;  // only the supervision reads the state
            case 1: (void)readstate(ctx); break;
            case 2: (void)statecheck(ctx, 2, AlState::op, 0ns); break;
            case 3: (void)recover_slave(ctx, 2); break;
            default: (void)reach(ctx, AlState::op, 20ms);
        }
        cycles(1'000);
        EXPECT_EQ(count_events(lost), 1) << "reader " << reader;
        segment.set_power(1, true, osal.now());
    }
}

TEST_F(Order, AStateWithAnErrorIsReportedWhoeverReadsItFirst) {
    begin();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const auto fell = [](const Event& e) { return e.kind == EventKind::state && e.slave == 2 && e.now.error; };
    for (const bool read_first : {false, true}) {
        cycles(3'000);
        ASSERT_EQ(ctx.slave(2).al.state, AlState::op);
        (void)count_events(fell);
        osal.advance(400ms);  // the watchdogs of the outputs expire
        segment.advance(osal.now());
        if (read_first) (void)readstate(ctx);
        cycles(3'000);
        EXPECT_EQ(count_events(fell), 1) << "read by the application: " << read_first;
    }
}

TEST_F(Order, TheEndOfASupervisionByItsTimeoutIsReportedOrAnotherPollIsAskedFor) {
    begin();
    SuperviseRequest supervision;
    supervision.timeout = 50ms;
    ASSERT_TRUE(submit(ctx, supervision));
    Time next{};
    while (supervision.busy()) next = step();
    if (next != kNever) (void)step();
    EXPECT_EQ(ends_of_supervision(), 1) << "no poll() was asked for, and nothing was reported";
}

TEST_F(Order, TheEndOfASupervisionByACallbackIsReportedOrAnotherPollIsAskedFor) {
    begin();
    SuperviseRequest supervision;
    ctx.events().user = &supervision;
    ctx.events().callback = [](const Event&, void* user) { static_cast<SuperviseRequest*>(user)->cancel(); };
    ASSERT_TRUE(submit(ctx, supervision));
    Time next{};
    for (int n = 0; n < 10'000 && supervision.busy(); ++n) {
        (void)send_processdata(ctx);
        (void)receive_processdata(ctx, 500us);
        next = step();
    }
    ASSERT_FALSE(supervision.busy());
    if (next != kNever) (void)step();
    EXPECT_EQ(ends_of_supervision(), 1) << "no poll() was asked for, and nothing was reported";
    ctx.events().callback = nullptr;
}

// ------------------------------------------------------------------ the supervision and a state for all slaves

struct TransitionCount {
    std::array<int, 3> now{};
    int most = 0;
    static Task<> hook(HookedSlave slave, Transition, Moment, void* user) {
        auto& my = *static_cast<TransitionCount*>(user);
        my.most = std::max(my.most, ++my.now.at(slave.number()));
        auto paused = co_await slave.sleep(5ms);
        --my.now.at(slave.number());
        co_return paused;
    }
};

TEST_F(Order, WritingTheStateOfAllSlavesLeavesThoseAloneThatTheSupervisionBringsBack) {
    begin();
    TransitionCount count;
    for (const Slave& slave : ctx.slaves()) {
        slave.hooks.user = &count;
        slave.hooks.transition = TransitionCount::hook;
    }
    SuperviseRequest supervision;
    supervision.interval = 1ms;
    supervision.target = AlState::preop;
    ASSERT_TRUE(submit(ctx, supervision));
    for (int delay = 0; delay < 200; delay += 7) {
        supervision.target = AlState::preop;
        steps(800);
        supervision.target = AlState::safeop;
        steps(delay);
        WriteStateRequest write;
        write.wanted = AlState::safeop;
        ASSERT_TRUE(submit(ctx, write));
        ASSERT_TRUE(ends(write));
        steps(800);
        ASSERT_EQ(count.most, 1) << "the hook of one slave ran twice at the same time, after " << delay << " steps";
    }
}

// ------------------------------------------------------------------ long times, and images that are gone

TEST_F(Order, ASupervisionMayWaitForTheLongestTimeAfterASearch) {
    begin();
    SuperviseRequest supervision;
    supervision.retry = supervision.interval = Duration::max();
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(1'000);
    segment.set_power(1, false, osal.now());
    cycles(500);
    segment.set_power(1, true, osal.now());
    cycles(3'000);
    expect_all_in(AlState::op);
}

// The slave has left the group, and the group has another image. The library must not read the old image any more.
TEST_F(Order, TheMailboxStatusOfASlaveThatLeftItsGroupIsNotReadFromTheOldImage) {
    begin();
    for (const Slave& slave : ctx.slaves()) slave.config.mailbox_status = true;
    auto old_image = std::make_unique<std::array<std::byte, 512>>();
    ASSERT_TRUE(config_map(ctx, *old_image));
    ctx.slave(2).config.group = 1;
    ASSERT_TRUE(config_map(ctx, image));
    ASSERT_TRUE(watch_mailboxes(ctx, 5ms));
    const auto datagrams_with = [&](std::byte octet) {
        old_image->fill(octet);
        const auto before = ctx.statistics().datagrams_sent;
        steps(500);
        return ctx.statistics().datagrams_sent - before;
    };
    steps(500);
    const auto without_mail = datagrams_with(std::byte{0});
    EXPECT_LE(datagrams_with(std::byte{0xFF}), without_mail + 1) << "the old image decides what is sent";
    old_image.reset();  // AddressSanitizer reports a read of the old image
    steps(500);
}

}  // namespace
}  // namespace margay
