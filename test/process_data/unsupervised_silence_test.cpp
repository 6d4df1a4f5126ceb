// No frame comes back for a while, and no supervision is active. Meanwhile another device takes the place of slave 2,
// with the station address, FMMUs and state of slave 2. The first call that finds the silence sets all slaves in doubt,
// and the identities are compared before anything is written.
#include "process_data/silence.hpp"

#include <margay/hooked_slave.hpp>
#include <margay/run.hpp>

namespace margay {
namespace {

constexpr std::array kValue{std::byte{0x5A}, std::byte{0xA5}};
constexpr std::uint16_t kFreeRegister = 0x0F80;
constexpr int kShort = 40;  // cycles

struct UnsupervisedSilence : Silence {
    void SetUp() override {
        listed = false;
        build();
        // No cycle is executed during a call that waits.
        for (const auto device : line) switch_watchdog_off(device);
        cycles(20);
        ASSERT_TRUE(readstate(*ctx).ok());
    }
    void switch_watchdog_off(std::uint32_t device) { set(device, 0x0420, 0); }
    // Configures the device as slave 2 is configured.
    void prepare(std::uint32_t device) {
        make_like_slave_2(device, AlState::op);
        switch_watchdog_off(device);
    }
    void silence() {
        begin_silence();
        cycles(kShort);
        end_silence();
        cycles(2);
    }
    // Like silence_with_exchange(). If the device is slave 2 itself, there is no exchange.
    void silence(std::uint32_t device) {
        if (device == line[1]) return silence();
        prepare(device);
        silence_with_exchange(device);
    }
    // After the silence another device, or slave 2 itself, is in this place. Its SII cannot be read until fail_next(0).
    auto& silence_with_unreadable_sii(bool other) {
        constexpr int kReadings = 1000;
        const auto device = other ? tool : line[1];
        silence(device);
        auto& sii = segment.slave(device).sii();
        sii.fail_next(kReadings);
        return sii;
    }
    void silence_with_exchange(std::uint32_t device, int length = kShort) {
        begin_silence();
        take_out_slave_2();
        put_in(device);
        segment.reconsider();
        cycles(length);
        end_silence();
        cycles(2);
    }
    void expect_nothing_written() {
        EXPECT_EQ(segment.slave(tool).peek(kFreeRegister, 1)[0], std::byte{0}) << "the other device was written to";
    }
    void expect_slave_2_is_known_to_be_another() {
        write_outputs();
        expect_no_outputs_of_slave_2(100);
        EXPECT_FALSE(cycle().ok());
        EXPECT_FALSE(all_right(*ctx));
        EXPECT_FALSE(inputs_fresh(*ctx, 2));
    }
    void expect_all_right() {
        cycles(3);
        EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
        for (std::uint16_t slave = 1; slave <= 3; ++slave) EXPECT_TRUE(inputs_fresh(*ctx, slave)) << slave;
    }
};

// ------------------------------------------------------------------ readstate() and statecheck()

TEST_F(UnsupervisedSilence, ReadstateCompares) {
    for (const int length : {30, 100, 900}) {
        UnsupervisedSilence one;
        one.SetUp();
        one.prepare(one.tool);
        one.silence_with_exchange(one.tool, length);
        const auto read = readstate(*one.ctx);
        EXPECT_EQ(read.error().code, Errc::other_slave) << length << ": " << in_words(read.error());
        const auto again = readstate(*one.ctx);
        EXPECT_FALSE(again.ok() && again->state == AlState::op) << length;
        one.expect_slave_2_is_known_to_be_another();
    }
}

// Another call has already found the silence.
struct AfterAnotherCall : UnsupervisedSilence {
    using Call = void (*)(Context& of);
    static constexpr std::pair<const char*, Call> kCalls[] = {
        {"a register that is not written",
         [](Context& of) {
             EXPECT_EQ(write_register(of, 1, kFreeRegister, kValue).error().code, Errc::identity_unread);
         }},
        {"an object", [](Context& of) { EXPECT_FALSE(SDOread<std::uint16_t>(of, 1, 0x1000, 0).ok()); }},
        {"the state of slave 1", [](Context& of) { EXPECT_TRUE(writestate(of, 1, AlState::op).ok()); }},
    };
};
TEST_F(AfterAnotherCall, ReadstateFindsTheOtherDevice) {
    for (const auto& [name, call] : kCalls) {
        SCOPED_TRACE(name);
        AfterAnotherCall one;
        one.SetUp();
        one.prepare(one.tool);
        one.silence_with_exchange(one.tool);
        call(*one.ctx);
        const auto read = readstate(*one.ctx);
        EXPECT_EQ(read.error().code, Errc::other_slave) << in_words(read.error());
        EXPECT_EQ(read.error().slave, 2);
        one.expect_slave_2_is_known_to_be_another();
    }
}
TEST_F(AfterAnotherCall, ReadstateFindsThatTheSlavesAreTheSame) {
    for (const auto& [name, call] : kCalls) {
        SCOPED_TRACE(name);
        AfterAnotherCall one;
        one.SetUp();
        one.silence();
        call(*one.ctx);
        one.cycles(1);
        EXPECT_EQ(what_is_wrong(*one.ctx).code, Errc::identity_unread);
        const auto read = readstate(*one.ctx);
        EXPECT_TRUE(read.ok() && read->state == AlState::op) << in_words(read.error());
        one.expect_all_right();
    }
}

// The EEPROM is busy, or its reading fails, during the comparison of the first call.
TEST_F(UnsupervisedSilence, ReadstateComparesAgainWhereTheSiiCouldNotBeRead) {
    for (const bool other : {false, true}) {
        SCOPED_TRACE(other ? "another device" : "the same slave");
        UnsupervisedSilence one;
        one.SetUp();
        auto& sii = one.silence_with_unreadable_sii(other);
        const auto first = readstate(*one.ctx);
        EXPECT_EQ(first.error().slave, 2) << in_words(first.error());
        EXPECT_NE(first.error().code, Errc::other_slave) << in_words(first.error());
        EXPECT_FALSE(all_right(*one.ctx));
        sii.fail_next(0);
        const auto second = readstate(*one.ctx);
        if (other) {
            EXPECT_EQ(second.error().code, Errc::other_slave) << in_words(second.error());
            one.expect_slave_2_is_known_to_be_another();
        } else {
            EXPECT_TRUE(second.ok() && second->state == AlState::op) << in_words(second.error());
            one.expect_all_right();
        }
    }
}
TEST_F(UnsupervisedSilence, StatecheckComparesAgainWhereTheSiiCouldNotBeRead) {
    for (const bool other : {false, true}) {
        SCOPED_TRACE(other ? "another device" : "the same slave");
        UnsupervisedSilence one;
        one.SetUp();
        auto& sii = one.silence_with_unreadable_sii(other);
        const auto first = statecheck(*one.ctx, 0, AlState::op, 0us);
        EXPECT_FALSE(first.ok());
        EXPECT_EQ(first.error().slave, 2) << in_words(first.error());
        sii.fail_next(0);
        const auto second = statecheck(*one.ctx, 0, AlState::op, 100ms);
        if (other) {
            EXPECT_FALSE(second.ok() && second->state == AlState::op);
            one.expect_slave_2_is_known_to_be_another();
        } else {
            EXPECT_TRUE(second.ok() && second->state == AlState::op) << in_words(second.error());
            one.expect_all_right();
        }
    }
}
// The same within one call: the first reading fails after 100 ms, and the second reading succeeds.
TEST_F(UnsupervisedSilence, StatecheckComparesUntilItsTimeout) {
    prepare(tool);
    silence_with_exchange(tool);
    segment.slave(tool).sii().fail_next(250);
    const auto checked = statecheck(*ctx, 0, AlState::op, 2s);
    EXPECT_FALSE(checked.ok() && checked->state == AlState::op);
    expect_slave_2_is_known_to_be_another();
}

// A request waits in a hook of slave 2. readstate() reports that it could not compare this slave, and the next
// readstate() compares it.
TEST_F(UnsupervisedSilence, ReadstateComparesASlaveThatARequestUsedBefore) {
    ASSERT_TRUE(writestate(*ctx, 2, AlState::safeop).ok());
    ASSERT_EQ(statecheck(*ctx, 2, AlState::safeop, 1s)->state, AlState::safeop);
    ctx->slave(2).hooks.transition = [](HookedSlave slave, Transition which, Moment moment, void*) -> Task<> {
        if (which != Transition::safeop_to_op || moment != Moment::before) co_return Result<>();
        co_return co_await slave.sleep(1s);
    };
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(20);
    silence();
    const auto read = readstate(*ctx);
    EXPECT_EQ(read.error().code, Errc::identity_unread) << in_words(read.error());
    EXPECT_EQ(read.error().slave, 2);
    EXPECT_FALSE(all_right(*ctx));
    request.cancel();
    ASSERT_FALSE(request.busy());
    EXPECT_TRUE(readstate(*ctx).ok());
    cycles(3);
    EXPECT_TRUE(inputs_fresh(*ctx, 2));
    EXPECT_NE(what_is_wrong(*ctx).code, Errc::identity_unread);
}

// ------------------------------------------------------------------ requests of a hook

// A hook that no request waits for sleeps during the silence, and then writes to its slave. The library must not
// destroy the hook during a call by the hook.
struct Writer {
    const char* name;
    Hook<Transition, Moment> hook;
};
struct HookInASilence : UnsupervisedSilence, testing::WithParamInterface<Writer> {
    int begun = 0;
    int calls = 0;
    int destroyed = 0;
    bool submitting = false;
    bool destroyed_within = false;
    Error answer;
    RegisterWriteRequest request;

    class Local {
      public:
        explicit Local(HookInASilence& test) : test_(test) { ++test_.begun; }
        Local(const Local&) = delete;
        Local& operator=(const Local&) = delete;
        ~Local() {
            ++test_.destroyed;
            test_.destroyed_within |= test_.submitting;
        }

      private:
        HookInASilence& test_;
    };
    static bool concerns(Transition which, Moment moment) {
        return which == Transition::safeop_to_op && moment == Moment::after;
    }
    void submit_write() {
        ++calls;
        submitting = true;
        answer = submit(*ctx, request).error();
        submitting = false;
    }
    static Task<> write(HookedSlave slave, Transition which, Moment moment, void* user) {
        if (!concerns(which, moment)) co_return Result<>();
        auto& test = *static_cast<HookInASilence*>(user);
        const Local local(test);
        co_await required(slave.sleep(60ms));
        ++test.calls;
        co_return co_await slave.register_write(kFreeRegister, kValue);
    }
    static Task<> submit_in_sequence(HookedSlave slave, Transition which, Moment moment, void* user) {
        if (!concerns(which, moment)) co_return Result<>();
        auto& test = *static_cast<HookInASilence*>(user);
        const Local local(test);
        co_await required(slave.sleep(60ms));
        test.submit_write();
        co_return co_await slave.sleep(1s);
    }
    static Result<> submit_at_once(HookedSlave, Transition which, Moment moment, void* user) {
        if (!concerns(which, moment)) return {};
        auto& test = *static_cast<HookInASilence*>(user);
        if (++test.begun < 60) return Error{.code = Errc::busy};
        test.submit_write();
        return {};
    }
    // The hook begins when a reading shows that the slave is in OP.
    void begin_hook() {
        ASSERT_TRUE(writestate(*ctx, 2, AlState::safeop).ok());
        ASSERT_EQ(statecheck(*ctx, 2, AlState::safeop, 1s)->state, AlState::safeop);
        ctx->slave(2).hooks.user = this;
        ctx->slave(2).hooks.transition = GetParam().hook;
        ASSERT_TRUE(writestate(*ctx, 2, AlState::op).ok());
        cycles(5);
        ASSERT_TRUE(readstate(*ctx).ok());
        cycles(5);
        ASSERT_GT(begun, 0);
        ASSERT_EQ(calls, 0);
    }
};
TEST_P(HookInASilence, IsRefusedAndEndsBehindItsOwnCall) {
    request.slave = 2;
    request.address = kFreeRegister;
    request.data = kValue;
    prepare(tool);
    begin_hook();
    silence_with_exchange(tool, 20);
    ASSERT_EQ(calls, 0);
    cycles(100);
    EXPECT_EQ(calls, 1);
    EXPECT_FALSE(destroyed_within) << "the hook was destroyed while it executed";
    if (GetParam().hook.sequence() != nullptr) {
        EXPECT_EQ(destroyed, 1) << "the hook went on with another device";
    }
    if (GetParam().hook.sequence() != write) {
        EXPECT_EQ(answer.code, Errc::identity_unread) << in_words(answer);
    }
    expect_nothing_written();
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::identity_unread) << in_words(what_is_wrong(*ctx));
    EXPECT_FALSE(inputs_fresh(*ctx, 2));
    const auto read = readstate(*ctx);
    EXPECT_EQ(read.error().code, Errc::other_slave) << in_words(read.error());
    expect_slave_2_is_known_to_be_another();
}
INSTANTIATE_TEST_SUITE_P(Writers, HookInASilence,
                         testing::Values(Writer{"WritesARegister", HookInASilence::write},
                                         Writer{"SubmitsInASequence", HookInASilence::submit_in_sequence},
                                         Writer{"SubmitsInAPlainFunction", HookInASilence::submit_at_once}),
                         [](const auto& one) { return std::string(one.param.name); });

// ------------------------------------------------------------------ a supervision that begins

TEST_F(UnsupervisedSilence, ASupervisionThatBeginsFindsASilenceBeforeIt) {
    for (const int length : {kShort, 3000})
        for (const bool cycle_between : {false, true}) {
            SCOPED_TRACE(std::to_string(length) + (cycle_between ? " cycles, and one" : " cycles"));
            UnsupervisedSilence one;
            one.SetUp();
            one.prepare(one.tool);
            one.silence_with_exchange(one.tool, length);
            ASSERT_TRUE(submit(*one.ctx, one.supervision).ok());
            if (cycle_between)
                one.cycles(1);
            else
                (void)poll(*one.ctx, one.osal.now());
            RegisterWriteRequest request;
            request.slave = 2;
            request.address = kFreeRegister;
            request.data = kValue;
            EXPECT_EQ(submit(*one.ctx, request).error().code, Errc::identity_unread);
            one.cycles(50);
            one.expect_nothing_written();
            one.expect_slave_2_is_known_to_be_another();
        }
}

// ------------------------------------------------------------------ a device of another revision

// The device may have other PDOs, so it gets no outputs before config_map() has read the PDOs.
struct AnotherRevision : UnsupervisedSilence {
    std::uint32_t device = 0;

    void exchange() {
        device = make_of_revision(0x101, 2);
        segment.set_power(device, true, osal.now());
        settle_devices();
        prepare(device);
        silence_with_exchange(device);
    }
    // Advances to the next frame or deadline.
    void step() {
        const Time next = poll(*ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 1ms), -1);
        segment.advance(osal.now());
    }
    void expect_no_outputs_at_the_device() {
        for (int n = 0; n < 300; ++n) {
            write_outputs();
            (void)cycle();
            const auto outputs = program(device).outputs();
            ASSERT_TRUE(outputs.empty() || outputs[0] != std::byte{0xA2}) << n;
            ASSERT_FALSE(inputs_fresh(*ctx, 2)) << n;
            ASSERT_FALSE(all_right(*ctx)) << n;
        }
    }
};
TEST_F(AnotherRevision, GetsNoOutputsBeforeItIsMapped) {
    using Compare = void (*)(AnotherRevision & one);
    constexpr std::pair<const char*, Compare> kWays[] = {
        {"readstate", [](AnotherRevision& one) { EXPECT_TRUE(readstate(*one.ctx).ok()); }},
        {"statecheck", [](AnotherRevision& one) { (void)statecheck(*one.ctx, 0, AlState::op, 10ms); }},
        {"recover one", [](AnotherRevision& one) { EXPECT_TRUE(recover_slave(*one.ctx, 2).ok()); }},
        {"writestate", [](AnotherRevision& one) { (void)writestate(*one.ctx, 2, AlState::op); }},
        {"supervise",
         [](AnotherRevision& one) {
             ASSERT_TRUE(submit(*one.ctx, one.supervision).ok());
             one.cycles(200);
         }},
    };
    for (const auto& [name, compare] : kWays) {
        SCOPED_TRACE(name);
        AnotherRevision one;
        one.SetUp();
        one.exchange();
        compare(one);
        one.expect_no_outputs_at_the_device();
        const auto mapped = config_map(*one.ctx, one.image);
        EXPECT_TRUE(mapped.ok()) << in_words(mapped.error());
        const auto reached = reach(*one.ctx, AlState::op, 2s);
        EXPECT_TRUE(reached.ok()) << in_words(reached.error());
        one.expect_exchanged(2, one.device);
    }
}

// Lost frames interrupt the comparison at each of its moments, and the comparison is repeated.
TEST_F(AnotherRevision, GetsNoOutputsAlsoWhereTheComparisonWasCut) {
    int cut_off = 0;
    for (int moment = 0;; ++moment) {
        ASSERT_LT(moment, 500) << "the request does not end";
        AnotherRevision one;
        one.SetUp();
        one.exchange();
        ReadStateRequest request;
        ASSERT_TRUE(submit(*one.ctx, request).ok());
        for (int n = 0; request.busy() && n < moment; ++n) one.step();
        if (!request.busy()) break;
        one.begin_silence();
        for (int n = 0; request.busy() && n < 1000; ++n) one.step();
        ASSERT_FALSE(request.busy());
        cut_off += request.state() == RequestState::error ? 1 : 0;
        one.end_silence();
        (void)readstate(*one.ctx);
        one.expect_no_outputs_at_the_device();
        ASSERT_FALSE(HasFailure()) << "cut before step " << moment;
    }
    EXPECT_GT(cut_off, 5);
}

}  // namespace
}  // namespace margay
