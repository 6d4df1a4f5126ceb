// Faults in the order of requests that were found by systematic attacks on the library. Each test is for one fault.
#include "api/master.hpp"
#include "api/slow_hook.hpp"

#include <unistd.h>
#include <algorithm>
#include <memory>
#include <utility>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Patience : public HookTest {};

// statecheck(): "A timeout is no error: compare the returned state". The hook after the transition takes longer than
// the timeout.
TEST_F(Patience, StatecheckWithALongHookAfterTheTransition) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 100ms};
    slow.set(ctx);
    for (int n = 0; n < 5; ++n) cycle();
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    StateCheckRequest check;
    check.wanted = AlState::op;
    check.timeout = 50ms;
    for (int n = 0; n < 20; ++n) {
        ASSERT_TRUE(submit(ctx, check));
        (void)until([&] { return !check.busy(); });
        if (check.state() == RequestState::success) break;
    }
    EXPECT_EQ(check.state(), RequestState::success) << words(check.error());
    EXPECT_EQ(slow.begun, 2) << "ended " << slow.ended;
}

// set_target(): "While a SuperviseRequest is busy, set_target() returns at once". TargetRequest: the same.
TEST_F(Patience, TargetOfASlaveWhoseHookTakesLong) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 3s, .slave = 1};
    slow.set(ctx);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    (void)until([&] { return slow.begun > 0; });
    for (const auto slave : {std::uint16_t{1}, std::uint16_t{0}}) {
        TargetRequest target;
        target.slave = slave;
        target.wanted = AlState::safeop;
        ASSERT_TRUE(submit(ctx, target));
        const Duration took = until([&] { return !target.busy(); });
        EXPECT_LT(took, 100ms) << "slave " << slave << ": " << took / 1ms << " ms";
        target.wanted = AlState::op;
        ASSERT_TRUE(submit(ctx, target));
        (void)until([&] { return !target.busy(); });
        const int before = slow.begun;
        (void)until([&] { return slow.begun > before; }, 1s);
    }
}

// A hook never ends. The timeout of the request ends the hook, and the error names the slave and the hook that the
// request waited for.
TEST_F(Patience, AMappingThatWaitsForAHookNamesTheSlaveAndTheHook) {
    begin();
    SlowHook slow{.lasts = 1h, .slave = 2, .which = {}};
    const auto forever = [](HookedSlave slave, void* user) -> Task<> {
        auto& my = *static_cast<SlowHook*>(user);
        ++my.begun;
        auto slept = co_await slave.sleep(slave.number() == my.slave ? my.lasts : 0s);
        co_return slept;
    };
    for (const Slave& s : ctx.slaves()) {
        s.hooks.user = &slow;
        s.hooks.preop_to_safeop = +forever;
    }
    MapRequest map;
    map.image = image;
    map.timeout = 2s;
    ASSERT_TRUE(submit(ctx, map));
    EXPECT_LT(until([&] { return !map.busy(); }), 2100ms);
    EXPECT_EQ(words(map.error()), "slave 2: the hook of the application: timed out");
    EXPECT_EQ(slow.begun, 2);
}

// A plain hook that is always busy fails after 10 s.
TEST_F(Patience, APlainHookThatIsAlwaysBusyEnds) {
    begin();
    const auto busy = [](HookedSlave slave, void*) -> Result<> {
        return slave.number() == 1 ? Result<>(Error{.code = Errc::busy}) : Result<>();
    };
    for (const Slave& s : ctx.slaves()) s.hooks.preop_to_safeop = +busy;
    const Time start = osal.now();
    EXPECT_EQ(words(config_map(ctx, image).error()), "slave 1: the hook of the application: timed out");
    EXPECT_GE(osal.now() - start, 10s);
    EXPECT_LT(osal.now() - start, 11s);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::safeop);
}

// A hook of slave 1 waits until slave 2 is in OP ("other slaves continue"). Another request needs the whole segment.
struct Waits {
    HostContext* ctx = nullptr;
    static Result<> hook(HookedSlave slave, Transition which, Moment when, void* user) {
        auto& my = *static_cast<Waits*>(user);
        if (slave.number() != 1 || which != Transition::safeop_to_op || when != Moment::before) return Result<>();
        if (my.ctx->slave(2).al.state == AlState::op) return Result<>();
        return Error{.code = Errc::busy};
    }
};
TEST_F(Patience, AHookThatWaitsForAnotherSlaveBesideARecoverRequest) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    Waits waits{&ctx};
    for (const Slave& s : ctx.slaves()) {
        s.hooks.user = &waits;
        s.hooks.transition = Waits::hook;
    }
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const auto all_op = [&] { return ctx.slave(1).al.state == AlState::op && ctx.slave(2).al.state == AlState::op; };
    ASSERT_LT(until(all_op), 5s) << "alone";
    segment.set_power(0, false, osal.now());
    cycles(200);
    segment.set_power(0, true, osal.now());
    ASSERT_LT(until(all_op), 5s) << "alone, after a loss of power";
    segment.set_power(0, false, osal.now());
    cycles(200);
    segment.set_power(0, true, osal.now());
    // Polls until slave 1 is being started and slave 2 waits for its turn.
    RecoverRequest recover;
    (void)until([&] { return ctx.slave(1).al.state == AlState::safeop; });
    segment.set_power(1, false, osal.now());
    (void)until([&] { return ctx.slave(2).al.state == AlState::none; });
    segment.set_power(1, true, osal.now());
    ASSERT_TRUE(submit(ctx, recover));
    const Duration took = until([&] { return !recover.busy(); }, 60s);
    EXPECT_LT(took, 59s) << "the request, the hook and the supervision wait for each other; slave 2 "
                         << static_cast<int>(ctx.slave(2).al.state);
}

// Reading the states during a scan must not change the result of the scan.
TEST_F(Patience, ReadingTheStatesDuringAScan) {
    begin(3);
    int bad = 0;
    for (int delay = 0; delay < 60; ++delay) {
        for (std::uint32_t n = 0; n < 3; ++n) segment.set_power(n, false, osal.now());
        osal.advance(1ms);
        for (std::uint32_t n = 0; n < 3; ++n) segment.set_power(n, true, osal.now());
        osal.advance(5ms);
        segment.advance(osal.now());
        ScanRequest scan;
        ASSERT_TRUE(submit(ctx, scan));
        ReadStateRequest read;
        int reads = 0;
        for (int n = 0; n < 100'000 && scan.busy(); ++n) {
            if (n >= delay && !read.busy() && submit(ctx, read)) ++reads;
            const Time next = poll(ctx, osal.now());
            osal.wait(std::min(next, osal.now() + 10us), -1);
            segment.advance(osal.now());
        }
        ASSERT_FALSE(scan.busy());
        read.cancel();
        bool wrong = scan.state() != RequestState::success;
        for (const Slave& s : ctx.slaves()) wrong |= s.al.state != AlState::preop || s.error.code != Errc::none;
        if (wrong && ++bad < 4) {
            std::printf("delay %d: %s reads %d\n", delay, words(scan.error()).c_str(), reads);
            for (const Slave& s : ctx.slaves())
                std::printf("  %d: state %d %s\n", s.number, static_cast<int>(s.al.state), words(s.error).c_str());
        }
    }
    EXPECT_EQ(bad, 0);
}

// Two requests for the segment are submitted again as soon as they are over. The supervision never gets a turn to help
// the slave.
TEST_F(Patience, SupervisionBesideTwoThreadsThatRecover) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const auto all_op = [&] { return ctx.slave(1).al.state == AlState::op && ctx.slave(2).al.state == AlState::op; };
    ASSERT_LT(until(all_op), 5s);
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    RecoverRequest one;
    RecoverRequest two;
    const Duration took = until(
        [&] {
            if (!one.busy()) (void)submit(ctx, one);
            if (!two.busy()) (void)submit(ctx, two);
            return all_op();
        },
        30s);
    EXPECT_LT(took, 29s) << "slave 2 in state " << static_cast<int>(ctx.slave(2).al.state);
}

// A supervision is accepted, and is cancelled before it has begun.
TEST_F(Patience, PollDoesNotSpinWithoutProgress) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    RecoverRequest recover;
    MapRequest map;
    map.image = image;
    std::array<std::byte, 64> data{};
    SiiReadRequest sii;
    sii.slave = 1;
    sii.data = data;
    int same = 0;
    int most = 0;
    for (int n = 0; n < 200'000; ++n) {
        if (n % 7 == 0 && !recover.busy()) (void)submit(ctx, recover);
        if (n % 13 == 0 && !map.busy()) (void)submit(ctx, map);
        if (n % 5 == 0 && !sii.busy()) (void)submit(ctx, sii);
        if (n % 1001 == 0) segment.set_power(1, (n / 1001) % 2 == 0, osal.now());
        const Time next = poll(ctx, osal.now());
        same = next <= osal.now() ? same + 1 : 0;
        most = std::max(most, same);
        osal.wait(std::min(next, osal.now() + 100us), -1);
        segment.advance(osal.now());
    }
    EXPECT_LT(most, 20);
}

// The arena is nearly full while cycles are exchanged. The supervision must not loop inside poll().
TEST_F(Patience, ANearlyFullArenaBesideTheSupervision) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    const auto run = [&] {
        for (std::size_t free = 0; free <= 4096; free += 64) {
            SuperviseRequest supervision;
            ASSERT_TRUE(submit(ctx, supervision));
            cycles(3000);
            Arena& arena = master_of(ctx)->arena();
            std::vector<void*> taken;
            while (void* block = arena.allocate(64)) taken.push_back(block);
            std::ranges::sort(taken);
            for (std::size_t n = 0; n < free / 64 && !taken.empty(); ++n) {
                arena.release(taken.back());
                taken.pop_back();
            }
            if (free > 3000) break;
            alarm(20);
            cycles(20);
            alarm(0);
            for (void* block : taken) arena.release(block);
        }
        std::exit(0);
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(0), "") << "poll() did not return";
}

}  // namespace
}  // namespace margay
