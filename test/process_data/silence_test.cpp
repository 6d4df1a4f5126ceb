// No frame comes back for a while, and meanwhile a device of another product takes the place of slave 2. The device has
// the station address, FMMUs and state of slave 2. The supervision compares the identities, however short the silence
// was.
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

// With cycles, at many moments of the round of the supervision, which reads all slaves twice a second.
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

// The comparison shows that the device is slave 2. Its inputs are fresh only after the next cycle.
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

// Until all slaves are compared, the error of the cycle must not say that the inputs of all other slaves are fresh.
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

// Slave 2 is in its own group with this period, in ms. After a silence a spare part is in its place, in OP, with its
// station address and with the FMMUs of another program.
struct SlowGroup : Silence, testing::WithParamInterface<int> {
    std::vector<std::byte> slow_image = std::vector<std::byte>(64);
    int passed = 0;

    void run(int milliseconds) {
        for (int n = 0; n < milliseconds; ++n, ++passed) {
            write_outputs();
            (void)cycle();
            if (passed % GetParam() == 0 && send_processdata(*ctx, 1)) (void)receive_processdata(*ctx, 500us, 1);
        }
    }
};
TEST_P(SlowGroup, ASpareWithOtherFmmusIsStartedAgain) {
    limits.groups = 2;
    build();
    const auto spare = make({.product = 0x101});
    power(spare, true);
    ctx->slave(2).config.group = 1;
    ctx->slave(2).config.process_data_watchdog = SlaveConfiguration::Watchdog(0);
    ASSERT_TRUE(config_map(*ctx, slow_image, 1).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    run(5000);
    ASSERT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
    auto other = mapping_of(2);
    for (const std::size_t fmmu : {0U, 16U, 32U})
        store_le<std::uint32_t>(other.fmmus, fmmu, load_le<std::uint32_t>(other.fmmus, fmmu) + 0x5000);
    make_like_slave_2(spare, AlState::op, other);
    set(spare, 0x0420, 0);
    run(2000);
    begin_silence();
    run(200);
    take_out(line[1]);
    put_in(spare);
    segment.reconsider();
    run(200);
    ASSERT_EQ(state_of(spare), 8);
    (void)events();
    end_silence();
    run(20'000);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx)) << "\n" << joined(events());
    EXPECT_TRUE(inputs_fresh(*ctx, 2));
    EXPECT_EQ(program(spare).outputs()[0], std::byte{0xA2});
}
INSTANTIATE_TEST_SUITE_P(Periods, SlowGroup, testing::Values(1, 10, 100, 500, 1000, 2000));

// Overlapping cycles contain no rolls of the supervision. There are two cycles per millisecond.
struct OverlappedSilence : Silence {
    std::size_t flight = 2;
    std::size_t under_way = 0;
    int wrong = 0;  // cycles in which inputs of the other machine counted as inputs of slave 2

    void begin(std::size_t cycles_in_flight, Duration interval) {
        flight = cycles_in_flight;
        limits.process_frames = 20;
        build();
        ctx->group(0).config.cycles_in_flight = static_cast<std::uint8_t>(flight);
        ASSERT_TRUE(config_map(*ctx, image).ok());
        supervision.interval = interval;
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        make_like_slave_2(tool, AlState::op);
        go(500);
        ASSERT_TRUE(in_op(2));
        // The mapping has other logical addresses than the mapping of build().
        make_like_slave_2(tool, AlState::op);
        set(tool, 0x0420, 0);
        program(tool).inputs()[0] = std::byte{0xEE};
        program(tool).poke();
        go(500);
        ASSERT_TRUE(in_op(2));
        wrong = 0;
    }
    void go(int steps) {
        for (int n = 0; n < steps; ++n) {
            write_outputs();
            osal.advance(500us);
            if (send_processdata(*ctx).error().code != Errc::busy) ++under_way;
            while (under_way >= flight) {
                const auto received = receive_processdata(*ctx, 400us);
                --under_way;
                const bool of_tool = ctx->slave(2).image.inputs.bytes[0] == std::byte{0xEE};
                wrong += of_tool && (received.ok() || inputs_fresh(*ctx, 2)) ? 1 : 0;
            }
            (void)poll(*ctx, osal.now());
            wrong += ctx->slave(2).image.inputs.bytes[0] == std::byte{0xEE} && inputs_fresh(*ctx, 2) ? 1 : 0;
        }
    }
};
struct OverlappedSilences : OverlappedSilence, testing::WithParamInterface<std::pair<std::size_t, int>> {};
TEST_P(OverlappedSilences, NothingOfAnotherMachineIsFresh) {
    for (int length = 24; length < 400; length += 11) {
        OverlappedSilence one;
        one.begin(GetParam().first, std::chrono::milliseconds(GetParam().second));
        one.go(length % 40);
        one.begin_silence();
        one.go(length / 2);
        one.exchange();
        one.go(length - length / 2);
        one.end_silence();
        one.go(1000);
        EXPECT_EQ(one.wrong, 0) << "a silence of " << length << " cycles";
        EXPECT_FALSE(all_right(*one.ctx)) << length;
        EXPECT_FALSE(inputs_fresh(*one.ctx, 2)) << length;
        ASSERT_FALSE(HasFatalFailure());
    }
}
// If nothing was exchanged, the supervision compares the slaves soon, however long its interval without cycles is.
TEST_F(OverlappedSilence, TheSameSlavesAreFreshAgainSoon) {
    begin(3, 2s);
    begin_silence();
    go(40);
    end_silence();
    int steps = 0;
    for (; steps < 4000 && !inputs_fresh(*ctx, 2); ++steps) go(1);
    EXPECT_LT(steps, 200);
    EXPECT_TRUE(until([&] { return all_right(*ctx); })) << in_words(what_is_wrong(*ctx));
}

INSTANTIATE_TEST_SUITE_P(CyclesAndInterval, OverlappedSilences,
                         testing::Values(std::pair{1U, 10}, std::pair{1U, 100}, std::pair{2U, 10}, std::pair{2U, 100},
                                         std::pair{3U, 10}, std::pair{3U, 100}, std::pair{4U, 10}, std::pair{4U, 100}));

}  // namespace
}  // namespace margay
