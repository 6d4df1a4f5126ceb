// The application stops for longer than a second, or its cycles fail and succeed again. No silence shows that meanwhile
// a device of another product took the place of slave 2. The device has the station address, FMMUs and state of slave
// 2.
#include "process_data/identities.hpp"

#include <margay/run.hpp>

namespace margay {
namespace {

struct Pause : Identities {
    Pause() { limits.process_frames = 8; }
    static constexpr std::array kMark{std::byte{0x5A}, std::byte{0xA5}};
    static constexpr std::uint16_t kUserMemory = 0x0F80;
    static constexpr std::uint32_t kAliasWord = 4;
    std::vector<std::byte> sii_of_tool;

    void prepare(AlState state_of_tool) {
        make_like_slave_2(tool, state_of_tool);
        set(tool, 0x0420, 0);  // the watchdog of the tool is off
        const auto now = segment.slave(tool).sii().image();
        sii_of_tool.assign(now.begin(), now.end());
    }
    // Brings the slaves to the same state as the tool.
    void bring_all_to(AlState state) {
        if (state == AlState::op) {
            ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok());
        } else {
            ASSERT_TRUE(writestate(*ctx, 0, state).ok());
            ASSERT_EQ(statecheck(*ctx, 0, state, 1s)->state, state);
        }
        cycles(200);
        ASSERT_EQ(readstate(*ctx)->state, state);
        ASSERT_EQ(state_of(tool), static_cast<int>(state));
    }
    void supervise() {
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(300);
        ASSERT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
        (void)events();
    }
    void exchange() {
        take_out(line[1]);
        put_in(tool);
    }
    // Sends nothing for three seconds, and does not call poll().
    void stop(bool exchanges) {
        osal.advance(1500ms);
        segment.advance(osal.now());
        if (exchanges) exchange();
        segment.reconsider();
        osal.advance(1500ms);
        segment.advance(osal.now());
    }
    void poll_when_due(Duration duration) {
        for (const Time end = osal.now() + duration; osal.now() < end;) {
            const Time next = poll(*ctx, osal.now());
            osal.wait(std::min(next, end), nic->wait_handles());
        }
    }
    void submit_before_pause(RegisterWriteRequest& request, bool exchanges) {
        request.slave = 2;
        request.address = kUserMemory;
        request.data = kMark;
        ASSERT_TRUE(submit(*ctx, request).ok());
        stop(exchanges);
        poll_when_due(400ms);
    }
    void TestBody() override {}  // for tests that use several plants
    void expect_untouched() {
        EXPECT_EQ(segment.slave(tool).peek(kUserMemory, 1)[0], std::byte{0});
        EXPECT_TRUE(std::ranges::equal(segment.slave(tool).sii().image(), sii_of_tool));
        const auto outputs = program(tool).outputs();
        EXPECT_TRUE(outputs.empty() || outputs[0] != std::byte{0xA2});
    }
    void expect_nothing_of_slave_2(int count) {
        for (int n = 0; n < count; ++n) {
            write_outputs();
            EXPECT_FALSE(cycle().ok()) << n;
            EXPECT_FALSE(inputs_fresh(*ctx, 2)) << n;
            ASSERT_FALSE(HasFailure());
        }
        EXPECT_FALSE(all_right(*ctx));
        expect_untouched();
    }
};

// ------------------------------------------------------------------ with a supervision

struct SupervisedPause : Pause, testing::WithParamInterface<AlState> {
    void SetUp() override {
        build();
        prepare(GetParam());
        supervise();
    }
};
TEST_P(SupervisedPause, TheFirstWriteToARegisterIsRefused) {
    stop(true);
    const auto written = write_register(*ctx, 2, kUserMemory, kMark);
    EXPECT_EQ(written.error().slave, 2U) << in_words(written.error());
    expect_untouched();
}
TEST_P(SupervisedPause, TheFirstWriteToTheSiiIsRefused) {
    stop(true);
    const auto written = write_sii(*ctx, 2, kAliasWord, kMark);
    EXPECT_EQ(written.error().slave, 2U) << in_words(written.error());
    expect_untouched();
}
TEST_P(SupervisedPause, TheOtherMachineStaysOutside) {
    stop(true);
    cycles(30);
    for (int n = 0; n < 500; ++n) {
        write_outputs();
        (void)cycle();
        ASSERT_FALSE(inputs_fresh(*ctx, 2)) << n;
        ASSERT_FALSE(all_right(*ctx)) << n;
    }
    expect_untouched();
    EXPECT_EQ(told(events(), "an unexpected slave"), 0);
}
INSTANTIATE_TEST_SUITE_P(States, SupervisedPause, testing::Values(AlState::preop, AlState::safeop, AlState::op));

// The same slaves are present.
TEST_F(Pause, ASupervisionGoesOnWithTheSameSlaves) {
    supervise();
    stop(false);
    ASSERT_TRUE(until([&] { return all_right(*ctx); })) << in_words(what_is_wrong(*ctx));
    EXPECT_TRUE(write_register(*ctx, 2, kUserMemory, kMark).ok());
    EXPECT_EQ(segment.slave(line[1]).peek(kUserMemory, 1)[0], kMark[0]);
}

// A supervision with a long interval, and pauses that are longer than the interval.
TEST_F(Pause, IsNoticedWhereTheSupervisionLooksSeldom) {
    for (const auto& [interval, pause] :
         {std::pair{500ms, 1300ms}, std::pair{500ms, 1800ms}, std::pair{1000ms, 3500ms}}) {
        Pause plant;
        plant.build();
        plant.prepare(AlState::preop);
        ASSERT_TRUE(writestate(*plant.ctx, 0, AlState::preop).ok());
        plant.supervision.interval = interval;
        plant.supervision.target = AlState::preop;
        ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
        plant.poll_when_due(5s);
        plant.osal.advance(pause / 2);
        plant.segment.advance(plant.osal.now());
        plant.exchange();
        plant.segment.reconsider();
        plant.osal.advance(pause / 2);
        plant.segment.advance(plant.osal.now());
        EXPECT_FALSE(write_register(*plant.ctx, 2, kUserMemory, kMark).ok()) << pause.count() << " ms";
        plant.expect_untouched();
    }
}

// The supervision compares the slaves with each roll. Meanwhile correct facts stay correct.
TEST_F(Pause, NothingFlickersWhereTheSupervisionLooksSeldom) {
    for (const auto interval : {1000ms, 1500ms, 3000ms}) {
        Pause plant;
        plant.build();
        ASSERT_TRUE(writestate(*plant.ctx, 0, AlState::preop).ok());
        plant.supervision.interval = interval;
        plant.supervision.target = AlState::preop;
        ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
        plant.poll_when_due(5s);
        unsigned wrong = 0;
        for (const Time end = plant.osal.now() + 10s; plant.osal.now() < end;) {
            const Time next = poll(*plant.ctx, plant.osal.now());
            if (!all_right(*plant.ctx)) ++wrong;
            plant.osal.wait(std::min(next, end), plant.nic->wait_handles());
        }
        EXPECT_EQ(wrong, 0U) << interval.count() << " ms: " << in_words(what_is_wrong(*plant.ctx));
        // The next roll reports a device in the place of slave 2.
        plant.exchange();
        plant.poll_when_due(interval + 1s);
        EXPECT_FALSE(all_right(*plant.ctx));
    }
}

// The supervision compares the slaves after the pause, and the request waits for the comparison.
TEST_F(Pause, ARequestBeforeItIsExecutedBehindIt) {
    supervise();
    RegisterWriteRequest request;
    submit_before_pause(request, false);
    EXPECT_EQ(request.state(), RequestState::success) << in_words(request.error());
    EXPECT_EQ(segment.slave(line[1]).peek(kUserMemory, 1)[0], kMark[0]);
}
TEST_F(Pause, ARequestForAMachineThatIsExchangedInItIsRefused) {
    prepare(AlState::op);
    supervise();
    RegisterWriteRequest request;
    submit_before_pause(request, true);
    EXPECT_EQ(request.state(), RequestState::error);
    expect_untouched();
}

// A call for the other slaves does not wait for the slave that cannot be compared.
TEST_F(Pause, CallsForOtherSlavesDoNotWait) {
    supervise();
    segment.slave(line[1]).sii().fail_next(1'000'000);
    stop(false);
    poll_when_due(400ms);
    const Time before = osal.now();
    std::array<std::byte, 2> address{};
    EXPECT_TRUE(read_register(*ctx, 1, 0x0010, address).ok());
    EXPECT_LT(osal.now() - before, 20ms);
}

// ------------------------------------------------------------------ without a supervision

struct UnsupervisedPause : Pause, testing::WithParamInterface<AlState> {
    void SetUp() override {
        build();
        prepare(GetParam());
        bring_all_to(GetParam());
    }
};
TEST_P(UnsupervisedPause, ReadstateCompares) {
    stop(true);
    const auto read = readstate(*ctx);
    EXPECT_EQ(read.error().code, Errc::other_slave) << in_words(read.error());
    EXPECT_EQ(read.error().slave, 2U);
    EXPECT_FALSE(write_register(*ctx, 2, kUserMemory, kMark).ok());
    expect_nothing_of_slave_2(100);
}
TEST_P(UnsupervisedPause, StatecheckCompares) {
    stop(true);
    const auto checked = statecheck(*ctx, 2, GetParam(), 100ms);
    EXPECT_EQ(checked.error().code, Errc::other_slave) << in_words(checked.error());
    EXPECT_EQ(checked.error().slave, 2U);
    EXPECT_EQ(ctx->slave(2).error.code, Errc::other_slave) << in_words(ctx->slave(2).error);
    expect_nothing_of_slave_2(100);
}
// The application continued its cycle before it called readstate().
TEST_P(UnsupervisedPause, ReadstateComparesAlsoAfterTheFirstCycles) {
    stop(true);
    cycles(50);
    EXPECT_EQ(readstate(*ctx).error().code, Errc::other_slave);
    expect_nothing_of_slave_2(100);
}
INSTANTIATE_TEST_SUITE_P(States, UnsupervisedPause, testing::Values(AlState::preop, AlState::safeop, AlState::op));

// The pause is between two overlapping cycles.
TEST_F(Pause, ReadstateComparesAlsoBesideOverlappedCycles) {
    ctx->group(0).config.cycles_in_flight = 2;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    prepare(AlState::op);
    bring_all_to(AlState::op);
    stop(true);
    cycles(50);
    EXPECT_EQ(readstate(*ctx).error().code, Errc::other_slave);
    expect_nothing_of_slave_2(100);
}

// The EEPROM is read once, and not at each reading of the states.
TEST_F(Pause, ReadstateComparesTheSameSlavesOnce) {
    cycles(200);
    ASSERT_TRUE(readstate(*ctx).ok());
    stop(false);
    EXPECT_TRUE(readstate(*ctx).ok());
    for (const auto device : line) segment.slave(device).sii().fail_next(1'000'000);
    const auto again = readstate(*ctx);
    EXPECT_TRUE(again.ok()) << in_words(again.error());
    EXPECT_TRUE(write_register(*ctx, 2, kUserMemory, kMark).ok());
}
TEST_F(Pause, ReadstateSaysThatTheIdentityCannotBeRead) {
    cycles(200);
    ASSERT_TRUE(readstate(*ctx).ok());
    stop(false);
    segment.slave(line[1]).sii().fail_next(1'000'000);
    for (int n = 0; n < 2; ++n) {
        const auto read = readstate(*ctx);
        EXPECT_EQ(read.error().slave, 2U) << in_words(read.error());
    }
    segment.slave(line[1]).sii().fail_next(0);
    EXPECT_TRUE(readstate(*ctx).ok());
}

// With cycles: the cycles fail, and succeed again with the other machine. {states were read before, states are read
// while the cycles fail}.
struct RightAgain : Pause, testing::WithParamInterface<std::pair<bool, bool>> {};
TEST_P(RightAgain, ReadstateCompares) {
    const auto [before, between] = GetParam();
    prepare(AlState::op);
    ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok());
    cycles(200);
    if (before) {
        ASSERT_TRUE(readstate(*ctx).ok());
    }
    take_out(line[1]);
    segment.reconsider();
    for (int n = 0; n < 1000; ++n) {
        ASSERT_FALSE(cycle().ok()) << n;
        if (between && n == 500) (void)readstate(*ctx);
    }
    put_in(tool);
    segment.reconsider();
    cycles(200);
    const auto read = readstate(*ctx);
    EXPECT_FALSE(read.ok() && read->state == AlState::op);
    EXPECT_EQ(ctx->slave(2).error.code, Errc::other_slave) << in_words(read.error());
    expect_nothing_of_slave_2(100);
}
INSTANTIATE_TEST_SUITE_P(Readings, RightAgain,
                         testing::Values(std::pair{true, false}, std::pair{true, true}, std::pair{false, true},
                                         std::pair{false, false}));

// readstate() does not return OP for a slave whose identity was not read.
TEST_F(Pause, ReadstateSaysNotOpOfASlaveWhoseIdentityIsUnread) {
    prepare(AlState::op);
    bring_all_to(AlState::op);
    take_out(line[1]);
    segment.reconsider();
    cycles(500);
    EXPECT_EQ(readstate(*ctx)->state, AlState::none);
    put_in(tool);
    segment.reconsider();
    cycles(500);
    segment.slave(tool).sii().fail_next(1'000'000);
    for (int n = 0; n < 3; ++n) {
        const auto read = readstate(*ctx);
        EXPECT_FALSE(read.ok()) << n;
        EXPECT_EQ(read.error().slave, 2U) << in_words(read.error());
        EXPECT_FALSE(statecheck(*ctx, 2, AlState::op, Duration{0}).ok());
    }
    EXPECT_FALSE(all_right(*ctx));
}

// ------------------------------------------------------------------ nothing was exchanged

TEST_F(Pause, OwnersThatOnlyWriteNowAndThenAreNotRefused) {
    supervise();
    for (int n = 0; n < 5; ++n) {
        stop(false);
        const auto written = write_register(*ctx, 2, kUserMemory, kMark);
        EXPECT_TRUE(written.ok()) << in_words(written.error());
    }
}

TEST_F(Pause, SlavesThatRestInPreopAreNotStartedAgain) {
    supervision.target = AlState::preop;
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return ctx->slave(2).al.state == AlState::preop; }));
    cycles(300);
    (void)events();
    stop(false);
    cycles(500);
    EXPECT_EQ(events(), std::vector<std::string>{});
}

int begun = 0;
Result<> count_after(HookedSlave, Transition, Moment moment, void*) {
    if (moment == Moment::after) ++begun;
    return Result<>();
}
// Each reading sets the slaves in doubt first.
TEST_F(Pause, WhatFollowsATransitionBeginsWithTheReadingThatSeesIt) {
    prepare(AlState::preop);
    bring_all_to(AlState::preop);
    ctx->slave(2).hooks.transition = count_after;
    begun = 0;
    ASSERT_TRUE(writestate(*ctx, 2, AlState::safeop).ok());
    for (int n = 0; n < 2; ++n) {
        stop(false);
        EXPECT_TRUE(readstate(*ctx).ok());
    }
    cycles(10);
    EXPECT_EQ(begun, 1);
    EXPECT_TRUE(statecheck(*ctx, 2, AlState::safeop, 1s).ok());
}

TEST_F(Pause, ACycleThatIsLostDoubtsNobody) {
    prepare(AlState::op);
    bring_all_to(AlState::op);
    ASSERT_TRUE(readstate(*ctx).ok());
    ASSERT_TRUE(send_processdata(*ctx).ok());
    EXPECT_EQ(receive_processdata(*ctx, Duration{0}).error().code, Errc::no_frame) << "it comes too late";
    cycles(5);
    ReadStateRequest look;
    ASSERT_TRUE(submit(*ctx, look).ok());
    for (int n = 0; n < 50; ++n) {
        EXPECT_TRUE(cycle().ok()) << n;
        EXPECT_TRUE(all_right(*ctx)) << n << " " << in_words(what_is_wrong(*ctx));
    }
    EXPECT_FALSE(look.busy());
    EXPECT_EQ(look.error().code, Errc::none);
}

}  // namespace
}  // namespace margay
