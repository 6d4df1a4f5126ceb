// The parts of the cycle that the usual cycle does not execute, see cycle.hpp.
#include "compat/soem/cycle.hpp"

namespace margay::soem {
namespace {

// The result of a cycle with an error: the sum of the returned working counters, or EC_NOFRAME.
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

}  // namespace

int with_writing(const Session::GroupFacts& facts, int sum) {
    for (const DatagramStatus& datagram : std::span(facts.written, facts.more_written + 1U))
        if (datagram.came) sum += datagram.got;
    return sum;
}

int other_sending(const Session::GroupFacts& facts, Errc error) {
    if (error != Errc::not_owner) return 0;
    facts.session->be_owner();
    return send_processdata(*facts.context, facts.group).ok() ? 1 : 0;
}

int other_cycle(const Session::GroupFacts& facts, Error error) {
    Session& session = *facts.session;
    Result<std::uint32_t> received(error);
    if (error.code == Errc::not_owner) {
        session.be_owner();
        received = receive_processdata(*facts.context, std::chrono::microseconds(facts.timeout_us), facts.group);
    }
    if (!received) session.find_missing(received.error());
    const int wkc = received ? static_cast<int>(*received) : partial_counter(session, facts.group, received.error());
    if (wkc < 0) return wkc;
    if (facts.time->came) show_time(facts);
    return with_writing(facts, wkc);
}

bool plan_again(Session::GroupFacts& facts) {
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
    facts.set_written(writing_datagrams(*facts.session, facts.group).datagrams);
    return true;
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
