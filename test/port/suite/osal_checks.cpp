// The checks of an Osal.
#include "run.hpp"

namespace margay::port {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kNoSecondThread = "the port has no call_later()";
constexpr std::string_view kStandsStill = "the clock stands still";

// A call from outside the thread of the suite, and what it does there.
struct LaterCall {
    Run& run;
    void (*action)(LaterCall&);
    std::atomic<std::uint32_t> word{1};
    std::uintptr_t thread = 0;
    std::atomic<std::uint32_t> done{0};

    void begin(Duration delay) {
        run.port.call_later(
            run.port.user, delay,
            [](void* self) {
                auto& call = *static_cast<LaterCall*>(self);
                call.action(call);
                call.done.store(1, std::memory_order_release);
            },
            this);
    }
    // Waits for the end of the call without the functions that are checked. Without this the call could use this object
    // after its end.
    void finish() {
        while (done.load(std::memory_order_acquire) == 0) {
        }
    }
};

void never_backwards(Run& run) {
    Time last = run.osal.now();
    for (unsigned n = 0; n < 20'000; ++n) {
        if (n % 1000 == 0) run.osal.wait(last + 100us, -1);
        const Time now = run.osal.now();
        if (now < last) return run.fail("the time went back by ", Run::microseconds(last - now), " µs");
        last = now;
    }
}

void advances_in_small_steps(Run& run) {
    Durations steps;
    while (!steps.full()) {
        const Time before = run.osal.now();
        Run::ClockWatch watch;
        while (run.osal.now() == before) {
            if (watch.stands_still(before)) return run.fail(kStandsStill);
            run.osal.wait(before + 1us, -1);
        }
        steps.add(run.osal.now() - before);
    }
    if (const auto step = steps.median(); step > 1ms)
        run.fail("a tick of ", Run::microseconds(step), " µs; at most 1000 µs are allowed");
}

// Reads both clocks at nearly the same time.
void read_both(Run& run, Time& time, Duration& second) {
    for (unsigned tries = 0; tries < 50; ++tries) {
        second = run.port.second_clock(run.port.user);
        time = run.osal.now();
        if (run.port.second_clock(run.port.user) - second < 50us) return;
    }
}

void steady(Run& run) {
    if (run.port.second_clock == nullptr) return run.skip("the port has no second_clock()");
    Time time{};
    Duration second{};
    read_both(run, time, second);
    for (unsigned n = 0; n < 8; ++n) {
        const Time time_before = time;
        const Duration second_before = second;
        const Time until = time + 40ms;
        if (!run.wait_until(until)) return run.fail(kStandsStill);
        read_both(run, time, second);
        const auto by_osal = (time - time_before).count();
        const auto by_second = (second - second_before).count();
        const auto difference = by_osal > by_second ? by_osal - by_second : by_second - by_osal;
        if (difference > by_second / 100 + Duration(200us).count())
            return run.fail("now() counts ", Run::microseconds(Duration(by_osal)), " µs, the second clock ",
                            Run::microseconds(Duration(by_second)), " µs");
    }
}

void wait_ends_in_time(Run& run) {
    Durations late;
    for (unsigned n = 0; n < 21; ++n) {
        const Time until = run.osal.now() + 3ms;
        if (!run.wait_until(until)) return run.fail(kStandsStill);
        late.add(run.osal.now() - until);
    }
    if (late.median() > run.port.latest) run.fail("wait() returns ", Run::microseconds(late.median()), " µs late");
}

void past_is_over(Run& run) {
    Durations taken;
    for (unsigned n = 0; n < 21; ++n) {
        const Time start = run.osal.now();
        run.osal.wait(n % 2 == 0 ? start : start - 1s, -1);
        run.osal.wait(Time{}, -1);
        taken.add(run.osal.now() - start);
    }
    if (taken.median() > run.port.latest) run.fail("it takes ", Run::microseconds(taken.median()), " µs");
}

void wake_ends_wait(Run& run) {
    if (run.port.call_later == nullptr) return run.skip(kNoSecondThread);
    LaterCall call{run, [](LaterCall& self) { self.run.osal.wake(); }};
    const Time start = run.osal.now();
    call.begin(5ms);
    run.osal.wait(start + 3s, -1);
    const auto taken = run.osal.now() - start;
    call.finish();
    // A wait() that returned before the wake(): the wake() ends the next wait(). Nothing must be left for later checks.
    run.osal.wait(run.osal.now() + 5ms, -1);
    if (taken > 1500ms) run.fail("wait() returned ", Run::microseconds(taken), " µs after its begin");
}

void wake_is_kept(Run& run) {
    if (run.port.call_later == nullptr) return run.skip(kNoSecondThread);
    run.osal.wake();
    const Time start = run.osal.now();
    run.osal.wait(start + 3s, -1);
    if (run.osal.now() - start > 1500ms) run.fail("a wake() shortly before the wait() is lost");
}

void wake_is_used_up(Run& run) {
    if (run.port.call_later == nullptr) return run.skip(kNoSecondThread);
    // The wait() after a wake() returns at once. If a port that sleeps returned at once from then on, the processor
    // would never rest. In the last milliseconds a port may poll instead of sleeping, so they do not count.
    const auto calls_in_20_ms = [&] {
        std::uint32_t calls = 0;
        const Time until = run.osal.now() + 20ms;
        for (; run.osal.now() < until - 3ms; ++calls) run.osal.wait(until, -1);
        (void)run.wait_until(until);
        return calls;
    };
    const auto before = calls_in_20_ms();
    run.osal.wake();
    run.osal.wake();
    const auto after = calls_in_20_ms();
    if (after > before * 10 + 10)
        run.fail(std::uint64_t{after}, " calls in 20 ms; before the wake() ", std::uint64_t{before});
}

void wake_ends_endless_wait(Run& run) {
    if (run.port.call_later == nullptr) return run.skip(kNoSecondThread);
    // Only after a wait() with a limit has shown that wake() works: otherwise the suite would not end.
    LaterCall trial{run, [](LaterCall& self) { self.run.osal.wake(); }};
    const Time start = run.osal.now();
    trial.begin(1ms);
    run.osal.wait(start + 3s, -1);
    const bool works = run.osal.now() - start < 1500ms;
    trial.finish();
    if (!works) return run.fail("wake() does not end a wait() with a limit");
    LaterCall call{run, [](LaterCall& self) { self.run.osal.wake(); }};
    call.begin(5ms);
    run.osal.wait(kNever, -1);
    call.finish();
    run.osal.wait(run.osal.now() + 1ms, -1);
}

void sleep_of_another_value(Run& run) {
    const std::atomic<std::uint32_t> word{7};
    const Time start = run.osal.now();
    run.osal.sleep_while(word, 6, start + 3s);
    if (run.osal.now() - start > 1500ms) run.fail("it slept although the word had another value");
}

void sleep_ends_in_time(Run& run) {
    const std::atomic<std::uint32_t> word{7};
    Durations late;
    for (unsigned n = 0; n < 11; ++n) {
        const Time until = run.osal.now() + 3ms;
        Run::ClockWatch watch;
        for (Time now = run.osal.now(); now < until; now = run.osal.now()) {
            if (watch.stands_still(now)) return run.fail(kStandsStill);
            run.osal.sleep_while(word, 7, until);
        }
        late.add(run.osal.now() - until);
    }
    if (late.median() > run.port.latest) run.fail("it returns ", Run::microseconds(late.median()), " µs late");
}

void sleepers_wake(Run& run) {
    if (run.port.call_later == nullptr || !run.port.several_threads) return run.skip("the port has one thread");
    LaterCall call{run, [](LaterCall& self) {
                       self.word.store(2, std::memory_order_release);
                       self.run.osal.wake_sleepers(&self.word);
                   }};
    const Time start = run.osal.now();
    call.begin(5ms);
    while (call.word.load(std::memory_order_acquire) == 1 && run.osal.now() - start < 5s)
        run.osal.sleep_while(call.word, 1, start + 3s);
    const auto taken = run.osal.now() - start;
    call.finish();
    if (taken > 1500ms) run.fail("the sleeper returned ", Run::microseconds(taken), " µs after its begin");
}

void threads_have_numbers(Run& run) {
    if (run.port.call_later == nullptr || !run.port.several_threads) return run.skip("the port has one thread");
    const auto mine = run.osal.thread_number();
    LaterCall call{run, [](LaterCall& self) { self.thread = self.run.osal.thread_number(); }};
    call.begin(1ms);
    call.finish();
    if (mine == 0 || call.thread == 0) return run.fail("a thread has the number 0");
    if (mine == call.thread) return run.fail("two threads have the same number");
    if (mine != run.osal.thread_number()) run.fail("the number of a thread has changed");
}

}  // namespace

void check_osal(Run& run) {
    run.check("now() never goes backwards", never_backwards);
    run.check("now() advances in steps of at most 1 ms", advances_in_small_steps);
    run.check("now() counts at the rate of a second clock", steady);
    run.check("wait() returns in time", wait_ends_in_time);
    run.check("wait() for a time in the past returns at once", past_is_over);
    run.check("wake() ends one wait(), not all later ones", wake_is_used_up);  // before all other calls of wake()
    run.check("wake() ends a wait()", wake_ends_wait);
    run.check("wake() before a wait() ends it", wake_is_kept);
    run.check("wake() ends a wait() without a limit", wake_ends_endless_wait);
    run.check("sleep_while() returns if the word has another value", sleep_of_another_value);
    run.check("sleep_while() returns in time", sleep_ends_in_time);
    run.check("wake_sleepers() ends a sleep", sleepers_wake);
    run.check("threads have different numbers", threads_have_numbers);
}

}  // namespace margay::port
