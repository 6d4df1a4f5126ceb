// The mailbox itself: counters, duplicates, the repeat of a lost reply, lengths, types, and a full mailbox.
#include "subdevice_check/check.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::MailboxErrorCode;
using wire::MailboxHeader;
using wire::MailboxType;

constexpr Duration kQuiet = 150ms;  // longer than the reply of a slow slave
constexpr Duration kSlowTaking = 10ms;
constexpr std::string_view kErrorReply = "ETG.1000.6, table Mailbox error reply";

constexpr std::uint16_t kActivate1 = reg::kSyncManagerBase + reg::kSyncManagerStride + 6;
constexpr std::uint16_t kPdiControl1 = reg::kSyncManagerBase + reg::kSyncManagerStride + 7;

void begin_mailbox_check(Session& session) {
    session.mail.needs_mailbox();
    session.bench.enter(AlState::preop);
    (void)session.mail.drain(0ns);
}

void check_empty(Session& session) {
    session.mail.needs_mailbox();
    auto& bench = session.bench;
    bench.enter(AlState::preop);
    std::size_t replies = 0;
    std::string example;
    while (const auto mail = session.mail.take(50ms)) {
        const bool sdo = mail->header.type == MailboxType::coe && mail->data.size() >= coe::kHeaderBytes &&
                         coe::load_header(mail->data).service == coe::Service::sdo_response;
        if (!sdo && mail->header.type != MailboxType::error) continue;
        if (++replies == 1) example = hex(mail->data);
        if (replies == 20) break;
    }
    if (replies != 0)
        bench.fail(fmt::format("after INIT to PREOP the send mailbox has a reply, before any request: {}", example));
}

void check_answers(Session& session) {
    begin_mailbox_check(session);
    const auto message = session.mail.ping();
    const auto is_reply = [&](const Mail& mail) { return session.mail.answers_ping(mail); };
    if (session.mail.ask_if(message.type, message.data, is_reply, MailBench::kResponse)) return;
    session.mail.set_dead("the mailbox does not answer (mailbox.answers)");
    session.bench.fail(
        fmt::format("a request of protocol {} got {}", wire::to_text(message.type), session.mail.no_reply_text()));
}

// ETG.2000: RequestTimeout is 100 ms where the ESI says nothing else.
void check_taken(Session& session) {
    begin_mailbox_check(session);
    const auto message = session.mail.ping();
    session.mail.put(message.type, message.data);
    const Time begun = session.bench.now();
    while ((session.bench.sync_manager_status(0) & wire::sm_status::kMailboxFull) != 0) {
        if (session.bench.now() - begun > MailBench::kResponse) break;
        session.bench.wait(100us);
    }
    const auto took = session.bench.now() - begun;
    if (took > MailBench::kRequest)
        session.bench.fail(fmt::format("a message stays in the receive mailbox for {} ms", took / 1ms));
    else if (took > kSlowTaking)
        session.bench.remark(fmt::format("a message stays in the receive mailbox for {} ms", took / 1ms));
    while (const auto mail = session.mail.take(kQuiet))
        if (!session.mail.answers_ping(*mail)) session.mail.unasked(*mail);
}

void check_one_reply(Session& session) {
    begin_mailbox_check(session);
    (void)session.mail.ping_works(MailBench::kResponse);
    std::size_t more = 0;
    std::string example;
    while (const auto mail = session.mail.take(kQuiet)) {
        const bool emergency = mail->header.type == MailboxType::coe && mail->data.size() >= coe::kHeaderBytes &&
                               coe::load_header(mail->data).service == coe::Service::emergency;
        if (emergency || mail->header.type == MailboxType::eoe) continue;
        if (++more == 1) example = fmt::format("protocol {}: {}", wire::to_text(mail->header.type), hex(mail->data));
        if (more == 20) break;
    }
    if (more != 0) session.bench.fail(fmt::format("one request got {} messages too many, {}", more, example));
}

// The slave must not execute a message whose counter is that of the message before.
void check_duplicate(Session& session) {
    begin_mailbox_check(session);
    auto& mail = session.mail;
    const auto message = mail.ping();
    const MailboxHeader header{.length = static_cast<std::uint16_t>(message.data.size()),
                               .type = message.type,
                               .counter = mail.next_counter()};
    int replies = 0;
    for (int n = 0; n < 2; ++n) {
        if (!mail.try_put(header, message.data)) session.bench.skip("the slave did not take a message");
        while (const auto reply = mail.take(kQuiet)) replies += mail.answers_ping(*reply) ? 1 : 0;
    }
    if (replies == 0) session.bench.skip("the request got no reply (mailbox.answers)");
    if (replies != 1)
        session.bench.fail(
            fmt::format("a message that was sent twice with the counter {} got {} replies", header.counter, replies));
    // The counter 0 is that of a sender without counters: each such message is a new one.
    for (int n = 0; n < 2; ++n) {
        auto without = header;
        without.counter = 0;
        if (!mail.try_put(without, message.data)) session.bench.skip("the slave did not take a message");
        bool replied = false;
        while (const auto reply = mail.take(kQuiet)) replied = replied || mail.answers_ping(*reply);
        if (!replied) {
            session.bench.remark(fmt::format("message {} with the counter 0 got no reply", n + 1));
            return;
        }
    }
}

bool repeat_acknowledged(Bench& bench, bool request) {
    for (const Time until = bench.now() + 200ms; bench.now() < until; bench.wait(200us)) {
        const auto octet = bench.read<std::uint8_t>(kPdiControl1);
        if (((octet & wire::sm_pdi_control::kRepeatAcknowledge) != 0) == request) return true;
    }
    return false;
}

// The reply that was read last is asked for again, as after a lost frame.
void check_repeat(Session& session) {
    begin_mailbox_check(session);
    auto& bench = session.bench;
    auto& mail = session.mail;
    const auto message = mail.ping();
    for (int n = 0; n < 2; ++n) {  // both values of the toggle bit
        const auto reply = mail.ask_if(
            message.type, message.data, [&](const Mail& m) { return mail.answers_ping(m); }, MailBench::kResponse);
        if (!reply) bench.skip("the request got no reply (mailbox.answers)");
        Mail last = *reply;
        while (auto more = mail.take(20ms)) last = *std::move(more);
        const auto activate = bench.read<std::uint8_t>(kActivate1);
        const bool request = (activate & wire::sm_activate::kRepeatRequest) == 0;
        bench.write<std::uint8_t>(kActivate1, static_cast<std::uint8_t>(activate ^ wire::sm_activate::kRepeatRequest));
        if (!repeat_acknowledged(bench, request)) {
            bench.fail("the slave does not acknowledge a repeat request (0x080E bit 1, 0x080F bit 1)");
            return;
        }
        mail.restarted();  // the counter of the repeated reply is not the next one
        const auto again = mail.take(20ms);
        if (!again) {
            bench.fail("the slave acknowledges a repeat request, and the send mailbox stays empty");
            return;
        }
        if (again->header != last.header || again->data != last.data) {
            bench.fail(fmt::format("the repeated reply differs: counter {}, {} instead of counter {}, {}",
                                   again->header.counter, hex(again->data), last.header.counter, hex(last.data)));
            return;
        }
    }
}

// A message with a mistake, and the detail that the error reply must have.
struct BadMessage {
    std::string_view what;
    MailboxHeader header;
    std::vector<MailboxErrorCode> details;
};

void expect_error(Session& session, BadMessage bad, Bytes data) {
    auto& mail = session.mail;
    (void)mail.drain(0ns);
    bad.header.counter = mail.next_counter();
    for (const Time until = session.bench.now() + MailBench::kRequest; !mail.try_put(bad.header, data);) {
        if (session.bench.now() > until) session.bench.skip("the slave does not take messages");
        session.bench.wait(1ms);
    }
    std::optional<Mail> reply;
    while (auto next = mail.take(reply ? kQuiet : MailBench::kResponse)) {
        reply = *std::move(next);
        if (reply->header.type == MailboxType::error) break;
        mail.unasked(*reply);
    }
    if (!reply || reply->header.type != MailboxType::error) {
        session.bench.fail(fmt::format("{}: {}", bad.what,
                                       reply ? "the reply is no mailbox error" : "there is no mailbox error reply"));
        return;
    }
    if (reply->data.size() < wire::kMailboxErrorBytes) return;  // mailbox.lengths reports it
    const auto type = wire::MailboxErrorLayout::type::load(reply->data);
    const auto detail = wire::MailboxErrorLayout::detail::load(reply->data);
    if (type != wire::kMailboxErrorTypeCommand)
        session.bench.fail(fmt::format("{}: the type of the error reply is {}, expected 1", bad.what, type));
    if (std::ranges::find(bad.details, detail) == bad.details.end())
        session.bench.fail(fmt::format("{}: the detail of the error reply is 0x{:04x}, expected 0x{:04x} ({})",
                                       bad.what, static_cast<unsigned>(detail),
                                       static_cast<unsigned>(bad.details.front()), wire::to_text(bad.details.front())));
}

// The slave still works after each mistake of the master.
void expect_ping(Session& session, std::string_view what) {
    if (!session.mail.ping_works(MailBench::kResponse))
        session.bench.fail(fmt::format("after {} the slave answers nothing any more", what));
}

// A harmless request of a protocol: the slave may answer it as it likes, if it only knows the protocol.
struct ProtocolRequest {
    MailboxType type;
    std::uint16_t bit;
    std::array<std::byte, 8> data;
};
constexpr ProtocolRequest kRequests[] = {
    // FoE: read the file "?". EoE: the parameters of the IP address. SoE: the attribute of S-0-0017.
    {MailboxType::foe, mailbox_protocol::kFoE, {std::byte{1}, {}, {}, {}, {}, {}, std::byte{'?'}, {}}},
    {MailboxType::eoe, mailbox_protocol::kEoE, {std::byte{6}, std::byte{1}}},
    {MailboxType::soe, mailbox_protocol::kSoE, {std::byte{1}, std::byte{4}, std::byte{17}}},
};

void expect_known(Session& session, const ProtocolRequest& request) {
    auto& bench = session.bench;
    const std::size_t bytes = request.type == MailboxType::foe ? 7 : 4;
    (void)session.mail.drain(0ns);
    session.mail.put(request.type, Bytes(request.data).first(bytes));
    while (const auto reply = session.mail.take(kQuiet)) {
        const bool unknown =
            reply->header.type == MailboxType::error && reply->data.size() >= wire::kMailboxErrorBytes &&
            wire::MailboxErrorLayout::detail::load(reply->data) == MailboxErrorCode::unsupported_protocol;
        if (!unknown) continue;
        const auto text = fmt::format("the SII announces {}, and in PREOP a message of it gets error 0x0002",
                                      wire::to_text(request.type));
        // Some devices have FoE for their bootloader alone.
        if (bench.slave().boot_mailbox.present())
            bench.remark(text);
        else
            bench.fail(text, "ETG.2010, Mailbox Protocol");
    }
}

void check_type(Session& session) {
    begin_mailbox_check(session);
    const auto data = session.mail.ping().data;
    const auto bytes = static_cast<std::uint16_t>(data.size());
    expect_error(session,
                 {"a message of the undefined type 14",
                  {.length = bytes, .type = static_cast<MailboxType>(14)},
                  {MailboxErrorCode::unsupported_protocol}},
                 data);
    constexpr std::pair<MailboxType, std::uint16_t> kTypes[] = {
        {MailboxType::aoe, mailbox_protocol::kAoE}, {MailboxType::eoe, mailbox_protocol::kEoE},
        {MailboxType::coe, mailbox_protocol::kCoE}, {MailboxType::foe, mailbox_protocol::kFoE},
        {MailboxType::soe, mailbox_protocol::kSoE}, {MailboxType::voe, mailbox_protocol::kVoE}};
    for (const auto& [type, bit] : kTypes)
        if (!session.bench.has(bit))
            expect_error(session,
                         {fmt::format("a message of {}, which the SII does not announce", wire::to_text(type)),
                          {.length = bytes, .type = type},
                          {MailboxErrorCode::unsupported_protocol}},
                         data);
    for (const auto& request : kRequests)
        if (session.bench.has(request.bit)) expect_known(session, request);
    expect_ping(session, "messages of other protocols");
}

void check_length(Session& session) {
    begin_mailbox_check(session);
    const auto message = session.mail.ping();
    const auto most = static_cast<std::uint16_t>(session.mail.out_bytes() - wire::kMailboxHeaderBytes);
    const auto header = [&](unsigned length) {
        return MailboxHeader{.length = static_cast<std::uint16_t>(length), .type = message.type};
    };
    std::vector<MailboxErrorCode> too_long{MailboxErrorCode::invalid_size, MailboxErrorCode::invalid_header};
    std::vector<MailboxErrorCode> too_short{MailboxErrorCode::size_too_short, MailboxErrorCode::invalid_size,
                                            MailboxErrorCode::invalid_header};
    // The message may be of a protocol that the slave does not have: it may look at the protocol before the length.
    if (!session.bench.has(mailbox_protocol::kCoE) && !session.bench.has(mailbox_protocol::kSoE))
        for (auto* const details : {&too_long, &too_short}) details->push_back(MailboxErrorCode::unsupported_protocol);
    expect_error(session, {"a message that announces one octet more than the mailbox has", header(most + 1U), too_long},
                 message.data);
    expect_error(session, {"a message that announces 65535 octets", header(0xFFFF), too_long}, message.data);
    expect_error(session, {"a message of length 0", header(0), too_short}, message.data);
    expect_error(session, {"a message of one octet", header(1), too_short}, message.data);
    expect_ping(session, "messages with wrong lengths");
}

void check_channel(Session& session) {
    begin_mailbox_check(session);
    const auto message = session.mail.ping();
    MailboxHeader header{.length = static_cast<std::uint16_t>(message.data.size()),
                         .channel = 1,
                         .type = message.type,
                         .counter = session.mail.next_counter()};
    if (!session.mail.try_put(header, message.data)) session.bench.skip("the slave does not take messages");
    bool error = false;
    while (const auto mail = session.mail.take(kQuiet)) error = error || mail->header.type == MailboxType::error;
    if (!error) session.bench.remark("a message to channel 1, which is reserved, gets no mailbox error reply");
    expect_ping(session, "a message to channel 1");
}

// Sends messages as fast as the slave accepts them, and reads no reply meanwhile. The slave must answer each message
// that it has accepted.
void check_full(Session& session) {
    begin_mailbox_check(session);
    auto& bench = session.bench;
    auto& mail = session.mail;
    const auto message = mail.ping();
    unsigned taken = 0;
    bool refused = false;
    for (const Time until = bench.now() + 300ms; bench.now() < until && taken < 64;) {
        const MailboxHeader header{.length = static_cast<std::uint16_t>(message.data.size()),
                                   .type = message.type,
                                   .counter = wire::next_mailbox_counter(static_cast<std::uint8_t>(taken % 7))};
        if (mail.try_put(header, message.data)) {
            ++taken;
        } else {
            refused = true;
            bench.wait(1ms);
        }
    }
    unsigned replies = 0;
    while (const auto reply = mail.take(MailBench::kResponse)) {
        replies += mail.answers_ping(*reply) ? 1U : 0U;
        if (replies >= taken) break;
    }
    if (replies != taken)
        bench.fail(fmt::format("the slave took {} messages while no reply was read, and answered {}", taken, replies));
    // The counter of the next message follows that of the last one here.
    if (!refused) bench.remark("64 messages were taken while no reply was read: the receive mailbox was never full");
    while (taken != 0 && mail.next_counter() != (taken - 1) % 7 + 1) {
    }
    expect_ping(session, "a full mailbox");
}

// A message that fills the mailbox to its last octet, and one that uses only its begin.
void check_octets(Session& session) {
    begin_mailbox_check(session);
    auto message = session.mail.ping();
    auto& bench = session.bench;
    message.data.resize(session.mail.out_bytes() - wire::kMailboxHeaderBytes);
    if (message.type == MailboxType::coe) {
        (void)session.mail.drain(0ns);
        session.mail.put(message.type, message.data);
        bool replied = false;
        while (const auto mail = session.mail.take(kQuiet)) replied = replied || !mail->data.empty();
        if (!replied) bench.fail("a message that fills the whole mailbox gets no reply");
    }
    // A write to the first octets only does not fill the mailbox: the slave must not read it.
    std::vector<std::byte> begin(8);
    wire::store_mailbox_header(begin, {.length = 2, .type = message.type, .counter = session.mail.next_counter()});
    bench.write_octets(bench.slave().mailbox.out_start, begin);
    if ((bench.sync_manager_status(0) & wire::sm_status::kMailboxFull) != 0)
        bench.fail("a write to the first eight octets has filled the mailbox", "ETG.1000.4, SyncManager, mailbox mode");
    expect_ping(session, "half a message");
}

// The mailbox works in SAFEOP and OP, too, beside process data.
void check_states(Session& session) {
    session.mail.needs_mailbox();
    auto& bench = session.bench;
    auto& mail = session.mail;
    for (const auto state : {AlState::safeop, AlState::op}) {
        bench.enter(state);
        const auto frames = bench.frames_in(state);
        (void)mail.drain(0ns);
        const auto message = mail.ping();
        mail.put(message.type, message.data);
        const Time until = bench.now() + MailBench::kResponse;
        for (bool replied = false; !replied;) {
            const bool waits = bench.run(std::max<Duration>(until - bench.now(), 1ms), [&] {
                return (bench.sync_manager_status(1) & wire::sm_status::kMailboxFull) != 0;
            });
            const auto reply = waits ? mail.take(0ns) : std::nullopt;
            if (!reply) {
                bench.fail(fmt::format("in {} a request got no reply within {} s", state_text(state),
                                       MailBench::kResponse / 1s));
                break;
            }
            replied = mail.answers_ping(*reply);
            if (!replied) mail.unasked(*reply);
        }
        if (const auto status = bench.al_status(); status.state != state || status.error)
            bench.fail(fmt::format("after a request in {} the slave is in {}", state_text(state), status_text(status)));
    }
}

// A reply that the master has not read is gone after INIT.
void check_forgotten(Session& session) {
    begin_mailbox_check(session);
    const auto message = session.mail.ping();
    session.mail.put(message.type, message.data);
    session.bench.wait(20ms);
    check_empty(session);
    expect_ping(session, "INIT");
}

constexpr std::string_view kDataLink = "ETG.1000.4, Mailbox";

constexpr Check kMailboxChecks[] = {
    {"mailbox.empty", "after INIT no reply waits in the send mailbox", kDataLink, check_empty},
    {"mailbox.answers", "a request is answered", kDataLink, check_answers},
    {"mailbox.taken", "the slave takes a message soon", "ETG.2000, Mailbox/Timeout/RequestTimeout", check_taken},
    {"mailbox.one_reply", "a request gets one reply", kDataLink, check_one_reply},
    {"mailbox.duplicate", "a message with the counter of the one before is dropped",
     "ETG.1000.4, Mailbox (counter of the header)", check_duplicate},
    {"mailbox.repeat", "the last reply is sent again on request", "ETG.1000.4, Mailbox (repeat of a lost message)",
     check_repeat},
    {"mailbox.type", "protocols that the device does not have get error 0x0002", kErrorReply, check_type},
    {"mailbox.length", "wrong lengths get error 0x0006 or 0x0008", kErrorReply, check_length},
    {"mailbox.channel", "a reserved channel gets an error", kErrorReply, check_channel},
    {"mailbox.octets", "a mailbox is full after its last octet", kDataLink, check_octets},
    {"mailbox.full", "every message that was taken is answered", kDataLink, check_full},
    {"mailbox.states", "the mailbox works in SAFEOP and OP", "ETG.1000.6, EtherCAT State Machine", check_states},
    {"mailbox.forgotten", "a reply that was not read is gone after INIT", kDataLink, check_forgotten},
};

}  // namespace

std::span<const Check> mailbox_checks() { return kMailboxChecks; }

}  // namespace margay::samples::conformance
