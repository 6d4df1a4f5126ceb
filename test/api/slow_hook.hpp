// A master on a simulated segment whose application has slow hooks, in virtual time.
#pragma once

#include "segment/bench.hpp"

#include <margay/hooked_slave.hpp>

#include <algorithm>
#include <array>

namespace margay {

class HookTest : public SegmentTest {
  protected:
    std::array<std::byte, 512> image{};
    bool cycling = true;

    void begin(int count = 2) {
        for (int n = 0; n < count; ++n) plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up());
    }
    Time step() {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + std::chrono::microseconds(100)), -1);
        segment.advance(osal.now());
        return next;
    }
    void cycle() {
        if (cycling) {
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, std::chrono::microseconds(500));
        }
        (void)step();
    }
    void cycles(int count) {
        while (count-- > 0) cycle();
    }
    // Executes cycles until the condition is true, for at most `most`. Returns the time that this took.
    template <class Holds>
    Duration until(Holds holds, Duration most = std::chrono::seconds(10)) {
        const Time start = osal.now();
        while (!holds() && osal.now() - start < most) cycle();
        return osal.now() - start;
    }
    // The state in the AL status register of the device.
    AlState real(std::uint32_t device) {
        return static_cast<AlState>(segment.slave(device).peek(0x0130, 1)[0] & std::byte{0xF});
    }
    bool all_in(AlState state) {
        return std::ranges::all_of(ctx.slaves(), [&](const Slave& s) { return s.al.state == state; });
    }
    std::string wrong() { return words(what_is_wrong(ctx)); }
    // The texts of all errors() since the last call.
    std::vector<std::string> errors() {
        std::vector<std::string> all;
        while (const auto error = ctx.errors().take()) all.push_back(words(*error));
        return all;
    }
    int events(EventKind kind, std::uint16_t slave) {
        int count = 0;
        while (const auto event = ctx.events().take()) count += event->kind == kind && event->slave == slave ? 1 : 0;
        return count;
    }
};

// A hook around one transition that lasts for a time, of one slave or of all slaves (0).
struct SlowHook {
    Duration lasts{};
    std::uint16_t slave = 0;
    Transition which = Transition::safeop_to_op;
    Moment when = Moment::after;
    bool fails = false;
    int begun = 0;
    int ended = 0;
    static Task<> hook(HookedSlave slave, Transition which, Moment when, void* user) {
        auto& my = *static_cast<SlowHook*>(user);
        if (which != my.which || when != my.when || (my.slave != 0 && slave.number() != my.slave)) co_return Result<>();
        ++my.begun;
        auto slept = co_await slave.sleep(my.lasts);
        (void)slept;
        ++my.ended;
        if (my.fails) co_return Error{.code = Errc::other_state};
        co_return Result<>();
    }
    void set(HostContext& ctx) {
        for (const Slave& s : ctx.slaves()) {
            s.hooks.user = this;
            s.hooks.transition = hook;
        }
    }
};

}  // namespace margay
