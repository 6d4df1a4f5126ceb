// Measures the wake-up latency of a periodic task: CyclicRunner and a plain loop of clock_nanosleep, alternately
// within one run, so that both have the same conditions. The output is the lateness. The promise is the ratio of the
// 99th percentiles: at most a tenth. This program is not a test, because the result depends on the load of the
// machine.
#include "osal/duration_histogram.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <time.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <thread>

namespace {

using namespace margay;

constexpr Duration kPeriod = std::chrono::milliseconds(1);
constexpr int kCyclesOfATurn = 500;

void plain_loop(DurationHistogram& lateness) {
    timespec next{};
    ::clock_gettime(CLOCK_MONOTONIC, &next);
    next.tv_nsec = 0;
    next.tv_sec += 1;
    const Time start = Time(std::chrono::seconds(next.tv_sec));
    for (int n = 0; n < kCyclesOfATurn; ++n) {
        const Time deadline = start + n * kPeriod;
        next.tv_nsec = static_cast<long>((n * kPeriod).count());
        (void)::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
        lateness.record(CyclicRunner::now() - deadline);
    }
}

void print(const char* name, const DurationHistogram& lateness) {
    const auto us = [](Duration d) { return static_cast<double>(d.count()) / 1000; };
    std::printf(
        "%-28s %8llu wake-ups   p50 %9.2f us   p99 %9.2f us   p99.9 %9.2f us   p99.99 %9.2f us   most "
        "%9.2f us\n",
        name, static_cast<unsigned long long>(lateness.count()), us(lateness.quantile(0.5)),
        us(lateness.quantile(0.99)), us(lateness.quantile(0.999)), us(lateness.quantile(0.9999)), us(lateness.max()));
}

}  // namespace

int main(int argc, char** argv) {
    const int turns = argc > 1 ? std::atoi(argv[1]) : 10;
    DurationHistogram plain;
    DurationHistogram runner_lateness;
    std::uint64_t skipped = 0;
    CyclicRunner runner({.period = kPeriod, .spin = std::chrono::microseconds(400), .priority = 80});
    for (int turn = 0; turn < turns; ++turn) {
        std::thread([&] { plain_loop(plain); }).join();
        std::thread([&] {
            for (const auto& refusal : runner.prepare())
                if (turn == 0) std::printf("not granted: %s\n", refusal.what);
            runner.start();
            for (int n = 0; n < kCyclesOfATurn; ++n) {
                const auto tick = runner.wait();
                runner_lateness.record(tick.lateness);
                skipped += tick.skipped;
            }
        }).join();
    }
    print("plain clock_nanosleep", plain);
    print("CyclicRunner", runner_lateness);
    const auto ratio =
        static_cast<double>(runner_lateness.quantile(0.99).count()) / static_cast<double>(plain.quantile(0.99).count());
    std::printf("p99 of the runner / p99 of the plain loop: %.4f (promised: at most 0.1)   deadlines skipped: %llu\n",
                ratio, static_cast<unsigned long long>(skipped));
    return 0;
}
