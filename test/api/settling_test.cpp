// Commands and hooks after a transition that no request waits for, the turns of the supervision, and mappings that are
// cancelled.
#include "api/slow_hook.hpp"
#include "wire/esc.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Settling : public HookTest {};

// StateCheckRequest: "`timeout` zero: reads the states once".
TEST_F(Settling, StatecheckWithTimeoutZeroBesideALongHook) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 60s, .slave = 1};
    slow.set(ctx);
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    cycles(500);
    StateCheckRequest check;
    check.wanted = AlState::op;
    ASSERT_TRUE(submit(ctx, check));
    const Duration took = until([&] { return !check.busy(); }, 100s);
    EXPECT_LT(took, 1s) << took / 1ms << " ms";
}

TEST_F(Settling, ReadstateBesideALongHook) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 60s, .slave = 1};
    slow.set(ctx);
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    cycles(500);
    ReadStateRequest read;
    ASSERT_TRUE(submit(ctx, read));
    const Duration took = until([&] { return !read.busy(); }, 100s);
    EXPECT_LT(took, 1s) << took / 1ms << " ms";
}

// The state of slave 2 does not depend on the hook of slave 1.
TEST_F(Settling, StatecheckOfASlaveBesideALongHookOfAnother) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 60s, .slave = 1};
    slow.set(ctx);
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 1, AlState::op));
    cycles(500);
    ReadStateRequest read;
    read.timeout = 10ms;
    ASSERT_TRUE(submit(ctx, read));
    (void)until([&] { return !read.busy(); });
    ASSERT_EQ(slow.begun, 1);
    StateCheckRequest check;
    check.slave = 2;
    check.wanted = AlState::op;
    check.timeout = 2s;
    ASSERT_TRUE(submit(ctx, check));  // reads the state before slave 2 is in OP
    cycles(3);
    WriteStateRequest write;
    write.slave = 2;
    write.wanted = AlState::op;
    ASSERT_TRUE(submit(ctx, write));
    const Duration took = until([&] { return !check.busy(); }, 100s);
    EXPECT_LT(took, 1s) << took / 1ms << " ms";
    EXPECT_EQ(check.state(), RequestState::success) << words(check.error());
    EXPECT_EQ(check.reached.state, AlState::op) << "slave 2 is in " << static_cast<int>(real(1));
}

// A hook after a transition never ends, and statecheck() has begun it. The request for the state is over. A request
// that needs the slave ends the hook after 10 s.
TEST_F(Settling, ARequestForTheSlaveEndsTheHook) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = std::chrono::hours(1000), .slave = 1};
    slow.set(ctx);
    cycles(5);
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    StateCheckRequest check;
    check.wanted = AlState::op;
    check.timeout = 100ms;
    ASSERT_TRUE(submit(ctx, check));
    (void)until([&] { return !check.busy(); });
    ASSERT_EQ(slow.begun, 1);
    for (const Slave& s : ctx.slaves()) s.hooks = {};
    ReadStateRequest read;
    ASSERT_TRUE(submit(ctx, read));
    read.cancel();
    ReconfigRequest reconfig;
    reconfig.slave = 1;
    ASSERT_TRUE(submit(ctx, reconfig));
    EXPECT_LT(until([&] { return !reconfig.busy(); }, 120s), 11s) << "reconfigure_slave(1)";
    EXPECT_EQ(reconfig.state(), RequestState::success) << words(reconfig.error());
    EXPECT_EQ(slow.ended, 0);
    bool told = false;
    while (const auto error = ctx.errors().take())
        told |= words(*error) == "slave 1: the hook of the application: timed out";
    EXPECT_TRUE(told);
    reconfig.cancel();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    segment.set_power(0, false, osal.now());
    cycles(1000);
    segment.set_power(0, true, osal.now());
    EXPECT_LT(until([&] { return ctx.slave(1).al.state == AlState::op && ctx.slave(1).takes_part; }, 120s), 60s)
        << "supervision: slave 1 had no power; state " << static_cast<int>(ctx.slave(1).al.state) << " takes part "
        << ctx.slave(1).takes_part << ", really in " << static_cast<int>(real(0));
    int lost = 0;
    while (const auto event = ctx.events().take()) lost += event->kind == EventKind::lost ? 1 : 0;
    EXPECT_GT(lost, 0) << "the loss of slave 1 is reported";
    supervision.cancel();
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    EXPECT_LT(until([&] { return !scan.busy(); }, 120s), 60s) << "config_init()";
    scan.cancel();
}

// Requests for the segment beside a supervision with a long interval, without cycles.
TEST_F(Settling, RequestsForTheSegmentBesideASupervisionWithALongInterval) {
    begin();
    cycling = false;
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    supervision.target = AlState::safeop;
    supervision.interval = 60s;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(1000);
    for (int n = 0; n < 3; ++n) {
        MapRequest map;
        map.image = image;
        ASSERT_TRUE(submit(ctx, map));
        const Duration took = until([&] { return !map.busy(); }, 200s);
        EXPECT_LT(took, 5s) << "mapping " << n << ": " << took / 1ms << " ms";
    }
    for (int n = 0; n < 3; ++n) {
        WriteStateRequest write;
        write.wanted = AlState::safeop;
        ASSERT_TRUE(submit(ctx, write));
        const Duration took = until([&] { return !write.busy(); }, 200s);
        EXPECT_LT(took, 5s) << "writestate " << n << ": " << took / 1ms << " ms";
    }
}

// Requests that read the error counters without a pause do not prevent a lost slave from coming back.
TEST_F(Settling, LineErrorsReadAllTheTimeBesideALostSlave) {
    begin(3);
    ASSERT_TRUE(config_map(ctx, image));
    std::array<LineErrors, 3> lines{};
    SuperviseRequest supervision;
    supervision.line_interval = 1ns;
    supervision.line_errors = lines;
    ASSERT_TRUE(submit(ctx, supervision));
    EXPECT_LT(until([&] { return all_in(AlState::op); }, 30s), 20s);
    segment.set_power(1, false, osal.now());
    cycles(200);
    segment.set_power(1, true, osal.now());
    cycles(20);
    EXPECT_LT(until([&] { return all_in(AlState::op); }, 30s), 20s);
    supervision.cancel();
}

// A mapping is cancelled at any step. Cycles have an error while a slave is below SAFEOP.
TEST_F(Settling, AMappingThatIsCut) {
    begin(3);
    int wrong = 0;
    for (int cut = 0; cut < 400; ++cut) {
        MapRequest map;
        map.image = image;
        ASSERT_TRUE(submit(ctx, map));
        for (int n = 0; n < cut && map.busy(); ++n) {
            (void)poll(ctx, osal.now());
            osal.advance(50us);
            segment.advance(osal.now());
        }
        const bool over = !map.busy();
        map.cancel();
        for (int n = 0; n < 3; ++n) {
            (void)send_processdata(ctx);
            const auto got = receive_processdata(ctx, 500us);
            (void)poll(ctx, osal.now());
            osal.advance(100us);
            segment.advance(osal.now());
            if (!got) continue;
            bool below = false;
            for (std::uint32_t s = 0; s < 3; ++s) below |= real(s) < AlState::safeop;
            if (below && ++wrong < 5)
                ADD_FAILURE() << "cut after " << cut << " polls: the cycle is right, wkc " << *got << ", slaves in "
                              << static_cast<int>(real(0)) << ' ' << static_cast<int>(real(1)) << ' '
                              << static_cast<int>(real(2));
        }
        if (over) break;
        // Brings the slaves back to PREOP, no matter where the mapping was cancelled.
        if (cut % 2 == 0) {
            ASSERT_TRUE(config_init(ctx));
        }
    }
}

// The timeout of a supervision ends it while it waits for the hook of a slave.
TEST_F(Settling, TheTimeoutOfASupervisionBesideAHook) {
    begin();
    ASSERT_TRUE(config_map(ctx, image));
    SlowHook slow{.lasts = 60s, .slave = 1, .when = Moment::before};
    slow.set(ctx);
    SuperviseRequest supervision;
    supervision.timeout = 500ms;
    ASSERT_TRUE(submit(ctx, supervision));
    (void)until([&] { return !supervision.busy(); });
    EXPECT_EQ(words(supervision.error()), "supervising the slaves: timed out") << "it does not wait for the hook alone";
    // The same with a StateRequest.
    StateRequest state;
    state.slave = 1;
    state.wanted = AlState::op;
    state.timeout = 500ms;
    ASSERT_TRUE(submit(ctx, state));
    EXPECT_LT(until([&] { return !state.busy(); }), 1s);
    EXPECT_EQ(words(state.error()), "slave 1: the hook of the application: timed out");
}

}  // namespace
}  // namespace margay
