// The checks of an Osal.
#include "run.hpp"

namespace margay::port {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kOneThread = "the port has one thread";
constexpr std::string_view kStandsStill = "the clock stands still";

// A call from outside the thread of the suite, and the function that it executes.
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
    for (unsigned n = 0; n < 20'000; ++n) {
        const Time now = run.osal.now();
        if (n % 1000 == 0) run.osal.wait(now + 100us, -1);
    }
    if (const auto back = run.osal.longest_step_back(); back > 0ns)
        run.fail("the time went back by ", Run::microseconds(back), " µs");
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

// Fails if the two clocks have counted differently since `from`.
bool counted_alike(Run& run, const Run::Clocks& from, const Run::Clocks& to) {
    const auto by_osal = (to.time - from.time).count();
    const auto by_second = (to.second - from.second).count();
    const auto difference = by_osal > by_second ? by_osal - by_second : by_second - by_osal;
    if (difference <= by_second / 100 + Duration(200us).count()) return true;
    run.fail("now() counts ", Run::microseconds(Duration(by_osal)), " µs, the second clock ",
             Run::microseconds(Duration(by_second)), " µs");
    return false;
}

void steady(Run& run) {
    if (run.port.second_clock == nullptr) return run.skip("the port has no second_clock()");
    auto last = run.read_both();
    for (unsigned n = 0; n < 8; ++n) {
        if (!run.wait_until(last.time + 40ms)) return run.fail(kStandsStill);
        const auto now = run.read_both();
        if (!counted_alike(run, last, now)) return;
        last = now;
    }
}

// A counter of 32 bits that is not extended goes back only after some time.
void good_in_the_whole_run(Run& run) {
    const Time until = run.begin.time + run.port.watched;
    for (Time now = run.osal.now(); now < until; now = run.osal.now())
        if (!run.wait_until(std::min(until, now + 50ms))) return run.fail(kStandsStill);
    if (const auto back = run.osal.longest_step_back(); back > 0ns)
        return run.fail("the time went back by ", Run::microseconds(back), " µs");
    if (run.port.second_clock != nullptr) (void)counted_alike(run, run.begin, run.read_both());
}

// Reads now() again and again for 30 ms. Returns false if the time has gone back. Not by the watched osal, since two
// threads do this at the same time.
bool reads_forwards(Osal& osal) {
    constexpr std::uint32_t kMost = 1'000'000;  // of a clock that stands still
    const Time until = osal.now() + 30ms;
    Time last = osal.now();
    for (std::uint32_t n = 0; n < kMost && last < until; ++n) {
        const Time now = osal.now();
        if (now < last) return false;
        last = now;
    }
    return true;
}

void two_threads_read(Run& run) {
    if (!run.port.several_threads) return run.skip(kOneThread);
    if (run.skips_without(1)) return;
    const auto before = run.read_both();
    LaterCall call{run, [](LaterCall& self) {
                       self.word.store(2, std::memory_order_release);  // both begin
                       self.thread = reads_forwards(*self.run.port.osal) ? 1 : 0;
                   }};
    call.begin(1ms);
    while (call.word.load(std::memory_order_acquire) == 1) {
    }
    const bool forwards = reads_forwards(*run.port.osal);
    call.finish();
    if (!forwards || call.thread == 0) return run.fail("the time went back; does now() need a lock?");
    if (run.port.second_clock != nullptr) (void)counted_alike(run, before, run.read_both());
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
    if (run.skips_without(1)) return;
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
    if (run.skips_without(1)) return;
    run.osal.wake();
    const Time start = run.osal.now();
    run.osal.wait(start + 3s, -1);
    if (run.osal.now() - start > 1500ms) run.fail("a wake() shortly before the wait() is lost");
}

void wake_is_used_up(Run& run) {
    if (run.skips_without(1)) return;
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
    if (run.skips_without(1)) return;
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
    if (!run.port.several_threads) return run.skip(kOneThread);
    if (run.skips_without(1)) return;
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

// The data that sleeping threads share. It is never destroyed, because a faulty port lets a thread sleep for ever.
struct {
    Osal* osal = nullptr;
    Time until{};
    std::atomic<std::uint32_t> word{1};
    std::atomic<std::uint32_t> begun{0};
    std::atomic<std::uint32_t> awake{0};
} sleepers;

void sleep_on_the_word(void*) {
    sleepers.begun.fetch_add(1, std::memory_order_acq_rel);
    while (sleepers.word.load(std::memory_order_acquire) == 1 &&
           (sleepers.until == kNever || sleepers.osal->now() < sleepers.until))
        sleepers.osal->sleep_while(sleepers.word, 1, sleepers.until);
    sleepers.awake.fetch_add(1, std::memory_order_acq_rel);
}

// Lets threads sleep on one word and wakes them all by one call.
void wake_all(Run& run, unsigned threads, Duration longest) {
    sleepers.osal = run.port.osal;
    sleepers.until = later(run.port.osal->now(), longest);
    sleepers.word.store(1, std::memory_order_release);
    sleepers.begun.store(0, std::memory_order_release);
    sleepers.awake.store(0, std::memory_order_release);
    for (unsigned n = 0; n < threads; ++n) run.port.call_later(run.port.user, 1ms, sleep_on_the_word, nullptr);
    // A busy machine lets threads wait before they begin.
    for (Time end = run.osal.now() + 5s; sleepers.begun.load(std::memory_order_acquire) != threads;)
        if (run.osal.now() > end || !run.wait_until(run.osal.now() + 1ms)) break;
    (void)run.wait_until(run.osal.now() + 20ms);  // now they sleep
    sleepers.word.store(2, std::memory_order_release);
    run.osal.wake_sleepers(&sleepers.word);
    const Time start = run.osal.now();
    const auto all_return_in = [&](Duration limit) {
        while (sleepers.awake.load(std::memory_order_acquire) != threads)
            if (run.osal.now() - start > limit || !run.wait_until(run.osal.now() + 1ms)) return false;
        return true;
    };
    if (all_return_in(1500ms)) return;
    run.fail("only ", std::uint64_t{sleepers.awake.load()}, " of ", std::uint64_t{threads}, " returned");
    if (longest == Duration::max() || !all_return_in(longest + 1500ms)) run.lose_call();
}

void all_sleepers_wake(Run& run) {
    if (!run.port.several_threads) return run.skip(kOneThread);
    if (!run.skips_without(2)) wake_all(run, 2, 3s);
}

void endless_sleep_ends(Run& run) {
    if (!run.port.several_threads) return run.skip(kOneThread);
    if (!run.skips_without(1)) wake_all(run, 1, Duration::max());
}

void threads_have_numbers(Run& run) {
    if (!run.port.several_threads) return run.skip(kOneThread);
    if (run.skips_without(1)) return;
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
    run.check("wake_sleepers() ends the sleep of all threads", all_sleepers_wake);
    run.check("threads have different numbers", threads_have_numbers);
    run.check("now() is right when two threads call it", two_threads_read);
    run.check("wake_sleepers() ends a sleep without a limit", endless_sleep_ends);  // may not give its thread back
}

void check_clock_of_run(Run& run) { run.check("now() is right in the whole run", good_in_the_whole_run); }

}  // namespace margay::port
