// The checks of a NIC with times of frames (Nic::timing()). Only the reported features are checked.
#include "far_end.hpp"

#include <margay/timed_send.hpp>

namespace margay::port {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kSize = 60;

// A NIC may have the time of a sent frame a moment later.
std::optional<std::uint64_t> sent_time(Run& run, const FarEnd& far) {
    SendClock& clock = *run.port.nic->timing().sent;
    std::optional<std::uint64_t> time = clock.send_time_ns(far.sent_head());
    const Time until = run.osal.now() + run.port.reply;
    while (!time && run.osal.now() < until && run.wait_until(run.osal.now() + 100us))
        time = clock.send_time_ns(far.sent_head());
    return time;
}

std::optional<std::uint64_t> receive_time(Run& run, const FarEnd& far) {
    return run.port.nic->timing().received->receive_time_ns(far.reply_head());
}

Duration between(std::uint64_t from, std::uint64_t to) { return Duration(static_cast<std::int64_t>(to - from)); }

// Sends two frames with a distance of 20 ms. Their times have the same distance, except for the delays of the program
// between them.
template <class TimeOf>
void clock_counts(Run& run, const TimeOf& time_of) {
    FarEnd far(run);
    std::array<Time, 4> host{};  // before and after each of the frames
    std::array<std::uint64_t, 2> times{};
    for (std::size_t n = 0; n < times.size(); ++n) {
        host[2 * n] = run.osal.now();
        if (!far.exchange(kSize, 0)) return far.report();
        host[2 * n + 1] = run.osal.now();
        const auto time = time_of(run, far);
        if (!time) return run.fail("a frame has no time");
        times[n] = *time;
        if (n == 0 && !run.wait_until(run.osal.now() + 20ms)) return run.fail("the clock stands still");
    }
    const Duration passed = between(times[0], times[1]);
    constexpr Duration kDrift = 20us;  // of the clock of the NIC, in 20 ms
    if (passed < host[2] - host[1] - kDrift || passed > host[3] - host[0] + kDrift)
        run.fail("two frames have left or arrived ", Run::microseconds(host[2] - host[0]),
                 " µs after each other, and their times differ by ", Run::microseconds(passed), " µs");
}

void sent_at_counts(Run& run) { clock_counts(run, sent_time); }

void received_at_counts(Run& run) { clock_counts(run, receive_time); }

void unknown_frames_have_no_time(Run& run) {
    FarEnd far(run);
    if (!far.exchange(kSize, 0)) return far.report();
    std::array<std::byte, SendClock::kHeadBytes> other{};
    const FrameTiming timing = run.port.nic->timing();
    const bool sent = timing.sent != nullptr && timing.sent->send_time_ns(other);
    const bool received = timing.received != nullptr && timing.received->receive_time_ns(other);
    if (sent || received) run.fail("a frame that was never sent has a time");
}

void received_after_sent(Run& run) {
    FarEnd far(run);
    for (unsigned n = 0; n < 20; ++n) {
        const Time before = run.osal.now();
        if (!far.exchange(kSize, 0)) return far.report();
        const Duration host = run.osal.now() - before;
        const auto sent = sent_time(run, far);
        const auto received = receive_time(run, far);
        if (!sent || !received) return run.fail("a frame has no time");
        const Duration trip = between(*sent, *received);
        if (trip < 0ns) return run.fail("a frame was received before it was sent: the clocks are not the same");
        if (trip > host + 1us)
            return run.fail("a frame was on the wire for ", Run::microseconds(trip), " µs, and back after ",
                            Run::microseconds(host), " µs");
    }
}

void leaves_at_its_time(Run& run) {
    TimedSend& timed = *run.port.nic->timing().send_at;
    FarEnd far(run);
    const std::uint64_t missed = timed.missed();
    for (unsigned n = 0; n < 5; ++n) {
        const Time at = run.osal.now() + 20ms;
        timed.set_send_time(at);
        const bool sent = far.send_patiently(kSize, 0);
        timed.set_send_time(TimedSend::kAtOnce);
        if (run.osal.now() > at) return run.fail("send() waits for the time");
        if (!sent || !far.collect(1)) return far.report();
        if (run.osal.now() < at)
            return run.fail("a frame is back ", Run::microseconds(at - run.osal.now()), " µs before its time");
        if (run.osal.now() > at + run.port.reply) return run.fail("a frame leaves too late");
    }
    if (timed.missed() != missed) run.fail("missed() counts frames that have left at their time");
}

void a_time_that_has_passed(Run& run) {
    TimedSend& timed = *run.port.nic->timing().send_at;
    FarEnd far(run);
    const std::uint64_t missed = timed.missed();
    timed.set_send_time(run.osal.now() - 1ms);
    const bool back = far.exchange(kSize, 0);
    timed.set_send_time(TimedSend::kAtOnce);
    if (!back) return far.report();
    if (timed.missed() != missed + 1) return run.fail("missed() does not count a frame whose time had passed");
    if (!far.exchange(kSize, 0)) return far.report();
    if (timed.missed() != missed + 1) run.fail("missed() counts a frame without a time");
}

// Sends a frame that waits until `at`.
[[nodiscard]] bool let_one_wait(Run& run, Time at) {
    FarEnd far(run);
    run.port.nic->timing().send_at->set_send_time(at);
    const bool sent = far.send_patiently(kSize, 0);
    run.port.nic->timing().send_at->set_send_time(TimedSend::kAtOnce);
    if (!sent) far.report();
    return sent;
}

void at_once_overtakes(Run& run) {
    const Time at = run.osal.now() + run.port.reply;
    if (!let_one_wait(run, at)) return;
    FarEnd far(run);
    const bool back = far.exchange(kSize + 2, 0);
    if (run.osal.now() >= at) run.fail("a frame without a time waits for one that has a time");
    if (!back) return far.report();
    (void)run.wait_until(at);
    far.drain();  // of the frame that has waited
}

}  // namespace

void check_timing(Run& run) {
    const FrameTiming timing = run.port.nic->timing();
    if (timing.sent != nullptr) run.check("the times of sent frames count as the clock does", sent_at_counts);
    if (timing.received != nullptr)
        run.check("the times of received frames count as the clock does", received_at_counts);
    if (timing.sent != nullptr || timing.received != nullptr)
        run.check("a frame that was not sent has no time", unknown_frames_have_no_time);
    if (timing.sent != nullptr && timing.received != nullptr)
        run.check("a frame is received after it was sent", received_after_sent);
    if (timing.send_at == nullptr) return;
    run.check("a frame leaves at its time", leaves_at_its_time);
    run.check("a frame whose time has passed leaves at once, and is counted", a_time_that_has_passed);
    run.check("a frame without a time leaves at once", at_once_overtakes);
}

}  // namespace margay::port
