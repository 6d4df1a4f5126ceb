// No frame comes back for a while, and meanwhile a machine of another product takes the place of slave 2: it has its
// station address, FMMUs and state. The supervision compares the identities, however short the silence was.
#include "process_data/silence.hpp"

#include <margay/run.hpp>

namespace margay {
namespace {

// Without cycles only the supervision sends frames. {interval, silence}.
struct SilenceWithoutCycles : Silence, testing::WithParamInterface<std::pair<int, int>> {};
TEST_P(SilenceWithoutCycles, AnotherMachineIsNoticed) {
    build();
    supervision.interval = std::chrono::milliseconds(GetParam().first);
    supervision.target = AlState::safeop;
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    idle(1s);
    make_like_slave_2(tool, AlState::safeop);
    idle(300ms);
    begin_silence();
    exchange();
    idle(std::chrono::milliseconds(GetParam().second));
    end_silence();
    idle(1s);
    const std::array octets{std::byte{0x5A}, std::byte{0xA5}};
    EXPECT_FALSE(write_register(*ctx, 2, 0x0F80, octets).ok());
    EXPECT_EQ(segment.slave(tool).peek(0x0F80, 1)[0], std::byte{0});
    (void)set_target(*ctx, 0, AlState::op);
    EXPECT_FALSE(reach(*ctx, AlState::op, 5s).ok());
    expect_no_outputs_of_slave_2(200);
    EXPECT_FALSE(all_right(*ctx));
}
INSTANTIATE_TEST_SUITE_P(IntervalAndSilence, SilenceWithoutCycles,
                         testing::Values(std::pair{10, 60}, std::pair{10, 80}, std::pair{10, 120}, std::pair{10, 160},
                                         std::pair{10, 300}, std::pair{50, 120}, std::pair{50, 300}, std::pair{90, 190},
                                         std::pair{90, 900}));

// With cycles, at many moments of the round of the supervision, which looks at all slaves twice a second.
TEST_F(Silence, BesideCyclesAnotherMachineIsNoticedWhateverTheSupervisionDoes) {
    for (int phase = 0; phase < 510; phase += 15) {
        Silence one;
        one.limits.tasks = 1;
        one.build();
        one.make_like_slave_2(one.tool, AlState::op);
        ASSERT_TRUE(submit(*one.ctx, one.supervision).ok());
        one.cycles(300 + phase);
        one.begin_silence();
        one.exchange();
        one.cycles(120);
        one.end_silence();
        one.cycles(30);
        one.expect_no_outputs_of_slave_2(300);
        ASSERT_FALSE(HasFailure()) << "phase " << phase;
    }
}

// The comparison says that it is this slave; its inputs are fresh after the next cycle only.
TEST_F(Silence, InputsAreNotFreshBeforeACycleHasBroughtThem) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const auto show = [&](int value) {
        program(line[1]).inputs()[0] = static_cast<std::byte>(value);
        program(line[1]).poke();
    };
    show(0x11);
    cycles(500);
    begin_silence();
    cycles(300);
    show(0x22);
    cycles(300);
    end_silence();
    bool fresh = false;
    for (int n = 0; n < 1000; ++n) {
        osal.advance(1ms);
        (void)send_processdata(*ctx);
        const auto received = receive_processdata(*ctx, 500us);
        const auto expect_new = [&](bool good) {
            const auto input = ctx->slave(2).image.inputs.bytes[0];
            EXPECT_TRUE(!good || input == std::byte{0x22}) << n;
        };
        expect_new(received.ok());
        expect_new(inputs_fresh(*ctx, 2));
        (void)poll(*ctx, osal.now());
        expect_new(inputs_fresh(*ctx, 2));
        fresh |= inputs_fresh(*ctx, 2);
    }
    EXPECT_TRUE(fresh);
}

// Until all slaves are compared the cycle does not say that the inputs of all slaves but one are fresh.
TEST_F(Silence, TheErrorOfTheCycleSaysNotThatOthersAreFresh) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(300);
    begin_silence();
    cycles(70);
    end_silence();
    int doubtful = 0;
    for (int n = 0; n < 200; ++n) {
        const auto received = cycle();
        if (received || received.error().code != Errc::working_counter) continue;
        ++doubtful;
        for (std::uint16_t slave = 1; slave <= 3; ++slave) {
            const bool said = received.error().detail == Error::kOthersFresh && received.error().slave != slave;
            EXPECT_TRUE(!said || inputs_fresh(*ctx, slave)) << n << " slave " << slave;
        }
    }
    EXPECT_GT(doubtful, 0);
}

}  // namespace
}  // namespace margay
