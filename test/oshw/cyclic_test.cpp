// Periodic tasks: the grid of deadlines, the histogram, and CyclicRunner of Linux.
#include "osal/cyclic_schedule.hpp"
#include "osal/duration_histogram.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
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

TEST(CyclicSchedule, SkipsByDefaultAndCountsIt) {
    CyclicSchedule schedule(1ms, 0us);
    schedule.start(Time(0us));
    EXPECT_FALSE(schedule.wake(Time(1ms)).stopped);
    EXPECT_EQ(schedule.wake(Time(4100us)).skipped, 2U);
    EXPECT_FALSE(schedule.wake(Time(5ms)).caught_up);
    EXPECT_EQ(schedule.counters().overruns, 1U);
    EXPECT_EQ(schedule.counters().skipped, 2U);
    EXPECT_EQ(schedule.counters().caught_up, 0U);
}

TEST(CyclicSchedule, CatchesUpDeadlineByDeadline) {
    CyclicSchedule schedule(1ms, 0us);
    schedule.set_policy(OverrunPolicy::catch_up);
    schedule.start(Time(0us));
    (void)schedule.wake(Time(1ms));
    // The task continues at 5.2 ms. It has missed the deadlines of 2, 3 and 4 ms; for the deadline of 5 ms it is only
    // late.
    std::uint64_t cycle = 2;
    for (const Duration due : {Duration(2ms), Duration(3ms), Duration(4ms), Duration(5ms)}) {
        const auto tick = schedule.wake(Time(5200us));
        EXPECT_EQ(tick.deadline, Time(due));
        EXPECT_EQ(tick.lateness, 5200us - due);
        EXPECT_EQ(tick.caught_up, due < 5ms);
        EXPECT_EQ(tick.skipped, 0U);
        EXPECT_EQ(tick.cycle, cycle++);
    }
    EXPECT_EQ(schedule.deadline(), Time(6ms));
    EXPECT_EQ(schedule.counters().overruns, 1U) << "one overrun, however many deadlines it has cost";
    EXPECT_EQ(schedule.counters().caught_up, 3U);
    EXPECT_EQ(schedule.counters().skipped, 0U);
}

TEST(CyclicSchedule, CatchesUpNoMoreThanTheLimit) {
    CyclicSchedule schedule(1ms, 0us);
    schedule.set_policy(OverrunPolicy::catch_up, 4);
    schedule.start(Time(0us));
    auto tick = schedule.wake(Time(101ms));  // 100 deadlines were missed
    EXPECT_EQ(tick.skipped, 96U);
    EXPECT_EQ(tick.deadline, Time(97ms));
    EXPECT_EQ(tick.cycle, 97U);
    EXPECT_TRUE(tick.caught_up);
    for (int n = 0; n < 3; ++n) EXPECT_TRUE(schedule.wake(Time(101ms)).caught_up);
    tick = schedule.wake(Time(101ms));
    EXPECT_FALSE(tick.caught_up);
    EXPECT_EQ(tick.deadline, Time(101ms));
    EXPECT_EQ(schedule.counters().caught_up, 4U);
    EXPECT_EQ(schedule.counters().skipped, 96U);
    // The task is late for each further cycle. All of them are one overrun, until the task is in time.
    (void)schedule.wake(Time(103500us));
    (void)schedule.wake(Time(104500us));
    EXPECT_EQ(schedule.counters().overruns, 2U);
}

TEST(CyclicSchedule, StopsAtTheFirstOverrunUntilItIsStartedAgain) {
    CyclicSchedule schedule(1ms, 0us);
    schedule.set_policy(OverrunPolicy::stop);
    schedule.start(Time(0us));
    EXPECT_FALSE(schedule.wake(Time(1999us)).stopped) << "late, but in its period";
    auto tick = schedule.wake(Time(3500us));
    EXPECT_TRUE(tick.stopped);
    EXPECT_EQ(tick.skipped, 1U);
    EXPECT_TRUE(schedule.stopped());
    const Time due = schedule.deadline();
    EXPECT_TRUE(schedule.wake(Time(3600us)).stopped) << "before the next deadline";
    EXPECT_TRUE(schedule.wake(Time(9ms)).stopped);
    EXPECT_EQ(schedule.deadline(), due);
    EXPECT_EQ(schedule.counters().overruns, 1U);
    schedule.start(Time(10ms));
    EXPECT_FALSE(schedule.stopped());
    EXPECT_EQ(schedule.wake(schedule.deadline()).cycle, 1U);
    EXPECT_EQ(schedule.counters().overruns, 0U);
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

// The test uses a few milliseconds of real time. No test in virtual time can show that the kernel wakes the task by the
// clock of now().
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

TEST(CyclicRunner, WithAWrongOptionThereIsNoCycleAndTheOptionIsNamed) {
    const CyclicOptions right{.lock_memory = false, .hold_latency = false};
    EXPECT_EQ(CyclicRunner(right).wrong_option(), nullptr);
    CyclicOptions options[6]{right, right, right, right, right, right};
    options[0].period = Duration::zero();
    options[1].period = -1ms;
    options[2].period = Duration::min();
    options[3].spin = -1us;
    options[4].runtime = -1us;
    options[5].cpu = -2;
    constexpr const char* kNames[]{"`period`", "`period`", "`period`", "`spin`", "`runtime`", "`cpu`"};
    for (std::size_t n = 0; n < std::size(options); ++n) {
        SCOPED_TRACE(n);
        options[n].priority = n == 0 ? 10 : 0;
        CyclicRunner runner(options[n]);
        ASSERT_NE(runner.wrong_option(), nullptr);
        EXPECT_NE(std::string_view(runner.wrong_option()).find(kNames[n]), std::string_view::npos);
        const int policy = ::sched_getscheduler(0);
        const auto refusals = runner.prepare();
        ASSERT_EQ(refusals.size(), 1U);
        EXPECT_STREQ(refusals[0].what, runner.wrong_option());
        EXPECT_EQ(refusals[0].error, EINVAL);
        EXPECT_EQ(::sched_getscheduler(0), policy) << "nothing is applied";
        runner.start();
        const Time before = CyclicRunner::now();
        for (int more = 0; more < 3; ++more) EXPECT_TRUE(runner.wait().stopped);
        EXPECT_LT(CyclicRunner::now() - before, 500ms);
    }
}

TEST(CyclicRunner, SaysThatThereIsNoSuchInterfaceOrPriority) {
    for (const int irq_priority : {0, 90}) {
        CyclicRunner runner(
            {.lock_memory = false, .hold_latency = false, .interface = "nowhere0", .irq_priority = irq_priority});
        const auto refusals = runner.prepare();
        ASSERT_EQ(refusals.size(), 1U);
        EXPECT_NE(std::string_view(refusals[0].what).find("no network interface of this name"), std::string_view::npos);
        EXPECT_EQ(refusals[0].error, ENODEV);
    }
    CyclicRunner nameless({.lock_memory = false, .hold_latency = false, .irq_priority = 90});
    const auto said = nameless.prepare();
    ASSERT_EQ(said.size(), 1U);
    EXPECT_NE(std::string_view(said[0].what).find("`irq_priority` needs `interface`"), std::string_view::npos);
    EXPECT_EQ(said[0].error, EINVAL);
    CyclicRunner loopback({.lock_memory = false, .hold_latency = false, .interface = "lo"});
    EXPECT_TRUE(loopback.prepare().empty()) << "without interrupts, and nothing is asked for";
    for (const int priority : {200, 100, -1}) {
        std::thread([priority] {
            CyclicRunner runner({.priority = priority, .lock_memory = false, .hold_latency = false});
            const auto refusals = runner.prepare();
            ASSERT_EQ(refusals.size(), 1U);
            EXPECT_NE(std::string_view(refusals[0].what).find("`priority` is not 1 to 99"), std::string_view::npos);
            EXPECT_EQ(refusals[0].error, EINVAL);
        }).join();
    }
}

TEST(CyclicRunner, HasTheReservedTimeThatTheKernelGrants) {
    std::thread([] {  // the scheduling policy ends with the thread
        CyclicRunner runner(
            {.period = 2ms, .spin = 1ms, .runtime = 200us, .lock_memory = false, .hold_latency = false});
        const auto refusals = runner.prepare();
        if (!refusals.empty()) {
            EXPECT_NE(std::string_view(refusals[0].what).find("SCHED_DEADLINE"), std::string_view::npos);
            EXPECT_NE(refusals[0].error, EINVAL);
            GTEST_SKIP() << refusals[0].what;
        }
        constexpr int kSchedDeadline = 6;
        EXPECT_EQ(::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, kSchedDeadline);
        EXPECT_EQ(runner.spin(), 100us) << "half of the reserved time is for the work";
        std::thread([] {}).join();  // the thread can still start other threads
        runner.start();
        std::uint64_t before = 0;
        for (int n = 0; n < 10; ++n) {
            const auto tick = runner.wait();
            EXPECT_GE(CyclicRunner::now(), tick.deadline);
            EXPECT_GT(tick.cycle, before);
            before = tick.cycle;
        }
    })
        .join();
}

TEST(CyclicRunner, SaysWhyTheKernelReservesNoTime) {
    std::thread([] {
        CyclicRunner runner(
            {.period = 1ms, .priority = 1000, .runtime = 3ms, .lock_memory = false, .hold_latency = false});
        const auto refusals = runner.prepare();
        ASSERT_EQ(refusals.size(), 2U) << "then the priority is tried";
        EXPECT_NE(std::string_view(refusals[0].what).find("longer than the period"), std::string_view::npos);
        EXPECT_EQ(refusals[0].error, EINVAL);
        EXPECT_NE(std::string_view(refusals[1].what).find("SCHED_FIFO"), std::string_view::npos);
    }).join();
    std::thread([] {
        // A thread that is bound to a processor gets no reserved time.
        CyclicRunner runner({.period = 1ms, .runtime = 100us, .cpu = 0, .lock_memory = false, .hold_latency = false});
        const auto refusals = runner.prepare();
        if (refusals.empty()) GTEST_SKIP() << "there is one processor only, or it is a domain of its own";
        EXPECT_EQ(refusals[0].error, EPERM);
        EXPECT_NE(std::string_view(refusals[0].what).find("without `cpu`"), std::string_view::npos);
    }).join();
}

TEST(CyclicRunner, TouchesTheStackOfSmallThreadsToo) {
    pthread_attr_t attributes;
    ASSERT_EQ(::pthread_attr_init(&attributes), 0);
    ASSERT_EQ(::pthread_attr_setstacksize(&attributes, std::size_t{64} * 1024), 0);
    pthread_t thread{};
    const auto run = [](void*) -> void* {
        CyclicRunner runner({.period = 1ms, .hold_latency = false});
        (void)runner.prepare();
        (void)::munlockall();
        return nullptr;
    };
    ASSERT_EQ(::pthread_create(&thread, &attributes, run, nullptr), 0);
    EXPECT_EQ(::pthread_join(thread, nullptr), 0);
    (void)::pthread_attr_destroy(&attributes);
}

TEST(CyclicRunner, StopsAfterAnOverrun) {
    CyclicRunner runner({.period = 100us, .lock_memory = false, .hold_latency = false, .overrun = OverrunPolicy::stop});
    runner.start();
    while (CyclicRunner::now() < runner.deadline() + 100us) {
    }
    EXPECT_TRUE(runner.wait().stopped);
    EXPECT_TRUE(runner.wait().stopped) << "it does not wait any more";
    EXPECT_EQ(runner.overruns().overruns, 1U);
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
