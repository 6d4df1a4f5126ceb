// A device has the station address, the FMMUs and the state of a slave that is away. Before the identity was compared,
// no data for this slave reaches the device, and no data of the device counts as data of this slave.
#include "process_data/identities.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {
namespace {

constexpr std::array kOctets{std::byte{0x5A}, std::byte{0xA5}};
constexpr std::uint16_t kRegister = 0x0F80;

struct DoubtedDevices : Identities {
    void bring_all_to_safeop() {
        ASSERT_TRUE(writestate(*ctx, 0, AlState::safeop).ok());
        ASSERT_EQ(statecheck(*ctx, 0, AlState::safeop, 1s)->state, AlState::safeop);
    }
    void exchange_after_a_pause() {
        take_out(line[1]);
        osal.advance(10s);
        put_in(tool);
        osal.advance(10s);
        cycles(5);
    }
    void supervise_for_a_while() {
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(500);
        (void)events();
    }
    // No frame comes back for a second. Meanwhile the tool takes the place of slave 2.
    void exchange_in_a_silence(AlState state) {
        segment.disconnect({line[0], 0});
        cycles(1000);
        make_like_slave_2(tool, state);
        take_out(line[1]);
        put_in(tool);
        ASSERT_TRUE(segment.connect_master({line[0], 0}));
        segment.reconsider();
    }
    // Returns how many of five writes to a register of slave 2 succeed.
    int writes() {
        int succeeded = 0;
        for (int k = 0; k < 5; ++k) {
            RegisterWriteRequest request;
            request.slave = 2;
            request.address = kRegister;
            request.data = kOctets;
            if (!submit(*ctx, request)) continue;
            for (int n = 0; n < 100 && request.busy(); ++n) (void)cycle();
            succeeded += request.state() == RequestState::success ? 1 : 0;
            cycles(300);
        }
        return succeeded;
    }
    void expect_untouched() { EXPECT_EQ(segment.slave(tool).peek(kRegister, 1)[0], std::byte{0}); }
};

TEST_F(DoubtedDevices, SetTargetAfterAPauseComparesFirst) {
    bring_all_to_safeop();
    make_like_slave_2(tool, AlState::safeop);
    exchange_after_a_pause();
    EXPECT_EQ(set_target(*ctx, 2, AlState::op).error().code, Errc::other_slave);
    EXPECT_FALSE(gets_outputs(tool));
    EXPECT_NE(state_of(tool), 8);
}

TEST_F(DoubtedDevices, SetTargetOfAllAfterAPauseComparesFirst) {
    bring_all_to_safeop();
    make_like_slave_2(tool, AlState::safeop);
    exchange_after_a_pause();
    TargetRequest request;
    request.wanted = AlState::op;
    ASSERT_TRUE(submit(*ctx, request).ok());
    for (int n = 0; n < 1000; ++n) {
        write_outputs();
        (void)cycle();
        ASSERT_NE(state_of(tool), 8) << n;
    }
    EXPECT_EQ(request.error().slave, 2U) << in_words(request.error());
}

TEST_F(DoubtedDevices, AfterRecoverSlaveTheSlaveIsWrittenAgain) {
    power(line[1], false);
    (void)readstate(*ctx);
    (void)readstate(*ctx);
    EXPECT_EQ(write_register(*ctx, 2, kRegister, kOctets).error().code, Errc::missing_slave);
    power(line[1], true);
    settle_devices();
    ASSERT_TRUE(recover_slave(*ctx, 2).ok());
    const auto written = write_register(*ctx, 2, kRegister, kOctets);
    EXPECT_TRUE(written.ok()) << in_words(written.error());
}

TEST_F(DoubtedDevices, NoRegisterIsWrittenAfterASilence) {
    supervise_for_a_while();
    segment.slave(tool).sii().fail_next(100'000'000);
    exchange_in_a_silence(AlState::safeop);
    EXPECT_EQ(writes(), 0);
    expect_untouched();
}

TEST_F(DoubtedDevices, NoRegisterOfALostSlaveIsWritten) {
    supervise_for_a_while();
    make_like_slave_2(tool, AlState::safeop);
    segment.slave(tool).sii().fail_next(100'000'000);
    take_out(line[1]);
    cycles(1000);
    put_in(tool);
    cycles(1000);
    EXPECT_EQ(writes(), 0);
    expect_untouched();
}

// A hook after a transition that was requested for slave 2.
TEST_F(DoubtedDevices, WhatFollowsATransitionWaitsForTheComparison) {
    ASSERT_TRUE(writestate(*ctx, 2, AlState::preop).ok());
    ASSERT_EQ(statecheck(*ctx, 2, AlState::preop, 1s)->state, AlState::preop);
    make_like_slave_2(tool, AlState::safeop);
    ctx->slave(2).hooks.transition = [](HookedSlave slave, Transition which, Moment moment, void*) -> Task<> {
        if (which != Transition::preop_to_safeop || moment != Moment::after) co_return Result<>();
        co_return co_await slave.register_write(kRegister, kOctets);
    };
    ASSERT_TRUE(writestate(*ctx, 2, AlState::safeop).ok());
    take_out(line[1]);
    (void)readstate(*ctx);
    put_in(tool);
    (void)readstate(*ctx);
    cycles(20);
    expect_untouched();
}

// A hook before a transition waits for three seconds, and meanwhile the devices are exchanged.
struct BehindAHook : DoubtedDevices {
    Transition waits_at{};
    void wait_in_hook_at(Transition which) {
        waits_at = which;
        ctx->slave(2).hooks.user = &waits_at;
        ctx->slave(2).hooks.transition = [](HookedSlave slave, Transition now, Moment moment, void* user) -> Task<> {
            if (now != *static_cast<Transition*>(user) || moment != Moment::before) co_return Result<>();
            co_return co_await slave.sleep(3s);
        };
    }
    // The state of the tool stays as it is now, or becomes lower.
    void expect_not_driven(int cycles_to_watch) {
        const int state = state_of(tool);
        for (int n = 0; n < cycles_to_watch; ++n) {
            write_outputs();
            (void)cycle();
            ASSERT_LE(state_of(tool), state) << n;
            const auto outputs = program(tool).outputs();
            ASSERT_TRUE(outputs.empty() || outputs[0] != std::byte{0xA2}) << n;
        }
    }
};
TEST_F(BehindAHook, AStateRequestComparesAgain) {
    bring_all_to_safeop();
    wait_in_hook_at(Transition::safeop_to_op);
    make_like_slave_2(tool, AlState::safeop);
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    request.timeout = 20s;
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(100);
    take_out(line[1]);
    cycles(20);
    put_in(tool);
    for (int n = 0; n < 4000 && request.busy(); ++n) (void)cycle();
    EXPECT_EQ(request.error().code, Errc::other_slave) << in_words(request.error());
    EXPECT_NE(state_of(tool), 8);
}
TEST_F(BehindAHook, AWriteOfTheStateComparesAgain) {
    bring_all_to_safeop();
    wait_in_hook_at(Transition::safeop_to_op);
    make_like_slave_2(tool, AlState::safeop);
    WriteStateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(100);
    take_out(line[1]);
    cycles(20);
    put_in(tool);
    for (int n = 0; n < 4000; ++n) (void)cycle();
    EXPECT_EQ(request.error().code, Errc::other_slave) << in_words(request.error());
    EXPECT_NE(state_of(tool), 8);
}
struct BehindAHookInASilence : BehindAHook, testing::WithParamInterface<AlState> {};
TEST_P(BehindAHookInASilence, TheSupervisionComparesAgain) {
    supervise_for_a_while();
    const bool from_preop = GetParam() == AlState::preop;
    wait_in_hook_at(from_preop ? Transition::preop_to_safeop : Transition::safeop_to_op);
    ASSERT_TRUE(set_target(*ctx, 2, GetParam()).ok());
    cycles(300);
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    cycles(300);
    exchange_in_a_silence(GetParam());
    expect_not_driven(5000);
}
INSTANTIATE_TEST_SUITE_P(From, BehindAHookInASilence, testing::Values(AlState::preop, AlState::safeop));

// The EEPROM of the tool cannot be read. The other slaves continue. No cycle succeeds, and no input counts as input of
// slave 2.
struct UnreadableInPlaceOfSlave2 : DoubtedDevices {
    void watch() {
        program(tool).inputs()[0] = std::byte{0x77};
        program(tool).poke();
        const std::byte before = ctx->slave(2).image.inputs.bytes[0];
        int right = 0;
        int fresh = 0;
        int with_outputs = 0;
        for (int n = 0; n < 5'000; ++n) {
            write_outputs();
            right += cycle().ok() ? 1 : 0;
            fresh += inputs_fresh(*ctx, 2) ? 1 : 0;
            with_outputs += program(tool).outputs()[0] == std::byte{0xA2} ? 1 : 0;
            ASSERT_FALSE(all_right(*ctx)) << n;
            ASSERT_EQ(ctx->slave(2).image.inputs.bytes[0], before) << n;
        }
        EXPECT_EQ(right, 0);
        EXPECT_EQ(fresh, 0);
        EXPECT_LT(with_outputs, 300) << "the FMMUs are cleared when the EEPROM has not answered for its time";
        EXPECT_TRUE(inputs_fresh(*ctx, 1) && inputs_fresh(*ctx, 3)) << joined(events());
    }
};
TEST_F(UnreadableInPlaceOfSlave2, AfterASilence) {
    supervise_for_a_while();
    segment.slave(tool).sii().fail_next(100'000'000);
    exchange_in_a_silence(AlState::op);
    watch();
}
TEST_F(UnreadableInPlaceOfSlave2, AfterItWasLost) {
    supervise_for_a_while();
    segment.slave(tool).sii().fail_next(100'000'000);
    take_out(line[1]);
    cycles(1000);
    make_like_slave_2(tool, AlState::op);
    put_in(tool);
    watch();
}

}  // namespace
}  // namespace margay
