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
int counted_twice(Session& session, std::uint8_t group, unsigned writing) {
    int sum = 0;
    for (const DatagramStatus& datagram : session.context().group(group).datagrams.first(writing))
        if (datagram.came) sum += datagram.got;
    return sum;
}

[[gnu::always_inline]] inline void show_time(ecx_contextt& context, const RegisterReading& time) {
    if (time.came && time.slaves != 0) dc_time(context) = static_cast<int64>(time.value);
}

// A cycle that is not right, or in which datagrams count twice.
[[gnu::noinline]] int other_cycle(ecx_contextt& context, Session& session, const Session::GroupFacts& facts,
                                  const Result<std::uint32_t>& received) {
    const auto group = static_cast<std::uint8_t>(&facts - &session.facts(0));
    const int wkc = received ? static_cast<int>(*received) : partial_counter(session, group, received.error());
    if (wkc < 0) return wkc;
    show_time(context, *facts.time);
    return wkc + counted_twice(session, group, facts.writing_datagrams);
}

struct Send {
    static constexpr int kNone = 0;
    static int run(std::uint8_t group, Session& session) {
        return send_processdata(session.context(), group).ok() ? 1 : 0;
    }
};

struct Receive {
    static constexpr int kNone = EC_NOFRAME;
    static int run(ecx_contextt* context, std::uint8_t group, int timeout, Session& session) {
        const Session::GroupFacts& facts = session.facts(group);
        const auto received = receive_processdata(session.context(), std::chrono::microseconds(timeout), group);
        if (!received || facts.writing_datagrams != 0) [[unlikely]]
            return other_cycle(*context, session, facts, received);
        show_time(*context, *facts.time);
        return static_cast<int>(*received);
    }
};

}  // namespace

int send_group(ecx_contextt& context, std::uint8_t group) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Send>(place_of(port).load(std::memory_order_relaxed), &port, group);
}

int receive_group(ecx_contextt& context, std::uint8_t group, int timeout) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock<Receive>(place_of(port).load(std::memory_order_relaxed), &port, &context, group,
                                        timeout);
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_send_processdata_group(ecx_contextt* context, uint8 group) { return send_group(*context, group); }
int ecx_receive_processdata_group(ecx_contextt* context, uint8 group, int timeout) {
    return receive_group(*context, group, timeout);
}
int ecx_send_processdata(ecx_contextt* context) { return send_group(*context, 0); }
int ecx_receive_processdata(ecx_contextt* context, int timeout) { return receive_group(*context, 0, timeout); }

}  // extern "C"
