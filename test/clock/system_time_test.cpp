// Offsets of clocks, start times of SYNC signals, and the difference that a slave reports.
#include "clock/system_time.hpp"
#include "clock/sync_watch.hpp"

#include <gtest/gtest.h>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(ClockOffset, BringsLocalTimeToSystemTime) {
    // The reference showed 1000 when the frame passed it, and 300 ns later the slave's own clock showed 50.
    EXPECT_EQ(clock_offset_ns(1000, 300, 50), 1250U);
    // A clock that is ahead needs a negative offset: modulo 2^64, and modulo 2^32 in the low half.
    const std::uint64_t offset = clock_offset_ns(1000, 300, 5000);
    EXPECT_EQ(offset, static_cast<std::uint64_t>(-3700));
    EXPECT_EQ(static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(-3700));
}

// A clock of 32 bits shows the low half of the system time: 5'000'000'000 - 2^32 = 705'032'704.
TEST(ClockOffset, OfAClockOf32Bits) {
    const auto offset = static_cast<std::uint32_t>(clock_offset_ns(5'000'000'000, 0, 0xFFFF'FFF0));
    EXPECT_EQ(0xFFFF'FFF0U + offset, 705'032'704U);
}

TEST(ExtendedTime, IsTheNearestWithTheseLowBits) {
    EXPECT_EQ(extend_time_ns(0x10, 0x5'FFFF'FFF0), 0x6'0000'0010U) << "just wrapped";
    EXPECT_EQ(extend_time_ns(0xFFFF'FFF0, 0x6'0000'0010), 0x5'FFFF'FFF0U) << "not wrapped yet";
    EXPECT_EQ(extend_time_ns(0x1234, 0x7'0000'1000), 0x7'0000'1234U);
}

TEST(StartTime, IsOnTheGrid) {
    EXPECT_EQ(start_time_ns(10'000'001, 1'000'000, 0), 11'000'000U);
    EXPECT_EQ(start_time_ns(11'000'000, 1'000'000, 0), 11'000'000U) << "already on it";
    EXPECT_EQ(start_time_ns(10'000'001, 1'000'000, 250'000), 10'250'000U);
    EXPECT_EQ(start_time_ns(10'250'001, 1'000'000, 250'000), 11'250'000U);
    EXPECT_EQ(start_time_ns(10'000'001, 1'000'000, -250'000), 10'750'000U) << "a quarter before the grid";
    EXPECT_EQ(start_time_ns(10'000'001, 1'000'000, -3'250'000), 10'750'000U) << "whole cycles do not count";
    EXPECT_EQ(start_time_ns(10'000'001, 1'000'000, 2'250'000), 10'250'000U);
}

TEST(StartTime, OfSlavesThatStartAtAnyTimeHasOnePhase) {
    for (std::uint64_t now = 5'000'000'000; now < 5'010'000'000; now += 123'457) {
        const std::uint64_t start = start_time_ns(now, 2'000'000, 30'000);
        EXPECT_GE(start, now);
        EXPECT_LT(start, now + 2'000'000);
        EXPECT_EQ(start % 2'000'000, 30'000U);
    }
}

TEST(StartTime, WithoutAGridIsTheEarliest) {
    EXPECT_EQ(start_time_ns(1234, 0, 0), 1234U);
    EXPECT_EQ(start_time_ns(1234, 0, 10), 1244U);
    EXPECT_EQ(start_time_ns(1234, 0, -10), 1234U) << "never earlier";
}

TEST(SyncPeriod, OfBothSignals) {
    EXPECT_EQ(sync_period_ns(1'000'000, 0), 1'000'000U);
    EXPECT_EQ(sync_period_ns(1'000'000, 500'000), 1'000'000U) << "SYNC1 is shifted";
    EXPECT_EQ(sync_period_ns(250'000, 750'000), 1'000'000U) << "SYNC1 with every fourth SYNC0";
    EXPECT_EQ(sync_period_ns(0, 0), 0U) << "single shot";
}

TEST(SyncDifference, HasSignAndMagnitude) {
    EXPECT_EQ(load_difference_ns(17), 17);
    EXPECT_EQ(load_difference_ns(0x8000'0011), -17) << "behind";
    EXPECT_EQ(load_difference_ns(0x8000'0000), 0);
    EXPECT_EQ(load_greatest_difference_ns(0x8000'0011U | 0x0000'0004U), 21U) << "at least 17, below 34";
}

TEST(SyncWatching, SettlesBeforeItIsInSync) {
    SyncWatch watch;
    const SyncLimit limit{.limit_ns = 100, .settle = 10ms};
    using Change = SyncWatch::Change;
    EXPECT_EQ(watch.update(-500, limit, Time{0ms}), Change::none);
    EXPECT_EQ(watch.update(100, limit, Time{1ms}), Change::none);
    EXPECT_EQ(watch.update(-100, limit, Time{9ms}), Change::none);
    EXPECT_EQ(watch.update(101, limit, Time{10ms}), Change::none) << "once more outside: settles anew";
    EXPECT_EQ(watch.update(5, limit, Time{11ms}), Change::none);
    EXPECT_EQ(watch.update(5, limit, Time{20ms}), Change::none);
    EXPECT_EQ(watch.update(5, limit, Time{21ms}), Change::in_sync);
    EXPECT_EQ(watch.update(5, limit, Time{22ms}), Change::none) << "told once";
    EXPECT_EQ(watch.update(-101, limit, Time{23ms}), Change::out_of_sync) << "at once";
    EXPECT_EQ(watch.update(-102, limit, Time{24ms}), Change::none);
    EXPECT_FALSE(watch.in_sync());
    EXPECT_EQ(watch.update(INT32_MIN, limit, Time{25ms}), Change::none);
}

}  // namespace
}  // namespace margay
