// The last checks: they judge all messages that the slave has sent during the run.
#include "subdevice_check/check.hpp"

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;

constexpr Duration kSlowReply = 50ms;

void fail_for(Session& session, Oddity oddity, std::string_view what, std::string_view clause = {}) {
    const auto& record = session.mail.record(oddity);
    if (record.count != 0)
        session.bench.fail(fmt::format("{} {}, the first: {}", record.count, what, record.example), clause);
}

void needs_messages(Session& session) {
    if (!session.bench.has_mailbox()) session.bench.skip("the SII describes no mailbox");
    if (session.mail.messages() == 0) session.bench.skip("the slave sent no message in this run");
}

void check_counters(Session& session) {
    needs_messages(session);
    fail_for(session, Oddity::counter_zero, "messages with the reserved counter 0");
    fail_for(session, Oddity::counter_order, "messages whose counter does not follow that of the message before");
}

void check_lengths(Session& session) {
    needs_messages(session);
    fail_for(session, Oddity::too_long, "messages longer than the mailbox");
    fail_for(session, Oddity::too_short, "messages shorter than the header of their protocol");
    fail_for(session, Oddity::surplus, "messages longer than their content");
}

void check_unasked(Session& session) {
    needs_messages(session);
    fail_for(session, Oddity::unasked_reply, "replies that answer no request");
    fail_for(session, Oddity::other_station, "messages with the address of another station");
    fail_for(session, Oddity::protocol_unknown, "messages of a protocol that the SII does not announce");
}

void check_headers(Session& session) {
    needs_messages(session);
    fail_for(session, Oddity::channel, "messages whose channel, which is reserved, is not 0");
    fail_for(session, Oddity::coe_number, "messages of CoE whose number is not 0");
    fail_for(session, Oddity::reserved_bit, "messages whose bit 7 of the octet with type and counter is not 0");
    fail_for(session, Oddity::complete_bit, "SDO responses whose bit Complete Access is not that of the request",
             "ETG.1000.6, SDO Upload Response; SDO Download Response");
    fail_for(session, Oddity::abort_service, "aborts with another CoE service than SDO request (2)",
             "ETG.1000.6, Abort SDO Transfer Request");
}

void check_emergencies(Session& session) {
    session.mail.needs_protocol(mailbox_protocol::kCoE, "CoE");
    if (session.mail.emergencies() == 0) session.bench.skip("the slave sent no emergency in this run");
    fail_for(session, Oddity::repeated_emergency, "emergencies sent again for the same cause");
}

void check_times(Session& session) {
    session.mail.needs_mailbox();
    if (!session.mail.any_reply()) session.bench.skip("no reply was measured in this run");
    if (session.mail.slowest_reply() > kSlowReply)
        session.bench.remark(fmt::format("the slowest reply took {} ms", session.mail.slowest_reply() / 1ms));
}

constexpr Check kMessageChecks[] = {
    {"messages.counters", "the counter of the slave's messages runs from 1 to 7",
     "ETG.1000.4, Mailbox (counter of the header)", check_counters},
    {"messages.lengths", "the length of each message is that of its content", "ETG.1000.4, Mailbox (header)",
     check_lengths},
    {"messages.headers", "headers have the bits of the standard",
     "ETG.1000.4, Mailbox (header); ETG.1000.6, CoE header", check_headers},
    {"messages.unasked", "the slave sends replies to requests, and events of its own protocols", "ETG.1000.4, Mailbox",
     check_unasked},
    {"messages.emergencies", "one emergency for each cause", "ETG.1000.6, Emergency", check_emergencies},
    {"messages.times", "replies come soon", "ETG.2000, Mailbox/Timeout", check_times},
};

}  // namespace

std::span<const Check> message_checks() { return kMessageChecks; }

}  // namespace margay::samples::conformance
