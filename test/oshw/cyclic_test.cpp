// Periodic tasks: the grid of deadlines, the histogram, and CyclicRunner of Linux.
#include "osal/cyclic_schedule.hpp"
#include "osal/duration_histogram.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <string_view>
#include <thread>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(CyclicSchedule, KeepsItsGridHoweverLateTheTaskIs) {
    CyclicSchedule schedule(1ms, 500us);
    schedule.start(Time(10'200us));
    EXPECT_EQ(schedule.deadline(), Time(11'500us)) << "10.5 ms is less than half a period ahead";
    auto tick = schedule.wake(Time(11'530us));
    EXPECT_EQ(tick.cycle, 1U);
    EXPECT_EQ(tick.lateness, 30us);
    EXPECT_EQ(tick.skipped, 0U);
    tick = schedule.wake(Time(13'499us));
    EXPECT_EQ(tick.lateness, 999us) << "late, but the next one has not come";
    EXPECT_EQ(tick.skipped, 0U);
    tick = schedule.wake(Time(16'600us));
    EXPECT_EQ(tick.skipped, 3U);
    EXPECT_EQ(tick.deadline, Time(16'500us));
    EXPECT_EQ(tick.cycle, 6U);
    EXPECT_EQ(schedule.deadline(), Time(17'500us));
}

TEST(CyclicSchedule, StartsHalfAPeriodToOneAndAHalfAhead) {
    for (const Duration period : {100us, 250us, 1000us, 3000us})
        for (Duration at = 7ms; at < 14ms; at += 13us) {
            CyclicSchedule schedule(period, phase_off_the_tick(period));
            schedule.start(Time(at));
            EXPECT_GE(schedule.deadline(), Time(at + period / 2));
            EXPECT_LE(schedule.deadline(), Time(at + 3 * period / 2));
        }
}

TEST(CyclicSchedule, DeadlinesAreAwayFromTheTick) {
    for (const Duration period : {50us, 100us, 250us, 500us, 1000us, 2000us, 10'000us}) {
        CyclicSchedule schedule(period, phase_off_the_tick(period));
        schedule.start(Time(123'456us));
        for (int n = 0; n < 100; ++n) {
            const auto past_tick = schedule.deadline().time_since_epoch() % Duration(1ms);
            EXPECT_GE(std::min(past_tick, Duration(1ms) - past_tick), std::min(period, Duration(1ms)) / 2);
            (void)schedule.wake(schedule.deadline());
        }
    }
}

TEST(DurationHistogram, QuantilesAreRightWithinASixteenth) {
    std::mt19937_64 random(3);
    DurationHistogram histogram;
    std::vector<std::int64_t> all;
    for (int n = 0; n < 50'000; ++n) {
        const auto ns = static_cast<std::int64_t>(random() >> (20 + random() % 40));
        all.push_back(std::min<std::int64_t>(ns, std::int64_t{1} << 41));
        histogram.record(Duration(all.back()));
    }
    std::sort(all.begin(), all.end());
    EXPECT_EQ(histogram.count(), all.size());
    EXPECT_EQ(histogram.min().count(), all.front());
    EXPECT_EQ(histogram.max().count(), all.back());
    for (const double q : {0.01, 0.5, 0.9, 0.99, 0.999, 1.0}) {
        const auto exact = static_cast<double>(all[static_cast<std::size_t>(q * static_cast<double>(all.size() - 1))]);
        const auto told = static_cast<double>(histogram.quantile(q).count());
        EXPECT_GE(told, exact * 0.99) << q;
        EXPECT_LE(told, exact * 1.0701 + 1) << q;
    }
    std::uint64_t in_buckets = 0;
    for (std::size_t i = 0; i < DurationHistogram::kBuckets; ++i) {
        const auto bucket = histogram.bucket(i);
        EXPECT_LT(bucket.from, bucket.to);
        EXPECT_EQ(bucket.from, i == 0 ? Duration::zero() : histogram.bucket(i - 1).to);
        in_buckets += bucket.count;
    }
    EXPECT_EQ(in_buckets, all.size());
}

TEST(DurationHistogram, EmptyAndOutOfRange) {
    DurationHistogram histogram;
    EXPECT_EQ(histogram.quantile(0.99), Duration::zero());
    EXPECT_EQ(histogram.mean(), Duration::zero());
    EXPECT_EQ(histogram.min(), Duration::zero());
    histogram.record(-5us);
    histogram.record(std::chrono::hours(100));
    EXPECT_EQ(histogram.min(), Duration::zero());
    EXPECT_EQ(histogram.max(), Duration(std::chrono::hours(100)));
    EXPECT_EQ(histogram.bucket(DurationHistogram::kBuckets - 1).count, 1U);
}

// Uses a few milliseconds of real time, because no other test can show that the clock of the kernel and ours are the
// same.
TEST(CyclicRunner, IsNeverWokenBeforeItsDeadline) {
    CyclicRunner runner({.period = 200us, .spin = 20us, .lock_memory = false, .hold_latency = false});
    EXPECT_TRUE(runner.prepare().empty()) << "nothing was asked for";
    runner.start();
    std::uint64_t before = 0;
    for (int n = 0; n < 20; ++n) {
        const auto tick = runner.wait();
        EXPECT_GE(CyclicRunner::now(), tick.deadline);
        EXPECT_GE(tick.lateness, Duration::zero());
        EXPECT_EQ(tick.cycle, before + 1 + tick.skipped);
        EXPECT_EQ(tick.deadline.time_since_epoch() % Duration(200us), Duration(100us));
        before = tick.cycle;
    }
}

TEST(CyclicRunner, TellsWhatWasRefusedAndRunsNevertheless) {
    std::thread([] {  // the scheduling policy ends with the thread
        CyclicRunner runner(
            {.period = 100us, .priority = 1000, .cpu = 100'000, .lock_memory = false, .hold_latency = false});
        const auto refusals = runner.prepare();
        ASSERT_EQ(refusals.size(), 2U);
        EXPECT_NE(std::string_view(refusals[0].what).find("processor"), std::string_view::npos);
        EXPECT_NE(std::string_view(refusals[1].what).find("SCHED_FIFO"), std::string_view::npos);
        EXPECT_EQ(refusals[1].error, EINVAL);
        runner.start();
        EXPECT_GE(runner.wait().cycle, 1U);
    })
        .join();
}

// Spinning never uses the whole time that Linux grants to real-time threads.
TEST(CyclicRunner, SpinStaysWithinTheShareOfRealTime) {
    std::thread([] {
        CyclicRunner runner({.period = 1ms, .spin = 5ms, .priority = 1, .lock_memory = false, .hold_latency = false});
        EXPECT_EQ(runner.spin(), 1ms) << "no longer than the period";
        const auto refusals = runner.prepare();
        if (!refusals.empty()) GTEST_SKIP() << refusals[0].what;
        EXPECT_EQ(::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, SCHED_FIFO);
        long runtime_us = -1;
        std::ifstream("/proc/sys/kernel/sched_rt_runtime_us") >> runtime_us;
        if (runtime_us < 0) runtime_us = 1'000'001;  // no limit
        EXPECT_LT(runner.spin(), Duration(runtime_us)) << "of a second in µs is the same as of 1 ms in ns";
    }).join();
}

}  // namespace
}  // namespace margay
