// The cycle.
#include "compat/soem/facade.hpp"

namespace margay::soem {
namespace {

// What came back of a cycle that is not right: the sum of the working counters.
int partial_counter(Session& session, std::uint8_t group, const Error& error) {
    if (error.code == Errc::working_counter) return static_cast<int>(error.actual);
    if (error.code != Errc::no_frame) return EC_NOFRAME;
    int sum = 0;
    bool any = false;
    for (const DatagramStatus& datagram : session.context().group(group).datagrams) {
        if (!datagram.came) continue;
        any = true;
        sum += datagram.got;
    }
    return any ? sum : EC_NOFRAME;
}

// The working counters of writing datagrams once more, because the interface counts them twice.
int counted_twice(const Session::GroupFacts& facts) {
    int sum = 0;
    for (const DatagramStatus& datagram : facts.writing)
        if (datagram.came) sum += datagram.got;
    return sum;
}

// Before the first mapping there is no time.
[[gnu::always_inline]] inline void show_time(const Session::GroupFacts& facts) {
    if (facts.time->came && facts.time->slaves != 0) *facts.shown_time = static_cast<int64>(facts.time->value);
}

// Another thread has begun to exchange frames.
[[gnu::noinline]] int other_sending(const Session::GroupFacts& facts, const Error& error) {
    if (error.code != Errc::not_owner) return 0;
    facts.session->be_owner();
    return send_processdata(*facts.context, facts.group).ok() ? 1 : 0;
}

// The thread is not the owner, or the cycle is not right.
[[gnu::noinline]] int other_cycle(const Session::GroupFacts& facts, Error error) {
    Session& session = *facts.session;
    Result<std::uint32_t> received(error);
    if (error.code == Errc::not_owner) {
        session.be_owner();
        received = receive_processdata(*facts.context, std::chrono::microseconds(facts.timeout_us), facts.group);
    }
    if (!received) session.find_missing(received.error());
    const int wkc = received ? static_cast<int>(*received) : partial_counter(session, facts.group, received.error());
    if (wkc < 0) return wkc;
    show_time(facts);
    return wkc + counted_twice(facts);
}

// The program has written blockLRW since the frames were planned. False: there is no process data to send.
[[gnu::noinline]] bool plan_again(Session::GroupFacts& facts) {
    facts.session->be_owner();
    if (facts.empty) return false;
    facts.blocked = *facts.block_lrw;
    GroupConfiguration& config = facts.context->group(facts.group).config;
    const bool block = facts.blocked != 0;
    if (block == config.block_lrw) return true;
    config.block_lrw = block;
    const auto planned = replan_processdata(*facts.context, facts.group);
    if (planned.error().code == Errc::too_many_frames)
        say_once("group " + std::to_string(facts.group) + ": blockLRW: there are not enough frames for it");
    facts.writing = writing_datagrams(*facts.session, facts.group).datagrams;
    return true;
}

struct Send {
    static constexpr int kNone = 0;
    static int run(Session::GroupFacts& facts) {
        if (*facts.block_lrw != facts.blocked) [[unlikely]]
            if (!plan_again(facts)) return 0;
        const auto sent = send_processdata(*facts.context, facts.group);
        if (!sent) [[unlikely]]
            return other_sending(facts, sent.error());
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
        return facts.writing.empty() ? wkc : wkc + counted_twice(facts);
    }
};

}  // namespace

namespace {

[[gnu::always_inline]] inline int send(ecx_contextt& context, std::uint8_t group) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Send>(place_of(port).load(std::memory_order_relaxed), &port, group);
}
[[gnu::always_inline]] inline int receive(ecx_contextt& context, std::uint8_t group, int timeout) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Receive>(place_of(port).load(std::memory_order_relaxed), &port, group, timeout);
}

}  // namespace

int send_group(ecx_contextt& context, std::uint8_t group) { return send(context, group); }
int receive_group(ecx_contextt& context, std::uint8_t group, int timeout) { return receive(context, group, timeout); }
int send_first(ecx_contextt& context) { return send(context, 0); }
int receive_first(ecx_contextt& context, int timeout) { return receive(context, 0, timeout); }

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_send_processdata_group(ecx_contextt* context, uint8 group) { return send_group(*context, group); }
int ecx_receive_processdata_group(ecx_contextt* context, uint8 group, int timeout) {
    return receive_group(*context, group, timeout);
}
int ecx_send_processdata(ecx_contextt* context) { return send_first(*context); }
int ecx_receive_processdata(ecx_contextt* context, int timeout) { return receive_first(*context, timeout); }

}  // extern "C"
