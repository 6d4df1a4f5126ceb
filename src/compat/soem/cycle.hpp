// The cycle. This header contains the code of the usual cycle as inline functions, because a call of another function
// would take longer than some steps of the cycle.
#pragma once

#include "compat/soem/facade.hpp"

namespace margay::soem {

// Returns `sum` plus the working counters of all writing datagrams that have returned, because the interface counts
// them twice.
int with_writing(const Session::GroupFacts& facts, int sum);
// Another thread has begun to exchange frames.
int other_sending(const Session::GroupFacts& facts, Errc error);
// For a cycle with an error, or a thread that is not the owner.
int other_cycle(const Session::GroupFacts& facts, Error error);
// The program has written blockLRW since the frames were planned. False: there is no process data to send.
bool plan_again(Session::GroupFacts& facts);

// For a cycle whose frames have all returned, so that no other check of the reading is needed. Before the first mapping
// there is no time.
[[gnu::always_inline]] inline void show_time(const Session::GroupFacts& facts) {
    if (facts.time->slaves != 0) [[likely]]
        *facts.shown_time = static_cast<int64>(facts.time->value);
}

struct Send {
    static constexpr int kNone = 0;
    static int run(Session::GroupFacts& facts) {
        if (*facts.block_lrw != facts.blocked) [[unlikely]]
            if (!plan_again(facts)) return 0;
        const auto sent = send_processdata(*facts.context, facts.group);
        if (!sent) [[unlikely]]
            return other_sending(facts, sent.error().code);
        return 1;
    }
};

struct Receive {
    static constexpr int kNone = EC_NOFRAME;
    static int run(Session::GroupFacts& facts, int timeout_us) {
        facts.timeout_us = timeout_us;
        const auto received = receive_processdata(*facts.context, std::chrono::microseconds(timeout_us), facts.group);
        if (!received) [[unlikely]]
            return other_cycle(facts, received.error());
        show_time(facts);
        const int wkc = static_cast<int>(*received);
        if (facts.more_written != 0) [[unlikely]]
            return with_writing(facts, wkc);
        return wkc + facts.written->got;
    }
};

// `group`: 0 to 255.
[[gnu::always_inline]] inline int send_group(ecx_contextt& context, std::uint8_t group) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Send>(place_of(port).load(std::memory_order_relaxed), &port, group);
}
[[gnu::always_inline]] inline int receive_group(ecx_contextt& context, std::uint8_t group, int timeout) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Receive>(place_of(port).load(std::memory_order_relaxed), &port, group, timeout);
}

}  // namespace margay::soem
