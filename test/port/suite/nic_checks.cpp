// The checks of a NIC.
#include "far_end.hpp"

#include <optional>

namespace margay::port {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kSmallest = 28;  // Ethernet header, EtherCAT header, a datagram without data
constexpr std::size_t kLargest = 1514;

void address_is_free(Run& run) {
    const auto mac = run.port.nic->source_mac();
    if ((mac[0] & 3) != 0) run.fail("the first octet is ", std::uint64_t{mac[0]}, "; bits 0 and 1 must be 0");
}

// Waits for a change of the link, which does not end a wait().
template <class Done>
bool becomes(Run& run, Done done) {
    const Time until = run.osal.now() + run.port.longest_plugging;
    while (!done())
        if (run.osal.now() >= until || !run.wait_until(run.osal.now() + 1ms)) return false;
    return true;
}

void link_comes_up(Run& run) {
    Nic& nic = *run.port.nic;
    const bool up = becomes(run, [&] { return nic.link_state() != LinkState::down; });
    if (!up) return run.fail("the link is down; connect a slave");
    for (unsigned n = 1; n <= 100; ++n)
        if (nic.link_state() == LinkState::down)
            return run.fail("the link was up, and call ", std::uint64_t{n}, " after it says down");
}

void a_slave_answers(Run& run) {
    // The first frames after a link has come up may be lost in a switch or in a slave that starts.
    constexpr unsigned kTries = 20;
    for (unsigned n = 1;; ++n) {
        FarEnd far(run);
        if (far.exchange(60, 0)) return;
        if (n != kTries) continue;
        if (!far.is_lost()) return far.report();
        return run.fail(far.is_echo() ? "frames come back without the mark of a slave in the source address"
                                      : "no frame comes back; is there a slave at the cable?");
    }
}

void nothing_to_receive(Run& run) {
    FarEnd far(run);
    far.drain();
    Durations taken;
    while (!taken.full()) {
        const Time start = run.osal.now();
        const auto length = run.port.nic->receive(far.memory());
        taken.add(run.osal.now() - start);
        if (length != 0)
            return run.fail("it returned a frame of ", std::uint64_t{length}, " octets that was never sent");
    }
    if (taken.median() > run.port.longest_call)
        run.fail("it takes ", Run::microseconds(taken.median()), " µs; receive() must not wait");
}

void every_size(Run& run) {
    FarEnd far(run);
    std::size_t alignment = 0;
    for (std::size_t size = kSmallest; size <= kLargest; ++size)
        if (!far.exchange(size, alignment++ % 4)) return far.report();
}

void receive_does_not_wait(Run& run) {
    FarEnd far(run);
    Durations taken;
    while (!taken.full()) {
        if (!far.exchange(kLargest, 0)) return far.report();
        taken.add(far.receive_took());
    }
    if (taken.median() > run.port.longest_call)
        run.fail("it takes ", Run::microseconds(taken.median()), " µs; receive() must not wait");
}

void link_state_does_not_wait(Run& run) {
    Durations taken;
    while (!taken.full()) {
        const Time start = run.osal.now();
        (void)run.port.nic->link_state();
        taken.add(run.osal.now() - start);
    }
    if (taken.median() > 10 * run.port.longest_call)
        run.fail("it takes ", Run::microseconds(taken.median()), " µs; link_state() must not wait");
}

// Frames that nic.hpp permits, but that have no place for a datagram, or have a VLAN tag.
void every_frame_is_taken(Run& run) {
    FarEnd far(run);
    for (const std::size_t size : {14U, 15U, 20U, 27U, 1515U, 1516U, 1517U, 1518U}) {
        const Time until = run.osal.now() + 10 * run.port.reply;
        auto status = far.send_other(size);
        while (status == SendStatus::busy && run.osal.now() < until && run.wait_until(run.osal.now() + 100us))
            status = far.send_other(size);
        if (status != SendStatus::sent)
            return run.fail("send() refuses ", std::uint64_t{size}, " octets; 14 to 1518 are a frame");
    }
    far.drain();
    if (!far.exchange(kLargest, 0)) far.report();
}

void every_size_while_busy(Run& run) {
    // Frames of different sizes follow each other, so that the end of one frame and the begin of the next one are
    // found.
    FarEnd far(run);
    constexpr std::array<std::size_t, 8> kSizes{1514, 28, 61, 1513, 62, 1001, 63, 64};
    for (unsigned round = 0; round < 6; ++round) {
        const auto count = std::min(run.port.burst, kSizes.size());
        for (std::size_t n = 0; n < count; ++n)
            if (!far.send_patiently(kSizes[(n + round) % kSizes.size()], n % 4)) return far.report();
        if (!far.collect(count)) return far.report();
    }
}

void burst_is_complete(Run& run) {
    FarEnd far(run);
    for (const std::size_t size : {kLargest, std::size_t{60}}) {
        for (std::size_t n = 0; n < run.port.burst; ++n)
            if (!far.send_patiently(size, 0)) return far.report();
        // All replies are in the NIC before the first one is fetched.
        (void)run.wait_until(run.osal.now() + run.port.reply / 4);
        if (!far.collect(run.port.burst)) return far.report();
    }
}

void full_is_busy(Run& run) {
    // Many more frames than a NIC stores. Frames may be lost here because the suite does not fetch them. But send()
    // either takes a whole frame or says busy, a busy frame is not on the wire, and no frame is changed, doubled or
    // overtaken.
    FarEnd far(run);
    Durations taken;
    for (unsigned n = 0; n < 300; ++n) {
        const Time start = run.osal.now();
        const auto status = far.send(kLargest, n % 4);
        taken.add(run.osal.now() - start);
        if (status == SendStatus::failed)
            return run.fail("send() returned failed for frame ", std::uint64_t{n}, "; a full queue is busy");
    }
    far.allow_losses();
    (void)run.wait_until(run.osal.now() + run.port.reply / 4);
    if (!far.collect_rest()) return far.report();
    if (taken.median() > run.port.longest_call)
        return run.fail("send() takes ", Run::microseconds(taken.median()), " µs; it must not wait for the wire");
    if (!far.exchange(100, 0)) far.report();
}

void what_is_taken_is_sent(Run& run) {
    // The queue is filled while all replies are fetched at once, so that nothing is lost at the receiver.
    FarEnd far(run);
    for (unsigned round = 0; round < 3; ++round) {
        auto status = SendStatus::sent;
        // A NIC that sends as fast as this program is never full.
        for (unsigned n = 0; n < 100 && status == SendStatus::sent && far.on_the_way() < run.port.on_the_way; ++n) {
            status = far.send(kLargest, 0);
            if (!far.collect_ready()) return far.report();
        }
        if (status == SendStatus::failed) return run.fail("send() returned failed; a full queue is busy");
        const auto missing = far.on_the_way();
        if (!far.collect(missing))
            return run.fail("of ", std::uint64_t{missing}, " frames that send() took, ",
                            std::uint64_t{far.on_the_way()}, " did not come back");
    }
}

void cut_to_the_memory(Run& run) {
    FarEnd far(run);
    for (const std::size_t room : {std::size_t{100}, std::size_t{103}}) {  // not only whole words
        if (!far.send_patiently(1000, 0)) return far.report();
        if (!far.receive_cut(room) || !far.rest_is_gone(room)) return far.report();
    }
    // Memory of the size of the frame, as the library gives it.
    if (!far.send_patiently(kLargest, 0)) return far.report();
    if (!far.receive_cut(kLargest)) return far.report();
    if (!far.exchange(500, 0)) far.report();
}

void illegal_sizes(Run& run) {
    FarEnd far(run);
    for (const std::size_t size : {std::size_t{0}, std::size_t{13}, std::size_t{1519}, std::size_t{2040}})
        if (far.send_raw(size) == SendStatus::sent)
            return run.fail("send() accepted ", std::uint64_t{size}, " octets; 14 to 1518 are a frame");
    if (!far.exchange(kLargest, 0)) far.report();
}

// Waits once, for at most 3 s. Returns how long it took.
Duration wait_for_nic(Run& run) {
    Nic& nic = *run.port.nic;
    const Time start = run.osal.now();
    run.osal.wait(std::min(start + 3s, nic.next_arrival()), nic.wait_handle());
    return run.osal.now() - start;
}

// Sends a frame and receives the reply, with or without a wait(). Returns the duration; an empty value if it failed.
std::optional<Duration> time_of_reply(Run& run, FarEnd& far, bool waits) {
    if (!far.send_patiently(60, 0)) return std::nullopt;
    const Time start = run.osal.now();
    Run::ClockWatch watch;
    const bool polls = !waits && run.port.nic->next_arrival() == kNever;  // virtual time stands still without a wait
    for (Time now = start; polls && far.on_the_way() != 0; now = run.osal.now()) {
        if (now > start + run.port.reply || watch.stands_still(now)) break;
        if (!far.collect_ready()) return std::nullopt;
    }
    if (far.on_the_way() != 0 && !far.collect(1)) return std::nullopt;
    return run.osal.now() - start;
}

// The median of some replies.
std::optional<Duration> usual_time_of_reply(Run& run, FarEnd& far, bool waits) {
    Durations taken;
    for (unsigned n = 0; n < 21; ++n) {
        const auto one = time_of_reply(run, far, waits);
        if (!one) return std::nullopt;
        taken.add(*one);
    }
    return taken.median();
}

// A wait() does not end long after receive() has had the frame.
void wait_ends_with_frame(Run& run, FarEnd& far) {
    const auto polled = usual_time_of_reply(run, far, false);
    const auto waited = polled ? usual_time_of_reply(run, far, true) : polled;
    if (!waited) return far.report();
    if (const Duration late = *waited - *polled; late > run.port.latest)
        run.fail("wait() returns ", Run::microseconds(late), " µs after the frame has come");
}

void frame_ends_wait(Run& run) {
    FarEnd far(run);
    Duration taken{};
    for (unsigned n = 0; n < 5 && taken <= 1500ms; ++n) {
        if (!far.send_patiently(60, 0)) return far.report();
        taken = wait_for_nic(run);
        if (!far.collect(1)) return far.report();
    }
    if (taken > 1500ms) {
        run.fail("wait() returned ", Run::microseconds(taken), " µs after its begin");
        run.poll_the_nic();
    } else {
        wait_ends_with_frame(run, far);
    }
}

// Sends frames and lets them arrive while no thread waits. False: the check has failed.
bool store_frames(Run& run, FarEnd& far, unsigned count) {
    for (unsigned n = 0; n < count; ++n) {
        if (far.send_patiently(60, 0)) continue;
        far.report();
        return false;
    }
    const Time arrived = run.osal.now() + run.port.reply / 4;
    if (run.port.nic->next_arrival() != kNever) {
        (void)run.wait_until(arrived);  // in virtual time, which stands still without a wait
    } else {
        Run::ClockWatch watch;
        for (Time now = run.osal.now(); now < arrived && !watch.stands_still(now);) now = run.osal.now();
    }
    return true;
}

// A frame is there: wait() ends at once, and the frame is the reply.
void expect_wait_ends(Run& run, FarEnd& far) {
    const Duration taken = wait_for_nic(run);
    if (!far.collect(1)) return far.report();
    if (taken > 1500ms)
        run.fail("wait() returned ", Run::microseconds(taken), " µs after its begin, although a frame was there");
}

void stored_frame_ends_wait(Run& run) {
    FarEnd far(run);
    if (store_frames(run, far, 1)) expect_wait_ends(run, far);
}

void frame_that_is_left_ends_wait(Run& run) {
    // The NIC has reported two frames at once, and one of them was received.
    FarEnd far(run);
    if (!store_frames(run, far, 2)) return;
    (void)wait_for_nic(run);  // uses up what the NIC has told: the next wait() ends by the frame that is left
    if (!far.collect(1)) return far.report();
    expect_wait_ends(run, far);
}

void wait_for_nic_ends_in_time(Run& run) {
    FarEnd far(run);
    Durations late;
    for (unsigned n = 0; n < 21; ++n) {
        const Time until = run.osal.now() + 3ms;
        if (run.wait_for(until, [&] { return run.port.nic->receive(far.memory()) != 0; })) continue;
        late.add(run.osal.now() - until);
    }
    if (late.median() > run.port.latest) run.fail("wait() returns ", Run::microseconds(late.median()), " µs late");
}

void wake_ends_wait_for_nic(Run& run) {
    if (run.skips_without(1)) return;
    FarEnd far(run);  // has fetched all frames
    struct Call {
        Osal& osal;
        std::atomic<std::uint32_t> done{0};
    } call{*run.port.osal};
    const Time start = run.osal.now();
    run.port.call_later(
        run.port.user, 5ms,
        [](void* self) {
            static_cast<Call*>(self)->osal.wake();
            static_cast<Call*>(self)->done.store(1, std::memory_order_release);
        },
        &call);
    run.osal.wait(start + 3s, run.port.nic->wait_handle());
    const auto taken = run.osal.now() - start;
    while (call.done.load(std::memory_order_acquire) == 0) {
    }
    run.osal.wait(run.osal.now() + 5ms, -1);  // if the wait() returned before the wake()
    if (taken > 1500ms) run.fail("wait() returned ", Run::microseconds(taken), " µs after its begin");
}

void cable_is_seen(Run& run) {
    if (run.port.plug == nullptr) return run.skip("the port has no plug()");
    Nic& nic = *run.port.nic;
    if (nic.link_state() == LinkState::unknown) return run.skip("link_state() is always unknown");
    FarEnd far(run);
    run.port.plug(run.port.user, false);
    const bool down = becomes(run, [&] { return nic.link_state() == LinkState::down; });
    // Calls without a link return like all others.
    const Time start = run.osal.now();
    for (unsigned n = 0; n < 10; ++n) (void)far.send(60, 0);
    const auto taken = run.osal.now() - start;
    run.port.plug(run.port.user, true);
    if (!down) run.fail("link_state() stays up without a cable");
    if (!becomes(run, [&] { return nic.link_state() == LinkState::up; }))
        return run.fail("link_state() stays down after the cable was connected again");
    if (taken > 1s) return run.fail("10 calls of send() without a cable take ", Run::microseconds(taken), " µs");
    // Frames that were sent without a cable may arrive now, or never.
    far.allow_losses();
    (void)run.wait_until(run.osal.now() + run.port.reply);
    if (!far.collect_rest()) return far.report();
    for (unsigned n = 0; n < 20; ++n)
        if (far.exchange(60, 0)) return;
    run.fail("no frame comes back after the cable was connected again");
}

}  // namespace

void check_nic(Run& run) {
    run.check("source_mac() leaves the mark of the slaves free", address_is_free);
    run.check("link_state() is up with a cable", link_comes_up);
    run.check("link_state() does not wait", link_state_does_not_wait);
    run.check("wait() for the NIC returns in time", wait_for_nic_ends_in_time);
    run.check("wake() ends a wait() for the NIC", wake_ends_wait_for_nic);
    run.check("a slave answers", a_slave_answers);
    run.check("a frame ends a wait()", frame_ends_wait);
    run.check("receive() without a frame returns 0 at once", nothing_to_receive);
    run.check("frames of every size come back unchanged", every_size);
    run.check("receive() of a frame does not wait", receive_does_not_wait);
    run.check("frames of different sizes follow each other", every_size_while_busy);
    run.check("a burst comes back complete and in order", burst_is_complete);
    run.check("send() is busy when the queue is full, and never waits", full_is_busy);
    run.check("what send() takes comes back", what_is_taken_is_sent);
    run.check("a long frame is cut to the memory, and its rest is gone", cut_to_the_memory);
    run.check("send() refuses what is not a frame", illegal_sizes);
    run.check("send() takes all that is a frame", every_frame_is_taken);
    run.check("a frame that is there ends a wait()", stored_frame_ends_wait);
    run.check("a frame that is left ends a wait()", frame_that_is_left_ends_wait);
    run.check("link_state() follows the cable", cable_is_seen);
}

}  // namespace margay::port
