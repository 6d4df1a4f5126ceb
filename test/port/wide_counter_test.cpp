// The extension of a hardware counter of 32 bits.
#include <margay/parts/osal/bare/bare_osal.hpp>
#include <margay/parts/osal/wide_counter.hpp>

#include <gtest/gtest.h>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(WideCounter, CountsOnWhenTheCounterBeginsAgain) {
    WideCounter wide(25'000'000);
    std::uint32_t count = 0;
    Time last{};
    for (std::uint64_t ticks = 0; ticks < std::uint64_t{5} << 32; ticks += 0x3FFFFFFF) {
        count = static_cast<std::uint32_t>(ticks);
        const Time now = wide.extend(count);
        EXPECT_EQ(now, Time(Duration(static_cast<std::int64_t>(ticks * 40)))) << ticks;
        EXPECT_GE(now, last);
        last = now;
    }
    EXPECT_EQ(wide.extend(count), last) << "the same count is the same time";
}

TEST(WideCounter, HasNoErrorThatGrows) {
    // A tick of 1/7.37 MHz is not a whole number of nanoseconds. Read after each tick, for a second.
    constexpr std::uint32_t kHertz = 7'372'800;
    WideCounter wide(kHertz);
    Time now{};
    for (std::uint32_t tick = 1; tick <= kHertz; ++tick) now = wide.extend(tick);
    EXPECT_EQ(now, Time(1s));
}

TEST(WideCounter, LastsForFastCounters) {
    WideCounter wide(600'000'000);
    std::uint64_t ticks = 0;
    Time now{};
    for (; ticks < std::uint64_t{600'000'000} * 3600; ticks += 0xFFFFFFFF)
        now = wide.extend(static_cast<std::uint32_t>(ticks));
    const auto expected = static_cast<double>(ticks - 0xFFFFFFFF) / 600e6;
    EXPECT_NEAR(std::chrono::duration<double>(now.time_since_epoch()).count(), expected, 1e-6);
}

// A board whose counter and interrupts the test moves.
struct {
    std::uint32_t count = 0;
    unsigned sleeps = 0;
} board;

TEST(BareOsal, SleepsOnlyWhenAnInterruptComesInTime) {
    board = {};
    BareOsal osal({.counter = [] { return board.count; },
                   .hertz = 1'000'000,
                   .idle = [](const std::atomic<bool>&) { board.count += 1000, ++board.sleeps; }});
    osal.wait(osal.now() + 500us, -1);
    EXPECT_EQ(board.sleeps, 0u) << "the next tick would be late";
    osal.wait(osal.now() - 1s, -1);
    EXPECT_EQ(board.sleeps, 0u);
    osal.wait(osal.now() + 10ms, -1);
    EXPECT_EQ(board.sleeps, 1u) << "one interrupt ends a wait";
    osal.wait(kNever, -1);
    EXPECT_EQ(board.sleeps, 2u);
    osal.wake();
    osal.wait(osal.now() + 10ms, -1);
    EXPECT_EQ(board.sleeps, 2u) << "a wake() before the wait ends it";
    osal.wait(osal.now() + 10ms, -1);
    EXPECT_EQ(board.sleeps, 3u) << "but only one wait";
}

TEST(BareOsal, WithoutIdleReturnsAtOnce) {
    board = {};
    BareOsal osal({.counter = [] { return board.count; }, .hertz = 1'000'000});
    osal.wait(kNever, -1);  // the test hangs here if it does not
    EXPECT_EQ(osal.now(), Time{});
}

}  // namespace
}  // namespace margay
