// The suite finds faulty Osals. Each Osal has one fault that real ports have.
#include "port/host.hpp"

#include <margay/parts/osal/virtual/virtual_osal.hpp>

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>

namespace margay::port {
namespace {

using namespace std::chrono_literals;

// All functions are right, unless a test replaces them.
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

void expect_found(Osal& osal, const std::string& check, Nic* nic = nullptr) {
    Host host;
    const auto verdict = check_port(host.port(osal, nic));
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
        std::atomic<unsigned> reads{0};  // several threads ask
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
    // The first wake() of the suite makes all later waits wrong.
    EXPECT_EQ(std::ranges::count(host.failed(), "wake() ends one wait(), not all later ones"), 1) << host.text();
}

TEST(FaultyOsals, ASleepIsNotEnded) {
    struct : FaultyOsal {
        void wake_sleepers(const void*) noexcept override {}
        // The sleep without a limit ends at some time, because the test must end.
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            real.sleep_while(word, value, std::min(until, real.now() + 4s));
        }
    } osal;
    expect_found(osal, "wake_sleepers() ends a sleep");
}

TEST(FaultyOsals, ASleepDoesNotCompareTheWord) {
    struct : FaultyOsal {
        void sleep_while(const std::atomic<std::uint32_t>&, std::uint32_t, Time until) noexcept override {
            const std::atomic<std::uint32_t> own{0};
            real.sleep_while(own, 0, std::min(until, real.now() + 4s));  // the test must end
        }
    } osal;
    expect_found(osal, "sleep_while() returns if the word has another value");
}

TEST(FaultyOsals, ASleepIsLate) {
    struct : FaultyOsal {
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            real.sleep_while(word, value, until == kNever ? until : until + 150ms);
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

// A NIC with a handle that can be read when a frame is there. The slave answers within send().
class NicWithHandle final : public Nic {
  public:
    explicit NicWithHandle(Osal& osal) : osal_(osal) { put_slave_into(segment_, osal.now()); }
    ~NicWithHandle() { ::close(handle_); }
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (frame.size() < 14 || frame.size() > 1518) return SendStatus::failed;
        if (frames_.size() == 16) return SendStatus::busy;
        std::vector<std::byte> copy(frame.begin(), frame.end());
        if (!segment_.process(copy, osal_.now(), 0, Duration{0}).returned) return SendStatus::sent;
        frames_.push_back(std::move(copy));
        EXPECT_EQ(::eventfd_write(handle_, 1), 0);
        return SendStatus::sent;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        eventfd_t one = 0;
        if (frames_.empty() || ::eventfd_read(handle_, &one) != 0) return 0;
        const auto length = std::min(into.size(), frames_.front().size());
        std::copy_n(frames_.front().begin(), length, into.begin());
        frames_.pop_front();
        return length;
    }
    int wait_handle() const noexcept override { return handle_; }

  private:
    Osal& osal_;
    sim::Segment segment_;
    std::deque<std::vector<std::byte>> frames_;
    int handle_ = ::eventfd(0, EFD_NONBLOCK | EFD_SEMAPHORE);
};

TEST(FaultyOsals, TheSoundOneFailsNothingWithANic) {
    Host host;
    FaultyOsal osal;
    NicWithHandle nic(osal);
    EXPECT_EQ(check_port(host.port(osal, &nic)).failed, 0u) << host.text();
}

TEST(FaultyOsals, WakeDoesNotEndAWaitForTheNic) {
    struct : FaultyOsal {
        void wait(Time until, WaitHandles handle) noexcept override {
            if (handle.first < 0) return real.wait(until, handle);
            pollfd frame{handle.first, POLLIN, 0};
            const auto left = std::max<Duration>(until - real.now(), 0ns);
            ::poll(&frame, 1, static_cast<int>(left / 1ms));
        }
    } osal;
    NicWithHandle nic(osal);
    expect_found(osal, "wake() ends a wait() for the NIC", &nic);
}

TEST(FaultyOsals, AWaitForTheNicIgnoresTheTime) {
    struct : FaultyOsal {
        void wait(Time until, WaitHandles handle) noexcept override {
            real.wait(handle.first >= 0 && until > real.now() ? std::max(until, real.now() + 150ms) : until, handle);
        }
    } osal;
    NicWithHandle nic(osal);
    expect_found(osal, "wait() for the NIC returns in time", &nic);
}

TEST(FaultyOsals, OnlyOneSleeperIsWoken) {
    struct : FaultyOsal {
        std::mutex mutex;
        std::condition_variable condition;
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            std::unique_lock lock(mutex);
            if (word.load() != value) return;
            if (until == kNever)
                condition.wait(lock);
            else
                condition.wait_for(lock, until - real.now());
        }
        void wake_sleepers(const void*) noexcept override {
            const std::lock_guard lock(mutex);
            condition.notify_one();
        }
    } osal;
    expect_found(osal, "wake_sleepers() ends the sleep of all threads");
}

// Releases the thread that sleeps without an end.
TEST(FaultyOsals, ASleepWithoutALimitDoesNotEnd) {
    struct : FaultyOsal {
        std::atomic<bool> over{false};
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            if (until == kNever) over.wait(false);
            real.sleep_while(word, value, until);
        }
    } osal;
    Host host;
    const auto verdict = check_port(host.port(osal));
    EXPECT_EQ(verdict.failed, 1u) << host.text();
    EXPECT_EQ(std::ranges::count(host.failed(), "wake_sleepers() ends a sleep without a limit"), 1) << host.text();
    osal.over = true;
    osal.over.notify_all();
}

// A counter of nanoseconds that begins again: after 0.67 s (24 bits at 25 MHz) or 4.29 s (32 bits).
TEST(FaultyOsals, TheClockBeginsAgainLater) {
    struct : Osal {
        VirtualOsal real;
        Duration period{};
        Time now() noexcept override { return Time(real.now().time_since_epoch() % period); }
        void wait(Time until, WaitHandles handle) noexcept override {
            if (until != kNever && until > now()) real.wait(real.now() + (until - now()), handle);
        }
    } osal;
    for (const auto period : {671ms, 4295ms}) {
        osal.period = period;
        Host host;
        auto port = host.without_threads(osal, nullptr);
        port.watched = Port{}.watched;
        EXPECT_EQ(check_port(port).failed, 1u) << host.text();
        EXPECT_EQ(host.failed(), std::vector<std::string>{"now() is right in the whole run"}) << host.text();
    }
}

TEST(FaultyOsals, TheClockJumpsOnce) {
    struct : FaultyOsal {
        Time begin = real.now();
        Time now() noexcept override { return real.now() - begin > 500ms ? real.now() + 10s : real.now(); }
        void wait(Time until, WaitHandles handle) noexcept override { real.wait(by_real(until), handle); }
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            real.sleep_while(word, value, by_real(until));
        }
        Time by_real(Time until) { return until == kNever ? until : until - (now() - real.now()); }
    } osal;
    expect_found(osal, "now() is right in the whole run");
}

// The extension of a counter of 32 bits, without a lock.
TEST(FaultyOsals, TwoThreadsDisturbTheClock) {
    struct : FaultyOsal {
        std::atomic<std::uint32_t> last{static_cast<std::uint32_t>(real.now().time_since_epoch().count())};
        std::atomic<std::int64_t> sum{0};
        std::atomic<unsigned> reads{0};
        Time now() noexcept override {
            const auto count = static_cast<std::uint32_t>(real.now().time_since_epoch().count());
            if (++reads % 16 == 0) std::this_thread::yield();  // the other thread comes between
            sum += static_cast<std::uint32_t>(count - last);
            last = count;
            return Time(Duration(sum));
        }
        void wait(Time until, WaitHandles handle) noexcept override {
            if (until == kNever) return real.wait(until, handle);
            if (const auto left = until - now(); left > 0ns) real.wait(real.now() + left, handle);
        }
        void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
            real.sleep_while(word, value, until == kNever ? until : real.now() + (until - now()));
        }
    } osal;
    expect_found(osal, "now() is right when two threads call it");
}

// A suite that hangs cannot report the fault, but its last line names the check.
TEST(FaultyOsals, AWaitThatNeverEndsIsNamed) {
    struct : FaultyOsal {
        std::atomic<bool> stopped{false};
        std::atomic<bool> over{false};
        void wait(Time until, WaitHandles handle) noexcept override {
            if (!over && until > real.now()) {
                stopped = true;
                stopped.notify_all();
                over.wait(false);
            }
            real.wait(until, handle);
        }
    } osal;
    Host host;
    std::jthread suite([&] { (void)check_port(host.port(osal)); });
    osal.stopped.wait(false);
    EXPECT_EQ(host.begun(), "now() never goes backwards") << host.text();
    osal.over = true;
    osal.over.notify_all();
}

}  // namespace
}  // namespace margay::port
