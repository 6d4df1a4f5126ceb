// The cycle.
#include "compat/soem/facade.hpp"

namespace margay::soem {
namespace {

template <class Work>
[[gnu::always_inline]] inline int with_lock(ecx_contextt& context, int none, Work work) {
    ecx_portt& port = port_of(context);
    return Sessions::with_lock(place_of(port).load(std::memory_order_relaxed), &port, none, work);
}

// What came back of a cycle that is not right: the sum of the working counters.
[[gnu::noinline]] int partial_counter(Session& session, std::uint8_t group, const Error& error) {
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
[[gnu::noinline]] int counted_twice(Session& session, std::uint8_t group, unsigned writing) {
    int sum = 0;
    for (const DatagramStatus& datagram : session.context().group(group).datagrams.first(writing))
        if (datagram.came) sum += datagram.got;
    return sum;
}

}  // namespace

int send_group(ecx_contextt& context, std::uint8_t group) {
    return with_lock(context, 0,
                     [=](Session& session) { return send_processdata(session.context(), group).ok() ? 1 : 0; });
}

int receive_group(ecx_contextt& context, std::uint8_t group, int timeout) {
    return with_lock(context, EC_NOFRAME, [=, &context](Session& session) {
        const auto received = receive_processdata(session.context(), std::chrono::microseconds(timeout), group);
        int wkc = static_cast<int>(*received);
        if (!received) [[unlikely]] {
            wkc = partial_counter(session, group, received.error());
            if (wkc < 0) return wkc;
        }
        const Session::GroupFacts& facts = session.facts(group);
        if (facts.group == nullptr) [[unlikely]]
            return wkc;  // another thread is mapping the group for the first time
        if (facts.writing_datagrams != 0) [[unlikely]]
            wkc += counted_twice(session, group, facts.writing_datagrams);
        const RegisterReading& time = facts.group->dc_time;
        if (time.came && time.slaves != 0) dc_time(context) = static_cast<int64>(time.value);
        return wkc;
    });
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
