// Requests that are interrupted by their timeout, by cancel(), or because their slave disappears. None of these
// requests leaves a slave, or the cycle of the other slaves, in a state that the application cannot see.
#include "segment/bench.hpp"
#include "wire/sii.hpp"

#include <margay/hooked_slave.hpp>

#include <memory>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Interrupted : public SegmentTest {
  protected:
    std::array<std::byte, 512> image{};
    std::array<sim::Esc*, 3> escs{};

    void begin() {
        for (auto& esc : escs) esc = &plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up());
        ASSERT_TRUE(config_map(ctx, image));
    }
    void step() {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 100us), -1);
        segment.advance(osal.now());
    }
    void steps(int count) {
        while (count-- > 0) step();
    }
    Result<std::uint32_t> cycle() {
        (void)send_processdata(ctx);
        const auto received = receive_processdata(ctx, 500us);
        step();
        return received;
    }
    void cycles(int count) {
        while (count-- > 0) (void)cycle();
    }
    // Executes cycles of 1 ms, without a poll between two of them.
    void cycle_for(Duration time) {
        for (const Time end = osal.now() + time; osal.now() < end; osal.advance(1ms)) (void)cycle();
    }
    [[nodiscard]] bool ends(const Request& request) {
        for (int n = 0; n < 500'000 && request.busy(); ++n) step();
        return !request.busy();
    }
    int count_events(EventKind kind, std::uint16_t slave) {
        int count = 0;
        while (const auto event = ctx.events().take()) count += event->kind == kind && event->slave == slave ? 1 : 0;
        return count;
    }
};

// ------------------------------------------------------------------ a slave that disappears

// The request for PREOP reaches the slave, but its reply is lost, so the master has not opened the mailbox yet.
TEST_F(Interrupted, ASlaveThatIsLostOnItsWayToPreopHasItsMailboxAgain) {
    plug_line({"coupler", "digital_io_16", "bootloader_open"});
    switch_on();
    ASSERT_TRUE(bring_up());
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(300);
    unsigned lost = 0;
    for (Duration delay{0}; delay < 40ms; delay += 1ms) {
        SCOPED_TRACE(delay.count());
        ASSERT_TRUE(set_target(ctx, 3, AlState::init));
        for (int n = 0; n < 20'000 && ctx.slave(3).al.state != AlState::init; ++n) (void)cycle();
        ASSERT_EQ(ctx.slave(3).al.state, AlState::init);
        ASSERT_TRUE(set_target(ctx, 3, AlState::preop));
        cycle_for(delay);
        segment.set_cable({1, 1}, false);
        cycle_for(100ms);
        lost += ctx.slave(3).al.state == AlState::none ? 1 : 0;
        segment.set_cable({1, 1}, true);
        for (int n = 0; n < 20'000 && !all_right(ctx); ++n) (void)cycle();
        ASSERT_EQ(ctx.slave(3).al.state, AlState::preop);
        EXPECT_TRUE(all_right(ctx)) << words(what_is_wrong(ctx));
        std::array<std::byte, 4> type{};
        SdoUpload upload;
        upload.slave = 3;
        upload.index = 0x1000;
        upload.data = type;
        ASSERT_TRUE(submit(ctx, upload)) << "its mailbox is closed";
        ASSERT_TRUE(ends(upload));
        EXPECT_EQ(upload.error().code, Errc::none) << words(upload.error());
    }
    EXPECT_GT(lost, 30U);
}

TEST_F(Interrupted, ASlaveThatIsLostDuringAStateRequestIsReportedAndTheOthersStayFresh) {
    begin();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(300);
    for (int delay = 0; delay < 12; ++delay) {
        expect_all_in(AlState::op);
        (void)count_events(EventKind::lost, 2);
        StateRequest request;
        request.slave = 2;
        request.wanted = AlState::op;
        ASSERT_TRUE(submit(ctx, request));
        steps(delay);
        segment.set_power(1, false, osal.now());
        ASSERT_TRUE(ends(request));
        cycles(200);
        EXPECT_EQ(count_events(EventKind::lost, 2), 1) << "after " << delay << " steps";
        (void)cycle();
        EXPECT_TRUE(inputs_fresh(ctx, 1)) << "after " << delay << " steps";
        if (delay == 0) {  // the supervision brings a lost slave back
            ASSERT_TRUE(submit(ctx, request));
            ASSERT_TRUE(ends(request));
            EXPECT_EQ(request.error().code, Errc::missing_slave);
        }
        segment.set_power(1, true, osal.now());
        cycles(3'000);
    }
    expect_all_in(AlState::op);
}

TEST_F(Interrupted, ASlaveThatIsLostDuringAStateRequestWithoutASupervisionDoesNotSpoilTheOthers) {
    begin();
    ASSERT_TRUE(reach(ctx, AlState::op, 5s));
    StateRequest request;
    request.slave = 3;
    request.wanted = AlState::safeop;
    ASSERT_TRUE(submit(ctx, request));
    segment.set_power(2, false, osal.now());
    ASSERT_TRUE(ends(request));
    EXPECT_EQ(ctx.slave(3).al.state, AlState::none);
    cycles(3);
    EXPECT_TRUE(inputs_fresh(ctx, 1) && inputs_fresh(ctx, 2));
}

// A cable is repaired, or a slave is switched on again, while a supervision works. recover_slave() succeeds.
TEST_F(Interrupted, RecoverSucceedsForASlaveThatIsThereAgainBesideASupervision) {
    begin();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(300);
    for (const bool by_power : {false, true}) {
        const auto there = [&](bool on) {
            if (by_power) segment.set_power(2, on, osal.now());
            if (!by_power) segment.set_cable({1, 1}, on);
        };
        there(false);
        cycles(300);
        EXPECT_EQ(recover_slave(ctx, 3).error().code, Errc::missing_slave);
        there(true);
        osal.advance(5ms);
        segment.advance(osal.now());
        const auto recovered = recover_slave(ctx, 3);
        EXPECT_TRUE(recovered) << words(recovered.error());
        cycles(2'000);
        expect_all_in(AlState::op);
    }
    EXPECT_EQ(words(recover_slave(ctx, 0).error()), "recovering the slave: no lost slave was found");
}

// ------------------------------------------------------------------ timeouts

struct CountedHook {
    int calls = 0;
    int ends = 0;
    static Task<> transition(HookedSlave slave, Transition, Moment, void* user) {
        ++static_cast<CountedHook*>(user)->calls;
        auto paused = co_await slave.sleep(10s);
        ++static_cast<CountedHook*>(user)->ends;
        co_return paused;
    }
    static Task<> after(HookedSlave slave, Transition, Moment moment, void*) {
        auto paused = co_await slave.sleep(moment == Moment::after ? 10s : 0s);
        co_return paused;
    }
};

TEST_F(Interrupted, TheTimeoutOfAStateRequestIncludesTheHook) {
    begin();
    CountedHook hook;
    ctx.slave(2).hooks.user = &hook;
    ctx.slave(2).hooks.transition = CountedHook::transition;
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::preop;
    request.timeout = 300ms;
    const Time begin_of_request = osal.now();
    ASSERT_TRUE(submit(ctx, request));
    ASSERT_TRUE(ends(request));
    EXPECT_EQ(request.error().code, Errc::timeout) << words(request.error());
    EXPECT_LE(osal.now() - begin_of_request, 600ms);
    EXPECT_EQ(hook.calls, 1);
}

TEST_F(Interrupted, AStateRequestThatIsCutReportsTheStateThatItHasReached) {
    begin();
    SuperviseRequest supervision;
    supervision.target = AlState::safeop;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(300);
    CountedHook hook;
    ctx.slave(2).hooks.user = &hook;
    ctx.slave(2).hooks.transition = CountedHook::after;
    ASSERT_TRUE(set_target(ctx, 2, AlState::op));
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    request.timeout = 300ms;
    ASSERT_TRUE(submit(ctx, request));
    bool told = false;
    for (int n = 0; n < 20'000 && request.busy(); ++n) {
        (void)cycle();
        while (const auto event = ctx.events().take())
            told |= event->kind == EventKind::state && event->slave == 2 && event->now.state == AlState::op;
    }
    EXPECT_EQ(words(request.error()), "slave 2: the hook of the application: timed out");
    EXPECT_EQ(ctx.slave(2).al.state, AlState::op);
    EXPECT_TRUE(told);
}

// A loop of short calls of statecheck(), as many programs have it, does not end the hook. The hook begins only once.
TEST_F(Interrupted, AStatecheckDoesNotCutTheHookAfterTheTransition) {
    begin();
    ASSERT_TRUE(writestate(ctx, 2, AlState::preop));
    CountedHook hook;
    ctx.slave(2).hooks.user = &hook;
    ctx.slave(2).hooks.transition = CountedHook::transition;
    for (int n = 0; n < 5; ++n) {
        const Time begin_of_check = osal.now();
        const auto seen = statecheck(ctx, 2, AlState::preop, 100ms);
        EXPECT_EQ(words(seen.error()),
                  "slave 2: the hook of the application: the commands or the hook after the transition have not ended, "
                  "or were ended early");
        EXPECT_LE(osal.now() - begin_of_check, 110ms);
        EXPECT_EQ(hook.calls, 1);
        EXPECT_EQ(hook.ends, 0);
    }
    EXPECT_TRUE(readstate(ctx));
    EXPECT_EQ(hook.ends, 0) << "a reading does not wait for the hook";
    EXPECT_TRUE(statecheck(ctx, 2, AlState::preop, 10s));
    EXPECT_EQ(hook.calls, 1);
    EXPECT_EQ(hook.ends, 1);
}

// ------------------------------------------------------------------ the EEPROM

constexpr std::size_t kWritten = 64;  // octets: the configuration area, and the words after it

std::array<std::byte, kWritten> with_alias(std::array<std::byte, kWritten> content) {
    store_le<std::uint16_t>(content, 8, 0x1234);
    content[14] = std::byte{wire::sii::checksum(Bytes(content).first(14))};
    return content;
}

// The request is interrupted at each moment. Each time the EEPROM has its old content or the new content, and the slave
// has access to the EEPROM again.
TEST_F(Interrupted, AnSiiWriteIsNeverCutInTheConfigurationArea) {
    begin();
    std::array<std::byte, kWritten> before{};
    ASSERT_TRUE(read_sii(ctx, 2, 0, before));
    const auto after = with_alias(before);
    int cut = 0;
    for (const bool by_cancel : {false, true}) {
        for (int delay = 1; delay < 1'500; delay += 23) {
            ASSERT_TRUE(write_sii(ctx, 2, 0, before));
            SiiWriteRequest request;
            request.slave = 2;
            request.word = 0;
            request.data = after;
            if (!by_cancel) request.timeout = delay * 100us;
            ASSERT_TRUE(submit(ctx, request));
            if (by_cancel) steps(delay);
            if (by_cancel) request.cancel();
            ASSERT_TRUE(ends(request));
            cut += request.state() == RequestState::error ? 1 : 0;
            std::array<std::byte, kWritten> now{};
            ASSERT_TRUE(read_sii(ctx, 2, 0, now));
            EXPECT_EQ(now, request.state() == RequestState::success ? after : before) << delay;
            std::array<std::byte, 1> assigned{};
            ASSERT_TRUE(read_register(ctx, 2, 0x0500, assigned));
            EXPECT_EQ(assigned[0], std::byte{1}) << "the EEPROM belongs to the slave";
        }
    }
    EXPECT_GT(cut, 20);
}

TEST_F(Interrupted, AnSiiReadThatEndsEarlyGivesTheEepromBack) {
    begin();
    std::array<std::byte, 1024> memory{};
    for (const bool by_cancel : {false, true}) {
        SiiReadRequest request;
        request.slave = 2;
        request.data = memory;
        if (!by_cancel) request.timeout = 20ms;
        ASSERT_TRUE(submit(ctx, request));
        steps(20);
        if (by_cancel) request.cancel();
        ASSERT_TRUE(ends(request));
        EXPECT_EQ(request.error().code, by_cancel ? Errc::canceled : Errc::timeout) << words(request.error());
        std::array<std::byte, 1> assigned{};
        ASSERT_TRUE(read_register(ctx, 2, 0x0500, assigned));
        EXPECT_EQ(assigned[0], std::byte{1}) << "the EEPROM belongs to the slave";
    }
}

// The program is not scheduled for longer than the time limits of the EEPROM, at any moment of the scan.
TEST_F(Interrupted, AProgramThatPausesDuringAScanFindsTheEepromReady) {
    for (auto& esc : escs) esc = &plug("odd_device");
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    for (int pause = 0; pause < 400; pause += 3) {
        ScanRequest scan;
        ASSERT_TRUE(submit(ctx, scan));
        steps(pause);
        osal.advance(300ms);
        segment.advance(osal.now());
        ASSERT_TRUE(ends(scan));
        ASSERT_EQ(scan.state(), RequestState::success) << pause << ": " << words(scan.error());
    }
}

// ------------------------------------------------------------------ the supervision

TEST_F(Interrupted, TheEventThatASupervisionHasEndedSaysWhy) {
    begin();
    SuperviseRequest supervision;
    supervision.timeout = 50ms;
    ASSERT_TRUE(submit(ctx, supervision));
    ASSERT_TRUE(ends(supervision));
    Event last;
    while (const auto event = ctx.events().take())
        if (event->kind == EventKind::unsupervised) last = *event;
    EXPECT_EQ(last.error.code, Errc::timeout);
    std::array<char, 200> text{};
    EXPECT_EQ(describe(last, text),
              "the supervision has ended: lost slaves are not brought back: supervising the slaves: timed out");
}

TEST_F(Interrupted, ReachGoesOnWithASupervisionOfItsOwnWhenThatOfTheApplicationEnds) {
    begin();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    struct Meddler {
        SuperviseRequest* supervision;
        static Task<> transition(HookedSlave slave, Transition which, Moment, void* user) {
            if (which == Transition::safeop_to_op) static_cast<Meddler*>(user)->supervision->cancel();
            auto paused = co_await slave.sleep(1ms);
            co_return paused;
        }
    } meddler{&supervision};
    ctx.slave(2).hooks.user = &meddler;
    ctx.slave(2).hooks.transition = Meddler::transition;
    const auto reached = reach(ctx, AlState::op, 10s);
    EXPECT_TRUE(reached) << words(reached.error());
    EXPECT_FALSE(supervision.busy());
    expect_all_in(AlState::op);
}

// ------------------------------------------------------------------ mappings

// A mapping that is cancelled at any moment leaves no pointer into the memory of an image, also not for slaves that
// have left the group. AddressSanitizer reports such a pointer.
TEST_F(Interrupted, AMappingThatIsCancelledLeavesNothingInTheOldImage) {
    begin();
    for (const Slave& slave : ctx.slaves()) slave.config.mailbox_status = true;
    for (int delay = 0; delay < 150; delay += 5) {
        auto old_image = std::make_unique<std::array<std::byte, 512>>();
        ctx.slave(2).config.group = 0;
        (void)config_map(ctx, *old_image);
        ctx.slave(2).config.group = 1;
        MapRequest map;
        map.image = image;
        ASSERT_TRUE(submit(ctx, map));
        steps(1 + delay);  // the mapping has begun
        map.cancel();
        old_image.reset();
        EXPECT_TRUE(ctx.slave(2).image.outputs.bytes.empty());
        EXPECT_TRUE(ctx.slave(1).image.outputs.bytes.empty() || ctx.group(0).image.data() == image.data());
        for (const Slave& slave : ctx.slaves())
            for (auto& octet : slave.image.outputs.bytes) octet = std::byte{1};
        ASSERT_TRUE(watch_mailboxes(ctx, 1ms));
        steps(30);
    }
}

// ------------------------------------------------------------------ exceptions

using InterruptedDeathTest = Interrupted;

TEST_F(InterruptedDeathTest, AnExceptionOfACallbackEndsTheProgram) {
    begin();
    EXPECT_DEATH((void)run_cycle(ctx, {}, [](const CycleInfo&) -> bool { throw 1; }), "terminate");
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(300);
    ctx.events().callback = [](const Event&, void*) { throw 1; };
    segment.set_power(2, false, osal.now());
    EXPECT_DEATH(cycles(100), "terminate");
    ctx.events().callback = nullptr;
    supervision.cancel();
    ctx.slave(1).hooks.transition = [](HookedSlave, Transition, Moment, void*) -> Result<> { throw 1; };
    EXPECT_DEATH((void)writestate(ctx, 1, AlState::preop), "terminate");
    ctx.slave(1).hooks.transition = {};
}

}  // namespace
}  // namespace margay
