#include "mailbox/coe_sdo.hpp"

#include "mailbox/coe_complete.hpp"

#include <algorithm>

namespace margay {

namespace coe = wire::coe;

namespace {

// Sends an abort to the slave when a transfer ends early, whatever the reason: an error, a timeout, or a cancelled
// request. The abort is also sent if the slave has not answered the first message. Then the slave need not continue,
// and a slave that processes one message at a time accepts the abort after its answer.
class AbortGuard {
  public:
    AbortGuard(MailboxChannel& channel, const MailSession& session, const SdoTransfer& transfer)
        : channel_(channel), session_(session), transfer_(transfer) {}
    AbortGuard(const AbortGuard&) = delete;
    AbortGuard& operator=(const AbortGuard&) = delete;
    ~AbortGuard() {
        if ((transfer_.must_abort() || (transfer_.is_unanswered() && !refused)) && session_.holds())
            channel_.send_final_message(wire::MailboxType::coe, transfer_.abort_message());
    }
    bool refused = false;  // the reply to the last message was an error of the mailbox

  private:
    MailboxChannel& channel_;
    const MailSession& session_;
    const SdoTransfer& transfer_;
};

// A question whose answer shows that the slave has answered all requests before. If exactly one reply is owed, the late
// reply itself shows this, too.
class OrderQuestion final : public MailClient {
  public:
    OrderQuestion(const SdoObject& object, std::uint64_t key, bool only)
        : question_(object, value_), key_(key), only_(only) {}
    std::size_t compose(MutableBytes data) override { return question_.compose(data); }
    Taken accept(const wire::MailboxMessage& mail) override {
        if (question_.accept(mail) != Taken::no) return Taken::all;
        if (!MailboxChannel::can_answer(key_, mail)) return Taken::no;
        ++late;
        settled = only_;
        return only_ ? Taken::all : Taken::more;
    }
    unsigned late = 0;     // late replies of the key
    bool settled = false;  // a late reply has ended the exchange

  private:
    std::array<std::byte, 8> value_{};
    SdoUploadTransfer question_;
    std::uint64_t key_;
    bool only_;
};

SdoObject object_of(std::uint64_t key) {
    if (mail_key::kind_of(key) == mail_key::Kind::tx_pdo || key == mail_key::kAny) return {};
    return {.index = static_cast<std::uint16_t>(key >> 8), .subindex = static_cast<std::uint8_t>(key)};
}

Error complete(Error error, const MailboxChannel& channel, const SdoObject& object, Step step) {
    error.slave = channel.station().number;
    error.step = step;
    error.index = object.index;
    error.subindex = object.subindex;
    return error;
}

// The whole transfer starts again: a segment cannot be repeated, since its toggle bit has been used. A downloaded value
// may be written twice, with the same content. False: it cannot start again.
bool ask_again(MailboxChannel& channel, SdoTransfer& transfer) {
    const bool open = transfer.must_abort();
    if (!transfer.restart()) return false;
    if (open) channel.send_final_message(wire::MailboxType::coe, transfer.abort_message());
    return true;
}

constexpr Duration kUntilReady = std::chrono::milliseconds(1);
// Most late replies come within this time, so the sequence waits for it before it sends a question.
constexpr Duration kSoonLate = std::chrono::milliseconds(5);

}  // namespace

Task<Result<>> settle_owed(MailboxChannel& channel, MailSession& session, std::uint64_t key, MailPatience patience,
                           Step step) {
    Engine& engine = channel.engine();
    const SdoObject about = object_of(key);
    patience.give_up = patience.for_one(engine.now());
    for (Time soon = later(engine.now(), kSoonLate); channel.is_doubtful(key) && engine.now() < soon;) {
        if (engine.now() >= patience.give_up) co_return complete({.code = Errc::timeout}, channel, about, step);
        co_await engine.sleep_for(kUntilReady);
        if (!session.holds()) co_return complete({.code = channel.cut_by()}, channel, about, step);
        if (channel.is_fenced()) soon = later(engine.now(), kSoonLate);
    }
    Error failed{.code = Errc::reply_lost};
    // An error reply may belong to another message, so it never counts as the answer to a question.
    const auto go_on = [&] {
        const bool refused = failed.code == Errc::mailbox_error && engine.now() < patience.give_up;
        return failed.code == Errc::reply_lost || refused;
    };
    for (unsigned n = 0; go_on() && n <= kMostAskedAgain && channel.is_doubtful(key);) {
        const std::uint64_t asked = channel.next_question();
        OrderQuestion question(object_of(asked), key, channel.owes_only(key));
        MailExchange exchange(session, question, {.patience = patience});
        channel.note_question(asked);
        failed = co_await exchange;
        ++n;
        channel.statistics().unexpected += question.late;
        if (question.settled)
            channel.forget_owed();
        else if (failed.code == Errc::none)
            channel.end_doubt();
    }
    if (channel.is_doubtful(key)) co_return complete(failed, channel, about, step);
    co_return Nothing{};
}

Task<Result<>> run_transfer(MailboxChannel& channel, SdoTransfer& transfer, const MailPatience& patience, Step step) {
    MailSession session(channel, wire::MailboxType::coe, patience.priority, patience.give_up);
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return complete(refused, channel, transfer.object(), step);
    if (channel.send_room() < coe::kSdoBytes)
        co_return complete({.code = Errc::unsupported}, channel, transfer.object(), step);
    AbortGuard guard(channel, session, transfer);
    unsigned again = 0;
    for (;;) {
        const bool ready = transfer.prepare();
        if (!ready) {
            const Time now = channel.engine().now();
            if (now >= patience.give_up) co_return complete({.code = Errc::timeout}, channel, transfer.object(), step);
            co_await channel.engine().sleep_until(std::min(patience.give_up, later(now, kUntilReady)));
            if (session.holds()) continue;
            co_return complete({.code = channel.cut_by()}, channel, transfer.object(), step);
        }
        if (transfer.over()) break;
        if (transfer.begins() && channel.is_doubtful(transfer.key()))
            co_await required(settle_owed(channel, session, transfer.key(), patience, step));
        guard.refused = false;
        MailExchange exchange(session, transfer, {.patience = patience, .key = transfer.key()});
        const Error failed = co_await exchange;
        if (failed.code == Errc::none) continue;
        guard.refused = failed.code == Errc::mailbox_error || failed.code == Errc::protocol;
        const bool once_more =
            failed.code == Errc::reply_lost && again < kMostAskedAgain && ask_again(channel, transfer);
        if (!once_more) co_return complete(failed, channel, transfer.object(), step);
        ++again;
    }
    if (transfer.error().code != Errc::none) co_return complete(transfer.error(), channel, transfer.object(), step);
    co_return Nothing{};
}

namespace {

coe::Abort abort_of(const Error& error) {
    return error.code == Errc::sdo_abort ? static_cast<coe::Abort>(error.detail) : coe::Abort::none;
}

}  // namespace

bool is_complete_access_refused(const Error& error) {
    switch (abort_of(error)) {
        case coe::Abort::unsupported_access:
        case coe::Abort::complete_access_unsupported:
        case coe::Abort::unknown_command: return true;
        default: return false;
    }
}

bool may_be_complete_access(const Error& error) {
    switch (abort_of(error)) {
        case coe::Abort::exceeds_mailbox:
        case coe::Abort::no_subindex:
        case coe::Abort::length_mismatch:
        case coe::Abort::length_too_high:
        case coe::Abort::length_too_low:
        case coe::Abort::out_of_memory:
        case coe::Abort::write_only:
        case coe::Abort::general: return true;
        default: return is_complete_access_refused(error);
    }
}

Task<Result<std::size_t>> sdo_upload_once(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                          const MailPatience& patience) {
    SdoUploadTransfer transfer(object, into);
    co_await required(run_transfer(channel, transfer, patience, Step::sdo_upload));
    co_return transfer.bytes();
}

Task<Result<>> sdo_download_once(MailboxChannel& channel, SdoObject object, Bytes value, const MailPatience& patience) {
    SdoDownloadTransfer transfer(object, value);
    co_return co_await required(run_transfer(channel, transfer, patience, Step::sdo_download));
}

Task<Result<std::size_t>> sdo_upload(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                     const MailPatience& patience) {
    Error first;
    if (!object.complete || channel.whole_objects()) {
        auto done = co_await sdo_upload_once(channel, object, into, patience);
        if (done || !object.complete || !may_be_complete_access(done.error())) co_return done;
        first = done.error();
    }
    const auto singly = co_await sdo_upload_singly(channel, object, into, patience);
    if (singly && is_complete_access_refused(first)) channel.no_complete_access = true;
    const Errc code = singly.error().code;
    if (first.code != Errc::none && (code == Errc::sdo_abort || code == Errc::unsupported)) co_return first;
    co_return singly;
}

Task<Result<>> sdo_download(MailboxChannel& channel, SdoObject object, Bytes value, const MailPatience& patience) {
    Error first;
    if (!object.complete || channel.whole_objects()) {
        auto done = co_await sdo_download_once(channel, object, value, patience);
        if (done || !object.complete || !is_complete_access_refused(done.error())) co_return done;
        first = done.error();
    }
    auto singly = co_await sdo_download_singly(channel, object, value, patience);
    if (singly && is_complete_access_refused(first)) channel.no_complete_access = true;
    co_return singly;
}

}  // namespace margay
