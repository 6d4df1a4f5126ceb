// A slave whose commands or hook after a transition have failed or were cancelled has not reached the wanted condition.
#include "api/slow_hook.hpp"

#include <algorithm>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Unfinished : public HookTest {
  protected:
    SlaveSetup setup;
    SlaveConfiguration config{.setup = &setup};
    std::array<ExpectedSlave, 2> expected{ExpectedSlave{.number = 1}, ExpectedSlave{.number = 2, .config = &config}};

    void begin(bool by_expect = false) {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        ASSERT_TRUE(init(ctx, wire, osal));
        if (by_expect) {
            ASSERT_TRUE(expect(ctx, expected));
        }
        found = config_init(ctx).error();
    }
    Error found;
    std::string reached(Duration timeout = 3s) { return words(reach(ctx, AlState::op, timeout).error()); }
    static constexpr std::string_view kRefused =
        "object 0x5555:1): the slave aborted the transfer (abort code 0x06020000";
};

// A command of IP fails: at the scan, at the mapping, and in reach().
TEST_F(Unfinished, ACommandOfIpKeepsTheSlaveInPreop) {
    static constexpr StartupCommand kWrong[] = {write_object(Transition::init_to_preop, 0x5555, 1, std::uint8_t{1})};
    setup.startup = kWrong;
    begin(true);
    EXPECT_NE(words(found).find(kRefused), std::string::npos) << words(found);
    const Error mapped = config_map(ctx, image).error();
    EXPECT_NE(words(mapped).find(kRefused), std::string::npos) << words(mapped);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::preop);
    EXPECT_FALSE(ctx.slave(2).takes_part);
    EXPECT_NE(reached().find(kRefused), std::string::npos);
    EXPECT_FALSE(all_right(ctx));
    EXPECT_EQ(ctx.slave(2).al.state, AlState::preop);
    EXPECT_EQ(ctx.slave(1).al.state, AlState::op);
    setup.startup = {};
    EXPECT_EQ(reached(), "no error");
}

// Commands after PREOP to SAFEOP and after SAFEOP to OP.
TEST_F(Unfinished, ACommandAfterATransitionIsNotSkippedByTheNextAttempt) {
    for (const Transition which : {Transition::preop_to_safeop, Transition::safeop_to_op}) {
        const StartupCommand wrong[] = {write_object(which, 0x5555, 1, std::uint8_t{1}).afterwards()};
        setup.startup = wrong;
        if (ctx.slaves().empty()) begin();
        ctx.slave(2).config.setup = &setup;
        (void)config_map(ctx, image);
        while (ctx.events().take()) {
        }
        const std::string text = reached();
        EXPECT_NE(text.find(kRefused), std::string::npos) << text;
        EXPECT_FALSE(all_right(ctx));
        SuperviseRequest supervision;
        ASSERT_TRUE(submit(ctx, supervision));
        EXPECT_NE(reached(5s).find(kRefused), std::string::npos);
        bool told = false;
        while (const auto event = ctx.events().take()) {
            EXPECT_FALSE(event->kind == EventKind::recovered && event->slave == 2);
            told |= event->kind == EventKind::recovery_failed && event->slave == 2;
        }
        EXPECT_TRUE(told);
        setup.startup = {};
        EXPECT_EQ(reached(), "no error");
        EXPECT_TRUE(all_right(ctx));
        supervision.cancel();
        setup.startup = {};
        ctx.slave(2).config.setup = nullptr;
        ASSERT_TRUE(set_target(ctx, 0, AlState::preop));
    }
}

// reach() waits for the hook after the transition.
TEST_F(Unfinished, ReachWaitsForTheHookAfterTheTransition) {
    begin();
    SlowHook slow{.lasts = 300ms, .slave = 2};
    slow.set(ctx);
    ASSERT_TRUE(config_map(ctx, image));
    EXPECT_EQ(reached(), "no error");
    EXPECT_EQ(slow.ended, 1);
    // The timeout of reach() ends a hook, and the library remembers the unfinished hook.
    ASSERT_TRUE(set_target(ctx, 0, AlState::preop));
    slow.lasts = 1h;
    EXPECT_EQ(
        reached(1s),
        "slave 2: the hook of the application: the commands or the hook after the transition have not ended, or were "
        "ended early");
    EXPECT_FALSE(all_right(ctx));
    slow.lasts = 10ms;
    EXPECT_EQ(reached(), "no error");
    EXPECT_EQ(slow.ended, 2);
}

// The hook after SAFEOP to OP fails. The application can still lower the slave and start it again by hand.
struct Fails {
    bool now = true;
    static Result<> hook(HookedSlave slave, Transition which, Moment when, void* user) {
        const bool here = slave.number() == 2 && which == Transition::safeop_to_op && when == Moment::after;
        return here && static_cast<Fails*>(user)->now ? Result<>(Error{.code = Errc::check_failed}) : Result<>();
    }
};
TEST_F(Unfinished, ASlaveWithAFailedHookCanBeLowered) {
    begin();
    Fails fails;
    ctx.slave(2).hooks.user = &fails;
    ctx.slave(2).hooks.transition = Fails::hook;
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    EXPECT_FALSE(reach(ctx, AlState::op, 2s));
    for (const AlState lower : {AlState::safeop, AlState::preop, AlState::init}) {
        ASSERT_TRUE(set_target(ctx, 0, lower));
        EXPECT_TRUE(reach(ctx, lower, 3s)) << words(reach(ctx, lower, 1s).error());
        EXPECT_EQ(ctx.slave(2).al.state, lower);
    }
    fails.now = false;
    EXPECT_EQ(reached(), "no error");
}

// The state change is cancelled while the slave is on its way to OP. The library remembers the unfinished commands and
// hooks.
TEST_F(Unfinished, AStateChangeThatIsCutIsNotFinished) {
    begin();
    SlowHook slow{.lasts = 10ms, .slave = 2};
    ctx.slave(2).hooks.user = &slow;
    ctx.slave(2).hooks.transition = SlowHook::hook;
    ASSERT_TRUE(config_map(ctx, image));
    for (int cut = 1; cut < 60; ++cut) {
        ASSERT_TRUE(set_target(ctx, 0, AlState::safeop));
        slow.ended = 0;
        (void)reach(ctx, AlState::op, std::chrono::microseconds(100) * cut);
        EXPECT_EQ(reached(), "no error") << cut;
        EXPECT_GE(slow.ended, 1) << "cut after " << cut << " times 0.1 ms";
    }
}

}  // namespace
}  // namespace margay
