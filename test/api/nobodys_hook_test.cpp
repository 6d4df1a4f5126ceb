// Hooks that no request waits for: hooks after a state that was requested without waiting, and hooks that the
// supervision executes.
#include "api/slow_hook.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr Duration kEver = std::chrono::hours(1000);

class NobodysHook : public HookTest {
  protected:
    // Executes cycles without poll(): the slaves change their states, and the master does not read the states.
    void cycle_unseen(int count) {
        while (count-- > 0) {
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, 500us);
            osal.advance(100us);
            segment.advance(osal.now());
        }
    }
};

// The hook waits for a limit switch that is never reached. Meanwhile the drive loses its power.
TEST_F(NobodysHook, OfTheSupervisionEndsWhenItsSlaveIsLost) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    for (const Moment when : {Moment::before, Moment::after}) {
        SlowHook slow{.lasts = kEver, .slave = 2, .when = when};
        slow.set(ctx);
        SuperviseRequest supervision;
        ASSERT_TRUE(submit(ctx, supervision));
        (void)until([&] { return slow.begun == 1; });
        cycles(300);
        EXPECT_EQ(wrong().substr(0, 38), "slave 2: the hook of the application: ") << wrong();
        (void)events(EventKind::lost, 0);
        segment.set_power(1, false, osal.now());
        EXPECT_LT(until([&] { return ctx.slave(2).al.state == AlState::none; }, 1s), 1s);
        EXPECT_FALSE(ctx.slave(2).takes_part);
        EXPECT_EQ(events(EventKind::lost, 2), 1);
        cycles(20);
        ASSERT_TRUE(send_processdata(ctx));
        EXPECT_EQ(receive_processdata(ctx, 500us).error().detail, Error::kOthersFresh);
        segment.set_power(1, true, osal.now());
        slow.lasts = 1ms;
        EXPECT_LT(until([&] { return all_right(ctx); }, 20s), 20s) << wrong();
        EXPECT_EQ(real(1), AlState::op);
        EXPECT_EQ(slow.ended, 1);
        supervision.cancel();
        for (const Slave& slave : ctx.slaves()) slave.hooks = {};
        ASSERT_TRUE(set_target(ctx, 0, AlState::safeop));
    }
}

// The device restarts so quickly that the supervision never finds it missing.
TEST_F(NobodysHook, OfTheSupervisionEndsWhenItsSlaveRestarts) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = kEver, .slave = 2};
    slow.set(ctx);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    (void)until([&] { return slow.begun == 1; });
    segment.set_power(1, false, osal.now());
    segment.set_power(1, true, osal.now());
    slow.lasts = 1ms;
    EXPECT_LT(until([&] { return all_right(ctx); }, 20s), 20s) << wrong();
    EXPECT_EQ(slow.begun, 2);
    EXPECT_EQ(slow.ended, 1);
}

TEST_F(NobodysHook, OfTheSupervisionEndsTenSecondsAfterItBeganWhenARequestNeedsTheSlave) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = kEver, .slave = 2};
    slow.set(ctx);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    (void)until([&] { return slow.begun == 1; });
    (void)errors();
    RegisterReadRequest other;  // this request does not reserve a slave
    std::array<std::byte, 2> octets{};
    other.slave = 2;
    other.data = octets;
    ASSERT_TRUE(submit(ctx, other));
    EXPECT_LT(until([&] { return !other.busy(); }), 1s);
    ReconfigRequest again;
    again.slave = 2;
    ASSERT_TRUE(submit(ctx, again));
    slow.lasts = 1ms;
    const Duration took = until([&] { return !again.busy(); }, 60s);
    EXPECT_GT(took, 9s);
    EXPECT_LT(took, 12s);
    EXPECT_EQ(again.state(), RequestState::success) << words(again.error());
    EXPECT_EQ(errors(), std::vector<std::string>{"slave 2: the hook of the application: timed out"});
    EXPECT_LT(until([&] { return all_right(ctx); }, 20s), 20s) << wrong();
}

TEST_F(NobodysHook, OfOneSlaveIsNotEndedByRequestsForAnother) {
    for (const bool supervised : {false, true}) {
        if (ctx.slaves().empty()) begin(3);
        ASSERT_TRUE(config_map(ctx, image));
        SlowHook slow{.lasts = 60s, .slave = 1};
        slow.set(ctx);
        SuperviseRequest supervision;
        cycles(5);
        if (supervised) {
            ASSERT_TRUE(submit(ctx, supervision));
        } else {
            ASSERT_TRUE(writestate(ctx, 0, AlState::op));
            (void)until([&] { return all_in(AlState::op) || !readstate(ctx); }, 1s);
        }
        (void)until([&] { return slow.begun == 1; });
        (void)until([] { return false; }, 11s);
        (void)errors();
        ReconfigRequest first;
        ReconfigRequest second;  // waits for the first request
        first.slave = second.slave = 2;
        ASSERT_TRUE(submit(ctx, first));
        ASSERT_TRUE(submit(ctx, second));
        (void)until([&] { return !first.busy() && !second.busy(); });
        EXPECT_EQ(errors(), std::vector<std::string>());
        (void)until([&] { return slow.ended == 1; }, 100s);
        EXPECT_EQ(slow.ended, 1) << "ended by the requests for slave 2";
        for (const Slave& slave : ctx.slaves()) slave.hooks = {};
    }
}

// Each hook has its own limit of 10 s. A hook that begins later does not extend the limit of the first hook, and does
// not end together with it.
TEST_F(NobodysHook, HasItsOwnTime) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = kEver};
    slow.set(ctx);
    cycles(5);
    for (const std::uint16_t slave : {std::uint16_t{1}, std::uint16_t{2}}) {
        ASSERT_TRUE(writestate(ctx, slave, AlState::op));
        (void)until([&] { return readstate(ctx).ok() && slow.begun == slave; });
        (void)until([] { return false; }, 6s);
    }
    MapRequest map;  // 12 s after the first hook has begun, 6 s after the second one
    map.image = image;
    ASSERT_TRUE(submit(ctx, map));
    cycles(20);
    EXPECT_EQ(errors(), std::vector<std::string>{"slave 1: the hook of the application: timed out"});
    EXPECT_TRUE(map.busy());
    const Duration took = until([&] { return !map.busy(); }, 60s);
    EXPECT_GT(took, 3s);
    EXPECT_LT(took, 5s);
    EXPECT_EQ(errors(), std::vector<std::string>{"slave 2: the hook of the application: timed out"});
}

// Start-up commands that take too long are named, too.
TEST_F(NobodysHook, CommandsThatAreEndedAreReported) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    static constexpr StartupCommand kNever[] = {
        check_register<std::uint8_t>(Transition::safeop_to_op, 0x0F80, 1, 0xFF, std::chrono::hours(1)).afterwards()};
    const SlaveSetup setup{.startup = kNever};
    ctx.slave(2).config.setup = &setup;
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    (void)until([&] { return readstate(ctx).ok() && all_in(AlState::op); });
    cycles(50);
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(ctx, map));
    ctx.slave(2).config.setup = nullptr;
    EXPECT_LT(until([&] { return !map.busy(); }, 60s), 12s);
    const auto told = errors();
    ASSERT_EQ(told.size(), 1U);
    EXPECT_EQ(told[0],
              "slave 2: requesting a state: the commands or the hook after the transition have not ended, or were "
              "ended early");
}

// statecheck() does not return OP before the hook has begun. The hook can be late, for example because a mapping uses
// the segment.
TEST_F(NobodysHook, IsWaitedForBeforeItHasBegun) {
    begin(3);
    ctx.slave(1).config.highest = AlState::safeop;
    ctx.slave(3).config.group = 1;
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 1ms, .slave = 2, .fails = true};
    slow.set(ctx);
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 2, AlState::op));
    cycle_unseen(300);
    SlowHook mapping{.lasts = 5s};
    ctx.slave(3).hooks.user = &mapping;
    ctx.slave(3).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        auto slept = co_await slave.sleep(static_cast<SlowHook*>(user)->lasts);
        co_return slept;
    };
    std::array<std::byte, 512> second{};
    MapRequest map;
    map.group = 1;
    map.image = second;
    ASSERT_TRUE(submit(ctx, map));
    cycles(10);
    for (const Duration timeout : {Duration{2s}, Duration{60s}}) {
        StateCheckRequest check;
        check.slave = 2;
        check.wanted = AlState::op;
        check.timeout = timeout;
        ASSERT_TRUE(submit(ctx, check));
        (void)until([&] { return !check.busy(); }, 100s);
        if (timeout == 2s) {
            EXPECT_EQ(check.error().code, Errc::start_up_unfinished) << words(check.error());
            EXPECT_EQ(slow.begun, 0) << "the mapping uses the segment";
            EXPECT_EQ(what_is_wrong(ctx).slave, 2);
        } else {
            EXPECT_EQ(words(check.error()).substr(0, 37), "slave 2: the hook of the application:") << "it has failed";
        }
    }
    EXPECT_FALSE(map.busy());
    EXPECT_EQ(slow.ended, 1);
    EXPECT_EQ(what_is_wrong(ctx).slave, 2) << wrong();
}

// The slave has reached SAFEOP, but the master has not read this state. On the way to OP, the master first executes the
// commands and hooks after PREOP to SAFEOP.
TEST_F(NobodysHook, IsNotLeftOutByTheNextStateChange) {
    for (const bool by_request : {false, true}) {
        if (ctx.slaves().empty()) begin(3);
        ASSERT_TRUE(config_map(ctx, image));
        cycles(5);
        ASSERT_TRUE(writestate(ctx, 2, AlState::preop));
        (void)statecheck(ctx, 2, AlState::preop, 1s);
        SlowHook slow{.lasts = 1ms, .slave = 2, .which = Transition::preop_to_safeop};
        slow.set(ctx);
        ASSERT_TRUE(writestate(ctx, 2, AlState::safeop));
        cycle_unseen(100);
        StateRequest safeop;
        safeop.slave = 2;
        safeop.wanted = AlState::safeop;
        if (by_request) {
            safeop.wanted = AlState::op;
            ASSERT_TRUE(submit(ctx, safeop));
            (void)until([&] { return !safeop.busy(); });
            EXPECT_EQ(safeop.state(), RequestState::success) << words(safeop.error());
        } else {
            ASSERT_TRUE(writestate(ctx, 2, AlState::safeop));
            EXPECT_EQ(statecheck(ctx, 2, AlState::safeop, 1s)->state, AlState::safeop);
        }
        EXPECT_EQ(slow.begun, 1) << by_request;
        EXPECT_EQ(slow.ended, 1) << by_request;
        for (const Slave& slave : ctx.slaves()) slave.hooks = {};
    }
}

// The hook has failed, and the slave is in OP. A request for OP does not succeed until the slave was started again.
TEST_F(NobodysHook, ThatHasFailedIsNoSuccessTheNextTime) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    cycles(5);
    SlowHook slow{.lasts = 1ms, .slave = 2, .fails = true};
    slow.set(ctx);
    for (int attempt = 0; attempt < 3; ++attempt) {
        StateRequest op;
        op.slave = 2;
        op.wanted = AlState::op;
        ASSERT_TRUE(submit(ctx, op));
        (void)until([&] { return !op.busy(); });
        EXPECT_EQ(op.error().code, attempt == 0 ? Errc::other_state : Errc::start_up_unfinished) << words(op.error());
        EXPECT_FALSE(writestate(ctx, 2, AlState::op));
        EXPECT_FALSE(writestate(ctx, 0, AlState::op));
        EXPECT_FALSE(statecheck(ctx, 2, AlState::op, 1s));
    }
    EXPECT_EQ(slow.begun, 1);
    slow.fails = false;
    ASSERT_TRUE(writestate(ctx, 2, AlState::safeop));
    EXPECT_EQ(statecheck(ctx, 2, AlState::safeop, 1s)->state, AlState::safeop);
    cycles(20);
    ASSERT_TRUE(writestate(ctx, 2, AlState::op));
    (void)until([&] { return real(1) == AlState::op; }, 1s);
    EXPECT_EQ(statecheck(ctx, 2, AlState::op, 1s)->state, AlState::op);
    EXPECT_EQ(slow.ended, 2);
}

// The application requests SAFEOP too early. When config_map() brings the slave to SAFEOP, this request has no effect
// any more.
TEST_F(NobodysHook, IsExecutedOnceAfterARequestThatCameTooEarly) {
    begin();
    SlowHook slow{.lasts = 1ms, .slave = 2, .which = Transition::preop_to_safeop};
    slow.set(ctx);
    (void)writestate(ctx, 2, AlState::safeop);
    cycles(50);
    ASSERT_TRUE(config_map(ctx, image));
    for (int n = 0; n < 3; ++n) EXPECT_TRUE(readstate(ctx));
    cycles(50);
    EXPECT_EQ(slow.begun, 1);
}

// The application requests two states one after the other, and the master does not read the state in between.
TEST_F(NobodysHook, IsNotSkippedWhenNobodyReadsTheState) {
    for (const int unseen : {0, 1, 100}) {
        if (ctx.slaves().empty()) begin(3);
        for (const Slave& slave : ctx.slaves()) slave.hooks = {};
        ASSERT_TRUE(config_map(ctx, image));
        ASSERT_TRUE(writestate(ctx, 2, AlState::preop));
        ASSERT_EQ(statecheck(ctx, 2, AlState::preop, 1s)->state, AlState::preop);
        SlowHook before{.lasts = 1ms, .slave = 2, .which = Transition::safeop_to_op, .when = Moment::before};
        before.set(ctx);
        ASSERT_TRUE(writestate(ctx, 2, AlState::safeop));
        cycle_unseen(unseen);
        ASSERT_TRUE(writestate(ctx, 2, AlState::op));
        (void)until([&] { return real(1) == AlState::op; }, 1s);
        (void)statecheck(ctx, 2, AlState::op, 1s);
        EXPECT_EQ(before.ended, 1) << unseen;
        // The commands and hooks after PREOP to SAFEOP are executed, or reported as unfinished.
        ASSERT_TRUE(writestate(ctx, 2, AlState::preop));
        ASSERT_EQ(statecheck(ctx, 2, AlState::preop, 1s)->state, AlState::preop);
        SlowHook after{.lasts = 1ms, .slave = 2, .which = Transition::preop_to_safeop};
        after.set(ctx);
        ASSERT_TRUE(writestate(ctx, 2, AlState::safeop));
        cycle_unseen(unseen);
        (void)writestate(ctx, 2, AlState::op);
        (void)until([&] { return real(1) == AlState::op; }, 1s);
        const auto reached = statecheck(ctx, 2, AlState::op, 1s);
        EXPECT_TRUE(after.ended == 1 || !reached) << unseen;
    }
}

// A lower target ends a hook of the way up, so an application that lowers the target does not wait for the hook.
TEST_F(NobodysHook, OfTheWayUpEndsWhenTheTargetBecomesLower) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    for (const Moment when : {Moment::before, Moment::after})
        for (const AlState lower : {AlState::init, AlState::preop, AlState::safeop}) {
            SlowHook slow{.lasts = kEver, .slave = 2, .when = when};
            slow.set(ctx);
            SuperviseRequest supervision;
            ASSERT_TRUE(submit(ctx, supervision));
            (void)until([&] { return slow.begun == 1; });
            cycles(20);
            ASSERT_TRUE(set_target(ctx, 0, lower));
            EXPECT_LT(until([&] { return real(1) == lower && all_in(lower); }, 5s), 1s) << to_text(lower);
            slow.lasts = 1ms;
            ASSERT_TRUE(set_target(ctx, 0, AlState::op));
            EXPECT_LT(until([&] { return all_right(ctx); }, 20s), 20s) << wrong();
            EXPECT_EQ(slow.ended, 1) << to_text(lower);
            supervision.cancel();
            for (const Slave& slave : ctx.slaves()) slave.hooks = {};
            ASSERT_TRUE(set_target(ctx, 0, AlState::safeop));
        }
}

// A lower target does not end a hook of the way down, for example a ramp.
TEST_F(NobodysHook, OfTheWayDownGoesOn) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    (void)until([&] { return all_right(ctx); });
    SlowHook ramp{.lasts = 2s, .slave = 2, .which = Transition::op_to_safeop, .when = Moment::before};
    ramp.set(ctx);
    ASSERT_TRUE(set_target(ctx, 0, AlState::safeop));
    (void)until([&] { return ramp.begun == 1; });
    cycles(20);
    ASSERT_TRUE(set_target(ctx, 0, AlState::init));
    (void)until([&] { return all_in(AlState::init); }, 10s);
    EXPECT_EQ(ramp.ended, 1);
    EXPECT_TRUE(all_in(AlState::init));
}

// Commands that the supervision executes have the same limit as its hooks.
TEST_F(NobodysHook, CommandsOfTheSupervisionAreLimitedToo) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    static constexpr StartupCommand kLong[] = {
        check_register<std::uint8_t>(Transition::safeop_to_op, 0x0F80, 1, 0xFF, std::chrono::hours(1))};
    static constexpr SlaveSetup kSetup{.startup = kLong};
    ctx.slave(2).config.setup = &kSetup;
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(2000);
    ctx.slave(2).config.setup = nullptr;
    ReconfigRequest again;
    again.slave = 2;
    ASSERT_TRUE(submit(ctx, again));
    EXPECT_LT(until([&] { return !again.busy(); }, 60s), 12s);
    EXPECT_EQ(again.state(), RequestState::success) << words(again.error());
    EXPECT_LT(until([&] { return all_right(ctx); }, 20s), 20s) << wrong();
}

// A plain function that is busy for too long causes one error.
TEST_F(NobodysHook, ABusyHookIsReportedOnce) {
    begin();
    ctx.slave(2).hooks.preop_to_safeop = [](HookedSlave, void*) { return Result<>(Error{.code = Errc::busy}); };
    EXPECT_FALSE(config_map(ctx, image));
    EXPECT_EQ(errors(), std::vector<std::string>{"slave 2: the hook of the application: timed out"});
}

// The cause of the failed start-up does not exist any more, and the slave has no place in the image. The error names
// the missing place.
TEST_F(NobodysHook, AfterAFailedHookOfIpTheErrorIsThePlace) {
    begin(3);
    SlowHook slow{.lasts = 1ms, .slave = 2, .which = Transition::init_to_preop, .when = Moment::before, .fails = true};
    slow.set(ctx);
    (void)set_target(ctx, 0, AlState::init);
    (void)set_target(ctx, 0, AlState::preop);
    EXPECT_EQ(words(config_map(ctx, image).error()).substr(0, 37), "slave 2: the hook of the application:");
    slow.fails = false;
    EXPECT_EQ(
        words(reach(ctx, AlState::op, 10s).error()),
        "slave 2: mapping process data: the slave has process data, but no place in the image is reserved for it: call "
        "config_map() again");
    EXPECT_TRUE(config_map(ctx, image)) << wrong();
    EXPECT_TRUE(reach(ctx, AlState::op, 10s)) << wrong();
}

TEST_F(NobodysHook, ATargetThatIsSetBeforeTheSupervisionBeginsCounts) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    ASSERT_TRUE(allow_waiting(ctx, false));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const Time before = osal.now();
    ASSERT_TRUE(set_target(ctx, 0, AlState::preop));
    EXPECT_EQ(osal.now(), before) << "does not wait";
    cycles(2000);
    EXPECT_TRUE(all_in(AlState::preop));
    EXPECT_EQ(real(0), AlState::preop);
}

// Many programs have this loop: they request the state again while the slave is on its way to it.
TEST_F(NobodysHook, IsExecutedWhenTheStateIsRequestedAgainMeanwhile) {
    begin(2);
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 1ms, .slave = 2};
    slow.set(ctx);
    Result<AlStatus> reached = Error{.code = Errc::timeout};
    for (int tries = 0; tries < 50 && (!reached || reached->state != AlState::op); ++tries) {
        ASSERT_TRUE(writestate(ctx, 0, AlState::op)) << tries;
        ASSERT_TRUE(writestate(ctx, 0, AlState::op)) << tries;
        cycle_unseen(1);
        reached = statecheck(ctx, 0, AlState::op, 1ms);
        cycles(3);
    }
    EXPECT_LT(until([&] { return all_right(ctx); }, 2s), 2s) << wrong();
    EXPECT_EQ(slow.ended, 1);
}

}  // namespace
}  // namespace margay
