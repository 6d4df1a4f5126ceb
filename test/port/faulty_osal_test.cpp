// The suite finds faulty Osals: each of these has one fault that ports really have.
#include "port/host.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace margay::port {
namespace {

using namespace std::chrono_literals;

// Right, unless a test says otherwise.
class FaultyOsal : public Osal {
  public:
    Time now() noexcept override { return real.now(); }
    void wait(Time until, WaitHandles handle) noexcept override { real.wait(until, handle); }
    void wake() noexcept override { real.wake(); }
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
        real.sleep_while(word, value, until);
    }
    void wake_sleepers(const void* word) noexcept override { real.wake_sleepers(word); }
    std::uintptr_t calling_thread() noexcept override { return real.calling_thread(); }

    LinuxOsal real;
};

void expect_found(Osal& osal, const std::string& check) {
    Host host;
    const auto verdict = check_port(host.port(osal));
    const auto all = host.failed();
    EXPECT_EQ(verdict.failed, all.size());
    EXPECT_TRUE(std::ranges::count(all, check) == 1) << "not found: " << check << "\n" << host.text();
}

TEST(FaultyOsals, TheSoundOneFailsNothing) {
    Host host;
    FaultyOsal osal;
    EXPECT_EQ(check_port(host.port(osal)).failed, 0u) << host.text();
}

TEST(FaultyOsals, TheClockGoesBack) {
    // The overflow of the timer is counted one read too late.
    struct : FaultyOsal {
        unsigned reads = 0;
        Time now() noexcept override { return ++reads % 5000 == 0 ? real.now() - 1ms : real.now(); }
    } osal;
    expect_found(osal, "now() never goes backwards");
}

TEST(FaultyOsals, TheTickIsTooLong) {
    struct : FaultyOsal {
        Time now() noexcept override { return Time(real.now().time_since_epoch() / 10ms * 10ms); }
    } osal;
    expect_found(osal, "now() advances in steps of at most 1 ms");
}

TEST(FaultyOsals, TheClockStandsStill) {
    struct : FaultyOsal {
        Time now() noexcept override { return Time(5s); }
        void wait(Time, WaitHandles) noexcept override {}
        void sleep_while(const std::atomic<std::uint32_t>&, std::uint32_t, Time) noexcept override {}
    } osal;
    Host host;
    Port port = host.without_threads(osal, nullptr);
    EXPECT_GE(check_port(port).failed, 3u) << host.text();
    EXPECT_EQ(host.failed().front(), "now() advances in steps of at most 1 ms");
}

TEST(FaultyOsals, TheClockIsTooFast) {
    struct : FaultyOsal {
        Time begin = real.now();
        Time now() noexcept override { return begin + (real.now() - begin) * 103 / 100; }
    } osal;
    expect_found(osal, "now() counts at the rate of a second clock");
}

TEST(FaultyOsals, TheWaitIsRoundedUpToTicksOf200Ms) {
    struct : FaultyOsal {
        void wait(Time until, WaitHandles handle) noexcept override {
            if (until == kNever) return real.wait(until, handle);
            if (until > real.now()) real.wait(Time((until.time_since_epoch() / 200ms + 1) * 200ms), handle);
        }
    } osal;
    expect_found(osal, "wait() returns in time");
}

TEST(FaultyOsals, TheWaitForThePastTakesATick) {
    struct : FaultyOsal {
        void wait(Time until, WaitHandles handle) noexcept override {
            if (until == kNever) return real.wait(until, handle);
            real.wait(std::max(until, real.now() + 80ms), handle);
        }
    } osal;
    expect_found(osal, "wait() for a time in the past returns at once");
}

TEST(FaultyOsals, WakeDoesNothing) {
    struct : FaultyOsal {
        void wake() noexcept override {}
    } osal;
    expect_found(osal, "wake() ends a wait()");
}

TEST(FaultyOsals, AWakeBeforeTheWaitIsLost) {
    // A condition without a flag.
    struct : FaultyOsal {
        std::atomic<bool> waiting{false};
        void wait(Time until, WaitHandles handle) noexcept override {
            waiting = true;
            real.wait(until, handle);
            waiting = false;
        }
        void wake() noexcept override {
            if (waiting) real.wake();
        }
    } osal;
    expect_found(osal, "wake() before a wait() ends it");
}

TEST(FaultyOsals, AWakeIsNeverCleared) {
    struct : FaultyOsal {
        std::atomic<bool> woken{false};
        void wait(Time until, WaitHandles handle) noexcept override {
            if (!woken) real.wait(until, handle);
        }
        void wake() noexcept override {
            woken = true;
            real.wake();
        }
    } osal;
    Host host;
    (void)check_port(host.port(osal));
    // The first wake() of the suite spoils all later waits.
    EXPECT_EQ(std::ranges::count(host.failed(), "wake() ends one wait(), not all later ones"), 1) << host.text();
}

TEST(FaultyOsals, ASleepIsNotEnded) {
    struct : FaultyOsal {
        void wake_sleepers(const void*) noexcept override {}
    } osal;
    expect_found(osal, "wake_sleepers() ends a sleep");
}

TEST(FaultyOsals, ASleepDoesNotCompareTheWord) {
    struct : FaultyOsal {
        void sleep_while(const std::atomic<std::uint32_t>&, std::uint32_t, Time until) noexcept override {
            const std::atomic<std::uint32_t> own{0};
            real.sleep_while(own, 0, until);
        }
    } osal;
    expect_found(osal, "sleep_while() returns if the word has another value");
}

TEST(FaultyOsals, ASleepIsLate) {
    struct : FaultyOsal {
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            real.sleep_while(word, value, until + 150ms);
        }
    } osal;
    expect_found(osal, "sleep_while() returns in time");
}

TEST(FaultyOsals, AllThreadsHaveOneNumber) {
    struct : FaultyOsal {
        std::uintptr_t calling_thread() noexcept override { return 1; }
    } osal;
    expect_found(osal, "threads have different numbers");
}

}  // namespace
}  // namespace margay::port
