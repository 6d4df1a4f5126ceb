// Targets of slaves, reach(), all_right() and run_cycle().
#include "process_data/line_of_three.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class Reach : public LineOfThree {};

TEST_F(Reach, LoweringTheTargetOfTheSupervisionBringsTheSlavesDownAndUpAgain) {
    ASSERT_TRUE(scan({}).ok());
    run();
    supervision.target = AlState::safeop;
    cycles(300);
    for (const Slave& slave : ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::safeop) << slave.number;
    auto story = events();
    EXPECT_EQ(told(story, "recovered"), 0) << joined(story);
    EXPECT_EQ(told(story, "OP to SAFEOP"), 3) << joined(story);
    EXPECT_EQ(story.size(), 3U) << joined(story);
    EXPECT_EQ(ctx->events().dropped(), 0U);
    EXPECT_EQ(*cycle(), 9U);
    supervision.target = AlState::op;
    ASSERT_TRUE(until([&] { return all_in_op(); }));
    story = events();
    EXPECT_EQ(told(story, "recovered"), 0) << joined(story);
}

TEST_F(Reach, LoweringTheHighestStateOfASlaveBringsItDown) {
    ASSERT_TRUE(scan({}).ok());
    run();
    ctx->slave(2).config.highest = AlState::preop;
    cycles(300);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    EXPECT_EQ(*cycle(), 6U) << "it is not wanted in the exchange any more";
    ctx->slave(3).config.highest = AlState::safeop;
    cycles(300);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::safeop);
    auto story = events();
    EXPECT_EQ(told(story, "recovered"), 0) << joined(story);
    EXPECT_LE(story.size(), 6U) << joined(story);
    ctx->slave(2).config.highest = AlState::op;
    ctx->slave(3).config.highest = AlState::op;
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    EXPECT_EQ(*cycle(), 9U);
}

TEST_F(Reach, TargetsAreReachedInBothDirectionsUnderSupervision) {
    ASSERT_TRUE(scan({}).ok());
    run();
    for (const AlState state : {AlState::preop, AlState::op, AlState::init, AlState::safeop, AlState::op}) {
        ASSERT_TRUE(set_target(*ctx, 2, state).ok());
        ASSERT_TRUE(until([&] { return ctx->slave(2).al.state == state && all_right(*ctx); })) << to_text(state) << "\n"
                                                                                               << joined(events());
        cycles(20);
        EXPECT_EQ(ctx->slave(2).al, (AlStatus{state, false, 0}));
        EXPECT_TRUE(in_op(1) && in_op(3)) << "the others stay";
        EXPECT_EQ(*cycle(), state < AlState::safeop ? 6U : 9U) << "what is wanted is counted";
        EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
        const auto story = events();
        EXPECT_EQ(told(story, "recovered"), 0) << joined(story);
        EXPECT_LE(story.size(), 8U) << joined(story);
    }
    expect_exchanged(2, line[1]);
    for (const AlState state : {AlState::init, AlState::op}) {
        ASSERT_TRUE(set_target(*ctx, 0, state).ok());
        ASSERT_TRUE(until([&] {
            return std::ranges::all_of(ctx->slaves(), [&](const Slave& s) { return s.al.state == state; });
        })) << to_text(state);
    }
    EXPECT_EQ(set_target(*ctx, 1, AlState::boot).error().code, Errc::unsupported) << "it has no bootstrap mailboxes";
    EXPECT_EQ(set_target(*ctx, 0, AlState::boot).error().code, Errc::invalid_argument);
    EXPECT_EQ(set_target(*ctx, 9, AlState::op).error().code, Errc::unknown_slave);
}

TEST_F(Reach, TargetsAreReachedWithoutASupervisionToo) {
    ASSERT_TRUE(scan({}).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(set_target(*ctx, 3, AlState::preop).ok());
    EXPECT_EQ(ctx->slave(3).al.state, AlState::preop);
    ASSERT_TRUE(set_target(*ctx, 0, AlState::init).ok());
    for (const Slave& slave : ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::init);
    ASSERT_TRUE(set_target(*ctx, 0, AlState::safeop).ok());
    for (const Slave& slave : ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::safeop);
    EXPECT_EQ(*cycle(), 9U);
}

TEST_F(Reach, ReachWithoutAMappingNamesTheMissingCall) {
    ASSERT_TRUE(config_init(*ctx).ok());
    std::array<char, 300> text{};
    const auto words = [&] { return std::string(describe(reach(*ctx, AlState::op, 1s).error(), text)); };
    EXPECT_EQ(words(), "requesting a state: nothing is mapped: call config_map()");
    EXPECT_EQ(reach(*ctx, AlState::preop, 1s).error().code, Errc::none);
    ctx->slave(2).config.group = 9;
    EXPECT_EQ(words(), "requesting a state: nothing is mapped: call config_map()") << "what the first slave needs";
    for (const Slave& slave : ctx->slaves()) slave.config.group = 9;
    EXPECT_NE(words().find("there is no such group"), std::string::npos) << words();
}

TEST_F(Reach, ReachBringsAllSlavesThereWithCyclesBesideIt) {
    HostContext fresh;
    EXPECT_EQ(reach(fresh, AlState::op, 1s).error().code, Errc::wrong_state);
    ASSERT_TRUE(scan({}).ok());
    EXPECT_EQ(reach(*ctx, AlState::op, 1s).error().code, Errc::unknown_group) << "nothing is mapped";
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_FALSE(all_right(*ctx));
    const auto done = reach(*ctx, AlState::op, 5s);
    ASSERT_TRUE(done.ok()) << words(done.error());
    EXPECT_TRUE(all_in_op());
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 5s).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());  // the target of this request is OP
    ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok()) << "beside a supervision";
    ASSERT_TRUE(reach(*ctx, AlState::init, 5s).ok());
    for (const Slave& slave : ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::init);
    EXPECT_EQ(reach(*ctx, AlState::boot, 5s).error().code, Errc::invalid_argument);
}

TEST_F(Reach, ReachNamesTheFirstSlaveThatIsNotThere) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x1FF}, {.number = 3}};
    EXPECT_EQ(scan(expected).error().slave, 2);
    (void)config_map(*ctx, image);
    const Time begin = osal.now();
    const auto held = reach(*ctx, AlState::op, 60s);
    EXPECT_EQ(held.error().code, Errc::other_slave);
    EXPECT_EQ(held.error().slave, 2);
    EXPECT_LT(osal.now() - begin, 5s) << "waiting does not help";
    EXPECT_TRUE(in_op(1) && in_op(3)) << "what can be done is done";
    power(line[2], false);
    const auto lost = reach(*ctx, AlState::op, 2s);
    EXPECT_EQ(lost.error().slave, 2);
    ASSERT_TRUE(tolerate(*ctx, {.other_slaves = true}));
    ASSERT_FALSE(config_map(*ctx, image).ok());
    const auto missing = reach(*ctx, AlState::op, 2s);
    EXPECT_EQ(words(missing.error()), "slave 3: comparing with what is expected: the slave is missing");
    EXPECT_TRUE(in_op(1) && in_op(2));
}

TEST_F(Reach, AllRightIsFalseForEveryThingThatIsNot) {
    ASSERT_TRUE(scan({}).ok());
    run();
    ASSERT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    segment.set_noise({.lost = 1});
    (void)cycle();
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::no_frame);
    segment.set_noise({});
    cycles(5);
    ASSERT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    power(line[2], false);
    (void)cycle();
    EXPECT_FALSE(all_right(*ctx)) << "in the very cycle";
    cycles(5);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 3);
    power(line[2], true);
    ASSERT_TRUE(until([&] { return all_right(*ctx); })) << words(what_is_wrong(*ctx));
    EXPECT_TRUE(all_in_op());
}

TEST_F(Reach, TheCycleRunsUntilItsWorkHasHadEnough) {
    ASSERT_TRUE(scan({}).ok());
    EXPECT_EQ(run_cycle(*ctx, {}, [](const CycleInfo&) { return false; }).error().code, Errc::unknown_group);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const Time begin = osal.now();
    std::uint64_t first_right = 0;
    const auto done = run_cycle(*ctx, {.period = 2ms}, [&](const CycleInfo& cycle) {
        EXPECT_EQ(cycle.due, begin + static_cast<int>(cycle.number - 1) * 2ms);
        if (first_right == 0 && all_right(*ctx)) first_right = cycle.number;
        return cycle.number < 500;
    });
    EXPECT_TRUE(done.ok());
    EXPECT_GT(first_right, 0U);
    EXPECT_TRUE(all_in_op());
    EXPECT_EQ(ctx->group(0).cycles_sent, 500U);
    EXPECT_EQ(run_cycle(*ctx, {.period = Duration{0}}, [](const CycleInfo&) { return false; }).error().code,
              Errc::invalid_argument);
}

// A mapping or a scan is executed during the cycle and may fail. No cycle succeeds while nothing is exchanged.
TEST_F(Reach, TheCycleReportsThatItsGroupIsNotMappedAnyMore) {
    ASSERT_TRUE(scan({}).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    for (const bool by_scan : {false, true}) {
        std::array<std::byte, 1> too_small{};
        const auto done = run_cycle(*ctx, {}, [&](const CycleInfo& cycle) {
            EXPECT_EQ(cycle.error.code, cycle.number <= 3 ? Errc::none : Errc::unknown_group) << cycle.number;
            const bool now = cycle.number == 3;
            EXPECT_EQ(now && by_scan ? config_init(*ctx).error().code : Errc::none, Errc::none);
            EXPECT_EQ(now && !by_scan ? config_map(*ctx, too_small).error().code : Errc::image_too_large,
                      Errc::image_too_large);
            return cycle.number < 20;
        });
        EXPECT_TRUE(done.ok());
        ASSERT_TRUE(config_map(*ctx, image).ok());
    }
}

// The same while another group continues.
TEST_F(Reach, TheCycleReportsThatOneOfItsGroupsIsNotMappedAnyMore) {
    limits.process_frames = 2;
    ctx = std::make_unique<HostContext>(limits);
    ASSERT_TRUE(init(*ctx, *nic, osal).ok());
    ASSERT_TRUE(scan({}).ok());
    ctx->slave(3).config.group = 1;
    std::array<std::byte, 16> second{};
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_map(*ctx, second, 1).ok());
    ctx->group(1).config.cycles_in_flight = 2;  // too many frames
    EXPECT_EQ(config_map(*ctx, second, 1).error().code, Errc::too_many_frames);
    EXPECT_TRUE(ctx->group(0).mapped);
    const auto done = run_cycle(*ctx, {}, [&](const CycleInfo& cycle) {
        EXPECT_EQ(cycle.error.code, Errc::unknown_group);
        EXPECT_EQ(cycle.error.index, 1) << "the group";
        return cycle.number < 3;
    });
    EXPECT_TRUE(done.ok());
}

TEST_F(Reach, AReachWithAShortTimeoutSucceedsWhereAllIsWell) {
    ASSERT_TRUE(scan({}).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok());
    const auto again = reach(*ctx, AlState::op, 1ms);
    EXPECT_TRUE(again.ok()) << words(again.error());
    EXPECT_EQ(reach(*ctx, AlState::op, -1ms).error().code, Errc::invalid_argument);
    for (const auto number : line) power(number, false);
    const auto dark = reach(*ctx, AlState::op, 100ms);
    EXPECT_EQ(dark.error().code, Errc::nic) << words(dark.error());  // the first cable has no link
}

// A program whose work takes longer than the period: everything else must still progress. Before, its slaves stayed in
// SAFEOP without any report, because poll() was not called.
TEST_F(Reach, WorkThatIsLongerThanThePeriodLetsEverythingElseGoOn) {
    ASSERT_TRUE(scan({}).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    std::uint64_t left_out = 0;
    const auto done = run_cycle(*ctx, {.period = 1ms}, [&](const CycleInfo& cycle) {
        osal.advance(3500us);
        left_out = cycle.left_out;
        return cycle.number < 1000 && !(all_in_op() && cycle.number > 600);
    });
    EXPECT_TRUE(done.ok());
    EXPECT_TRUE(all_in_op());
    EXPECT_GE(left_out, 1000U);
    const auto story = events();
    EXPECT_GE(told(story, "the work of a cycle takes longer than its period"), 2) << joined(story);
    EXPECT_LE(told(story, "the work of a cycle takes longer than its period"), 5) << "once a second";
}

}  // namespace
}  // namespace margay
