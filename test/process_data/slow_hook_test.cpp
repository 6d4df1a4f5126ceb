// A hook takes three seconds, and meanwhile a device of another product takes the place of the slave within 30 ms. The
// device has the station address, the FMMUs and the SyncManagers of the slave. The call that has started the hook ends
// with an error, and the device gets neither a state above PREOP nor outputs.
#include "process_data/identities.hpp"

#include <margay/hooked_slave.hpp>
#include <margay/run.hpp>

namespace margay {
namespace {

constexpr std::array kOctets{std::byte{0x5A}, std::byte{0xA5}};
constexpr std::uint16_t kFree = 0x0F80;

enum class Caller { map, reconfigure, target, state };
struct Case {
    const char* name;
    Caller caller;
    Transition hook;  // none: preop_to_safeop of the slave's hooks
    Moment moment = Moment::before;
    bool supervised = false;
};

struct SlowHook : Identities, testing::WithParamInterface<Case> {
    bool begun = false;
    bool ended = false;
    Mapping mapping;

    void SetUp() override {
        build();
        mapping = mapping_of(2);
    }
    static Task<> wait(HookedSlave slave, void* user) {
        auto& test = *static_cast<SlowHook*>(user);
        test.begun = true;
        co_await required(slave.sleep(3s));
        test.ended = true;
        co_return Result<>();
    }
    static Task<> around(HookedSlave slave, Transition which, Moment moment, void* user) {
        if (which != GetParam().hook) co_return Result<>();
        if (moment == GetParam().moment) co_return co_await wait(slave, user);
        // This call is after the transition; the long hook was before the transition.
        if (moment == Moment::after) (void)co_await slave.register_write(kFree, kOctets);
        co_return Result<>();
    }
    void use_hook() {
        ctx->slave(2).hooks.user = this;
        if (GetParam().hook == Transition::none)
            ctx->slave(2).hooks.preop_to_safeop = wait;
        else
            ctx->slave(2).hooks.transition = around;
    }
    void supervise() {
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(300);
        (void)events();
    }
    void prepare_tool(AlState state) {
        make_like_slave_2(tool, AlState::preop, mapping);
        if (state == AlState::init) set(tool, 0x0120, 1);
        if (state == AlState::safeop) make_like_slave_2(tool, AlState::safeop, mapping);
    }
    void exchange() {
        cycles(200);
        ASSERT_TRUE(begun);
        take_out(line[1]);
        cycles(30);
        put_in(tool);
        segment.reconsider();
    }
    // The tool may already be in SAFEOP, but it must never be in OP.
    void expect_error(const Request& request) {
        for (int n = 0; n < 6000; ++n) {
            write_outputs();
            (void)cycle();
            ASSERT_NE(state_of(tool), 8) << n;
            const auto outputs = program(tool).outputs();
            ASSERT_TRUE(outputs.empty() || outputs[0] != std::byte{0xA2}) << n;
            ASSERT_FALSE(all_right(*ctx) && ended) << n;
        }
        EXPECT_FALSE(request.busy());
        EXPECT_NE(request.state(), RequestState::success);
        EXPECT_EQ(request.error().slave, 2) << in_words(request.error());
        EXPECT_EQ(segment.slave(tool).peek(kFree, 1)[0], std::byte{0}) << "a hook has written to the other machine";
    }
    template <class SomeRequest>
    void execute(SomeRequest& request) {
        ASSERT_TRUE(submit(*ctx, request).ok());
        exchange();
        expect_error(request);
    }
};

TEST_P(SlowHook, NothingBehindItReachesAnotherMachine) {
    const Case& one = GetParam();
    if (one.caller == Caller::target) {
        ASSERT_TRUE(writestate(*ctx, 2, AlState::preop).ok());
        ASSERT_EQ(statecheck(*ctx, 2, AlState::preop, 1s)->state, AlState::preop);
    }
    if (one.supervised) supervise();
    if (one.caller == Caller::state) {
        ASSERT_TRUE(set_target(*ctx, 2, AlState::safeop).ok());
        cycles(300);
        (void)events();
    }
    use_hook();
    const bool in_safeop = one.caller == Caller::state || one.moment == Moment::after;
    prepare_tool(one.hook == Transition::init_to_preop ? AlState::init : in_safeop ? AlState::safeop : AlState::preop);
    MapRequest map;
    ReconfigRequest reconfigure;
    TargetRequest target;
    StateRequest state;
    map.image = image;
    reconfigure.slave = target.slave = state.slave = 2;
    target.wanted = state.wanted = AlState::op;
    state.timeout = 20s;
    switch (one.caller) {
        case Caller::map: return execute(map);
        case Caller::reconfigure: return execute(reconfigure);
        case Caller::target: return execute(target);
        case Caller::state: ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok()); return execute(state);
    }
}
INSTANTIATE_TEST_SUITE_P(
    Callers, SlowHook,
    testing::Values(
        Case{"MapBeforePs", Caller::map, Transition::preop_to_safeop},
        Case{"Reconfigure", Caller::reconfigure, Transition::none},
        Case{"ReconfigureBeforeIp", Caller::reconfigure, Transition::init_to_preop},
        Case{"ReconfigureBeforePs", Caller::reconfigure, Transition::preop_to_safeop},
        Case{"ReconfigureSupervised", Caller::reconfigure, Transition::none, Moment::before, true},
        Case{"ReconfigureBeforeIpSupervised", Caller::reconfigure, Transition::init_to_preop, Moment::before, true},
        Case{"ReconfigureBeforePsSupervised", Caller::reconfigure, Transition::preop_to_safeop, Moment::before, true},
        Case{"Target", Caller::target, Transition::none},
        Case{"TargetBeforePs", Caller::target, Transition::preop_to_safeop},
        Case{"TargetAfterPs", Caller::target, Transition::preop_to_safeop, Moment::after},
        Case{"StateBeforeSoSupervised", Caller::state, Transition::safeop_to_op, Moment::before, true}),
    [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace margay
