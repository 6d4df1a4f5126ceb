// Common parts of the checks of the suite: their results, waiting, and the median of durations.
#pragma once

#include "port_suite.hpp"
#include "watched_osal.hpp"

#include <margay/parts/util/text_writer.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <span>

namespace margay::port {

class Run {
  public:
    explicit Run(const Port& described) : port(described), osal(*described.osal), begin(read_both()) {}

    // Both clocks, read at nearly the same time. Without a second clock its time is zero.
    struct Clocks {
        Time time{};
        Duration second{};
    };
    [[nodiscard]] Clocks read_both() {
        Clocks both{osal.now(), Duration{}};
        if (port.second_clock == nullptr) return both;
        for (unsigned tries = 0; tries < 50; ++tries) {
            both.second = port.second_clock(port.user);
            both.time = osal.now();
            if (port.second_clock(port.user) - both.second < std::chrono::microseconds(50)) break;
        }
        return both;
    }

    const Port& port;
    // The osal of the port, for the thread of the suite. Other threads use the one in `port`.
    WatchedOsal osal;
    const Clocks begin;  // of the run

    // Executes one check and prints its lines. A check ends with the first failure.
    void check(std::string_view name, void (*body)(Run&)) {
        reason_size_ = 0;
        skipped_ = false;
        print_begin(name);
        body(*this);
        print_result(name);
        // A second clock that extends a counter of the board must be read from time to time.
        if (port.second_clock != nullptr) (void)port.second_clock(port.user);
    }

    // A failure has a reason: text and numbers in turn.
    template <class... Parts>
    void fail(const Parts&... parts) {
        if (reason_size_ != 0) return;
        TextWriter text(reason_);
        (text << ... << parts);
        reason_size_ = std::max<std::size_t>(text.text().size(), 1);
    }
    void skip(std::string_view why) {
        fail(why);
        skipped_ = true;
    }
    // True, and the check is skipped, if call_later() does not exist or cannot carry so many calls.
    [[nodiscard]] bool skips_without(unsigned calls) {
        if (port.call_later == nullptr)
            skip("the port has no call_later()");
        else if (calls_lost_ + calls > std::max(port.calls_at_once, 1U))
            skip(calls_lost_ == 0 ? "call_later() carries one call at a time" : "a call has not returned");
        return skipped_;
    }
    // A call of call_later() has not returned and never will.
    void lose_call() { ++calls_lost_; }
    [[nodiscard]] bool failed() const { return reason_size_ != 0; }
    [[nodiscard]] const Verdict& verdict() const { return verdict_; }

    void print(std::string_view line) { port.print(port.user, line); }

    // Frames of the NIC end no wait(): all later waits are short ones, so that the suite comes to its end.
    void poll_the_nic() { polls_ = true; }
    // Waits once, for the time or for the NIC.
    void wait(Time until) {
        if (polls_) until = std::min(until, osal.now() + std::chrono::milliseconds(1));
        const Time arrival = port.nic == nullptr ? kNever : port.nic->next_arrival();
        osal.wait(std::min(until, arrival), port.nic == nullptr ? -1 : port.nic->wait_handle());
    }
    // Waits until `done()` is true. Returns false at `until`, or if the clock stands still.
    template <class Done>
    bool wait_for(Time until, Done done) {
        ClockWatch watch;
        while (!done()) {
            const Time now = osal.now();
            if (now >= until || watch.stands_still(now)) return false;
            wait(until);
        }
        return true;
    }
    // Waits without the NIC. Returns false if the clock stands still.
    bool wait_until(Time until) {
        ClockWatch watch;
        for (Time now = osal.now(); now < until; now = osal.now()) {
            if (watch.stands_still(now)) return false;
            osal.wait(until, -1);
        }
        return true;
    }

    // A wait() that returns at once is correct, so only the number of calls shows that the clock stands still.
    class ClockWatch {
      public:
        [[nodiscard]] bool stands_still(Time now) {
            calls_ = now == last_ ? calls_ + 1 : 0;
            last_ = now;
            return calls_ > kMostCalls;
        }

      private:
        static constexpr std::uint32_t kMostCalls = 10'000'000;
        Time last_{};
        std::uint32_t calls_ = 0;
    };

    static std::uint64_t microseconds(Duration d) {
        return static_cast<std::uint64_t>(std::max<Duration::rep>(d.count(), 0)) / 1000;
    }

  private:
    void print_begin(std::string_view name) {
        std::array<char, 120> line{};
        TextWriter text(line);
        text << "run   " << name;
        print(text.text());
    }
    void print_result(std::string_view name) {
        std::array<char, 200> line{};
        TextWriter text(line);
        text << (skipped_ ? "skip  " : failed() ? "FAIL  " : "ok    ") << name;
        if (failed()) text << ": " << std::string_view(reason_.data(), reason_size_);
        ++(skipped_ ? verdict_.skipped : failed() ? verdict_.failed : verdict_.passed);
        print(text.text());
    }

    std::array<char, 120> reason_{};
    std::size_t reason_size_ = 0;
    bool skipped_ = false;
    bool polls_ = false;
    unsigned calls_lost_ = 0;
    Verdict verdict_;
};

// The median of some durations; it does not depend on a few interruptions by the system.
class Durations {
  public:
    void add(Duration d) {
        if (size_ < all_.size()) all_[size_++] = d;
    }
    [[nodiscard]] bool full() const { return size_ == all_.size(); }
    [[nodiscard]] Duration median() {
        if (size_ == 0) return {};
        std::sort(all_.begin(), all_.begin() + static_cast<std::ptrdiff_t>(size_));
        return all_[size_ / 2];
    }

  private:
    std::array<Duration, 101> all_{};
    std::size_t size_ = 0;
};

void check_osal(Run& run);
void check_nic(Run& run);
void check_timing(Run& run);
// Called after all other checks: checks the clock of the whole run.
void check_clock_of_run(Run& run);

}  // namespace margay::port
