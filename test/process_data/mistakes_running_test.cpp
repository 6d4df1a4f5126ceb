// Mistakes of new users with targets, hooks, requests and the cycle, and the error, warning or event that names each of
// them.
#include "process_data/mistakes.hpp"
#include "util/arena.hpp"

#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST_F(Mistakes, TheTargetOfOneSlaveIsTakenBackByNone) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::none).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
    EXPECT_EQ(set_target(*ctx, 0, AlState::none).error().code, Errc::invalid_argument) << "all slaves have a target";
    const auto unknown = static_cast<AlState>(5);
    EXPECT_EQ(words(set_target(*ctx, 2, unknown).error()),
              "slave 2: requesting a state: argument out of range: the state must be INIT, PREOP, BOOT, SAFEOP or OP");
    EXPECT_EQ(words(set_target(*ctx, 0, unknown).error()),
              "requesting a state: argument out of range: the state must be INIT, PREOP, SAFEOP or OP");
}

// The application has kept one slave at a lower target for a while. This slave does not stay in OP when all slaves go
// down.
TEST_F(Mistakes, TheTargetOfOneSlaveEndsWithOpWhereAllHaveOp) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::safeop);
    ASSERT_TRUE(set_target(*ctx, 2, AlState::safeop).ok()) << "to keep it lower";
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::safeop);
}

// The target of all slaves is already SAFEOP, although the supervision has not read it yet.
TEST_F(Mistakes, TheTargetOfOneSlaveBesideANewTargetOfAll) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    for (const bool waiting : {true, false}) {
        supervision.cancel();
        supervision.target = waiting ? AlState::safeop : AlState::op;
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        if (!waiting) cycles(500);
        supervision.target = AlState::safeop;
        ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
        cycles(500);
        EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
        EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
        ASSERT_TRUE(set_target(*ctx, 2, AlState::none).ok());
    }
}

TEST_F(Mistakes, TheTargetOfOneSlaveAboveALoweredTargetOfAll) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(500);
    ASSERT_TRUE(set_target(*ctx, 0, AlState::safeop).ok());  // the supervision was submitted with OP
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    cycles(500);
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
}

// reach() has ended its own supervision, so nothing reads the states any more.
TEST_F(Mistakes, NothingIsRightForLongWithoutASupervision) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    cycles(500);
    EXPECT_TRUE(all_right(*ctx));
    cycles(1'500);
    EXPECT_FALSE(all_right(*ctx));
    EXPECT_EQ(
        words(what_is_wrong(*ctx)),
        "reading the state: the states of the slaves were read more than a second ago: submit a SuperviseRequest, or "
        "call readstate() again and again");
    ASSERT_TRUE(readstate(*ctx).ok());
    EXPECT_TRUE(all_right(*ctx));
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(2'500);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

TEST_F(Mistakes, AGroupThatIsNotExchangedIsNamed) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->slave(2).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_map(*ctx, second_image, 1).ok());
    supervision.target = AlState::safeop;  // in OP the watchdogs of the slaves would report it
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    for (int n = 0; n < 500; ++n) {
        cycles(1);  // cycles of group 0
        EXPECT_TRUE(all_right(*ctx)) << n << words(what_is_wrong(*ctx));
    }
    cycles(1'500);
    (void)all_right(*ctx);
    cycles(1);
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "exchanging process data of group 1: the group is mapped, but its process data was not exchanged for a "
              "second");
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

// A hook repeats for ever a request that is refused at once, or a wait of zero time.
TEST_F(Mistakes, AHookThatTriesAgainAtOnceStopsNobody) {
    ASSERT_TRUE(config_init(*ctx).ok());
    const Hook<> hooks[] = {
        [](HookedSlave slave, void*) -> Task<> {
            for (;;) {
                auto value = co_await slave.sdo_read<std::uint32_t>(0x1000, 0);
                if (value) co_return Result<>();
            }
        },
        [](HookedSlave slave, void*) -> Task<> {
            std::array<std::byte, 4> into{};
            for (;;) {
                auto read = co_await slave.register_read(0xFFFF, into);
                if (read) co_return Result<>();
            }
        },
        [](HookedSlave slave, void*) -> Task<> {
            for (;;) {
                auto slept = co_await slave.sleep(Duration{-5});
                (void)slept;
            }
        },
    };
    for (const auto& hook : hooks) {
        ctx->slave(2).hooks.preop_to_safeop = hook;
        MapRequest map;
        map.image = image;
        map.timeout = 50ms;
        ASSERT_TRUE(submit(*ctx, map).ok());
        EXPECT_EQ(words(wait(*ctx, map).error()), "slave 2: the hook of the application: timed out");
    }
}

// A hook takes its slave out of PREOP each time the slave is started.
TEST_F(Mistakes, AHookThatTakesItsSlaveToInitIsReportedOnce) {
    ASSERT_TRUE(config_init(*ctx).ok());
    bool wrong = false;
    ctx->slave(2).hooks.user = &wrong;
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        if (!*static_cast<const bool*>(user)) co_return Nothing{};
        const std::array init{std::byte{1}, std::byte{0}};
        auto written = co_await slave.register_write(0x0120, init);
        if (!written) co_return written;
        auto slept = co_await slave.sleep(1s);
        co_return slept;
    };
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    wrong = true;
    (void)all(ctx->errors());
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    unsigned reports = 0;
    for (int n = 0; n < 2'000; ++n) {
        cycles(1);
        while (const auto event = ctx->events().take())
            if (event->kind == EventKind::recovery_failed && event->slave == 2) ++reports;
    }
    EXPECT_EQ(reports, 1U);
    EXPECT_EQ(all(ctx->errors()),
              std::vector<std::string>{
                  "slave 2: requesting a state: the slave is not in the state that is wanted (wanted OP, is in INIT)"});
    wrong = false;
    cycles(1'500);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

// Uses all memory of the sequences until release.
struct Hoard {
    Arena* arena = nullptr;
    std::vector<void*> blocks;
    unsigned tries = 0;
    void take(Arena& from) {
        arena = &from;
        while (void* block = from.allocate(1)) blocks.push_back(block);
    }
    void release() {
        for (void* block : blocks) arena->release(block);
        blocks.clear();
    }
};

Task<> a_sequence_of_its_own(HookedSlave slave) {
    std::array<std::byte, 2> type{};
    auto read = co_await slave.register_read(0x0000, type);
    co_return read;
}

// A hook finds no memory, and tries again until another hook has released some memory.
TEST_F(Mistakes, AHookThatTriesAgainWithoutMemoryStopsNobody) {
    ASSERT_TRUE(config_init(*ctx).ok());
    Hoard hoard;
    ctx->slave(2).hooks.user = &hoard;
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        Hoard& all = *static_cast<Hoard*>(user);
        auto others = co_await slave.sleep(100ms);  // meanwhile the other slave is mapped
        if (!others) co_return others;
        all.take(slave.arena());
        for (;; ++all.tries) {
            auto done = co_await a_sequence_of_its_own(slave);
            if (done) co_return done;
            EXPECT_EQ(done.error().code, Errc::capacity);
            auto slept = co_await slave.sleep(10ms);
            (void)slept;
        }
    };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    for (int n = 0; n < 2'000 && (hoard.blocks.empty() || hoard.tries < 5); ++n) osal.wait(poll(*ctx, osal.now()), -1);
    EXPECT_TRUE(map.busy());
    EXPECT_EQ(hoard.tries, 5U);
    hoard.release();
    const auto mapped = wait(*ctx, map);
    EXPECT_TRUE(mapped.ok()) << words(mapped.error());
    EXPECT_LE(hoard.tries, 6U);
}

TEST_F(Mistakes, ARequestThatWasNotSubmittedCannotBeWaitedFor) {
    ASSERT_TRUE(config_init(*ctx).ok());
    SdoUpload request;
    EXPECT_EQ(words(wait(*ctx, request).error()),
              "SDO upload: not possible in this state (the request was not submitted to this context: call submit())");
}

TEST_F(Mistakes, ARequestThatIsBusySaysSoWhenItIsSubmittedAgain) {
    ScanRequest scan;
    ASSERT_TRUE(submit(*ctx, scan).ok());
    EXPECT_EQ(words(submit(*ctx, scan).error()), "counting slaves: already in progress (a scan is busy)");
    EXPECT_TRUE(wait(*ctx, scan).ok());
}

// The memory that the application has set is too small for any sequence.
TEST(SmallMemory, BothLimitsOfSequencesAreNamed) {
    VirtualOsal osal;
    sim::Segment segment;
    ASSERT_TRUE(segment.connect_master({segment.add(std::move(*sim::make_device("coupler")).assemble()), 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx({.slaves = 2, .arena_bytes = 1024});
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    std::array<char, 400> text{};
    EXPECT_EQ(describe(config_init(ctx).error(), text),
              "counting slaves: not enough memory: Limits::tasks, or Limits::arena_bytes");
    HostContext least({.slaves = 2, .arena_bytes = 1});
    ASSERT_TRUE(init(least, nic, osal).ok());
    EXPECT_EQ(describe(config_init(least).error(), text),
              "counting slaves: not enough memory: Limits::tasks, or Limits::arena_bytes (needed " +
                  std::to_string(1024 * sizeof(void*)) + ", there is room for 64)");
}

TEST_F(Mistakes, ARequestOfAnotherContextCannotBeWaitedFor) {
    sim::Segment other_segment;
    ASSERT_TRUE(
        other_segment.connect_master({other_segment.add(std::move(*sim::make_device("coupler")).assemble()), 0}));
    other_segment.power_up(osal.now());
    SimulatedNic other_nic(other_segment, osal);
    HostContext other;
    ASSERT_TRUE(init(other, other_nic, osal).ok());
    ScanRequest request;
    ASSERT_TRUE(submit(*ctx, request).ok());
    EXPECT_EQ(wait(other, request).error().code, Errc::wrong_state);
    EXPECT_TRUE(request.busy());
    EXPECT_TRUE(wait(*ctx, request).ok());
}

// The supervision is destroyed at the end of its scope, right after submit(). Then nothing supervises the slaves,
// although the program looks correct.
TEST_F(Mistakes, ASupervisionThatIsDestroyedBeforeItBeginsIsReported) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    (void)events();
    {
        SuperviseRequest gone;
        ASSERT_TRUE(submit(*ctx, gone).ok());
    }
    cycles(2);
    EXPECT_EQ(events(), std::vector<std::string>{"the supervision has ended: lost slaves are not brought back"});
}

// Another thread has submitted the supervision, and no poll() has accepted it. The destructor would wait for a poll()
// of its own thread.
TEST_F(Mistakes, TheOwnerCancelsASupervisionThatAnotherThreadHasSubmitted) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    (void)events();
    SuperviseRequest gone;
    std::thread([&] { EXPECT_TRUE(submit(*ctx, gone).ok()); }).join();
    gone.cancel();
    EXPECT_FALSE(gone.busy());
    EXPECT_EQ(gone.error().code, Errc::canceled);
    cycles(2);
    EXPECT_EQ(events(), std::vector<std::string>{"the supervision has ended: lost slaves are not brought back"});
}

TEST_F(Mistakes, ACycleWithinACycleIsRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    Error inner_cycle;
    Error inner_reach;
    const auto nothing = [](const CycleInfo&) { return false; };
    ASSERT_TRUE(run_cycle(*ctx, {}, [&](const CycleInfo&) {
                    inner_cycle = run_cycle(*ctx, {}, nothing).error();
                    inner_reach = reach(*ctx, AlState::op, 1s).error();
                    return false;
                }).ok());
    EXPECT_EQ(inner_cycle.code, Errc::in_callback);
    EXPECT_EQ(inner_reach.code, Errc::in_callback);
    EXPECT_TRUE(run_cycle(*ctx, {}, nothing).ok()) << "afterwards it is allowed again";
}

bool end_at_once(const CycleInfo& cycle) { return cycle.number < 3; }

TEST_F(Mistakes, TheWorkOfACycleMayBeAPlainFunction) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_TRUE(run_cycle(*ctx, {}, end_at_once).ok());
    EXPECT_EQ(ctx->group(0).cycles_sent, 3U);
}

TEST_F(Mistakes, AnOwnerThatExchangesAndNeverPollsIsNamed) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const auto exchange = [&](int cycles) {
        for (int n = 0; n < cycles; ++n) {
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, 1ms);
            osal.advance(1ms);
        }
    };
    exchange(500);
    EXPECT_NE(what_is_wrong(*ctx).code, Errc::not_polled) << "not for long enough";
    exchange(700);
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "exchanging process data: the thread that owns the context does not call poll()");
    (void)poll(*ctx, osal.now());
    EXPECT_NE(what_is_wrong(*ctx).code, Errc::not_polled);
}

TEST_F(Mistakes, ASupervisionThatGoesOutOfScopeIsReported) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(told(events(), "supervision"), 0) << "reach() supervises for itself";
    {
        SuperviseRequest forgotten;
        ASSERT_TRUE(submit(*ctx, forgotten).ok());
        cycles(20);
        EXPECT_EQ(told(events(), "supervision"), 0);
    }
    cycles(1);
    EXPECT_EQ(events(), std::vector<std::string>{"the supervision has ended: lost slaves are not brought back"});
}

TEST_F(Mistakes, ASlaveWithoutPowerExistsAndDoesNotAnswer) {
    ASSERT_TRUE(config_init(*ctx).ok());
    power(1, false);
    EXPECT_EQ(words(recover_slave(*ctx, 2).error()),
              "slave 2: recovering the slave: the slave does not answer: check its power and its cable");
    EXPECT_EQ(words(recover_slave(*ctx, 3).error()),
              "slave 3: recovering the slave: there is no such slave (there are 2)");
}

TEST_F(Mistakes, ALostSlaveIsNotSaidToBeExpectedWhereNoneIs) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    power(1, false);
    EXPECT_EQ(words(reach(*ctx, AlState::op, 100ms).error()), "slave 2: reading the state: the slave is missing");
    EXPECT_EQ(words(what_is_wrong(*ctx)), "slave 2: reading the state: the slave is missing");
}

TEST_F(Mistakes, ARefusedRequestNamesNoOtherObject) {
    ASSERT_TRUE(config_init(*ctx).ok());
    SdoUpload request;
    request.slave = 1;
    request.index = 0x606C;
    request.priority = 9;
    const auto refused = words(submit(*ctx, request).error());
    EXPECT_EQ(refused.find("0x0000"), std::string::npos) << refused;
}

TEST_F(Mistakes, ASlaveOnItsWayIsNotSaidToHaveTimedOut) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "slave 1: requesting a state: the slave is not in the state that is wanted (wanted OP, is in SAFEOP)");
}

}  // namespace
}  // namespace margay
