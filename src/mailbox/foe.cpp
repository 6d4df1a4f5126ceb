#include "mailbox/foe.hpp"

#include "mailbox/arena_buffer.hpp"
#include "mailbox/mailboxes.hpp"

#include <margay/mail_listener.hpp>

#include <algorithm>

namespace margay {

namespace foe = wire::foe;

namespace {

// All FoE messages of a slave: a reply to an earlier transfer cannot be distinguished from a reply to this one.
constexpr std::uint64_t kKey = mail_key::of(mail_key::Kind::foe);
// A slave that repeats its error does so at once.
constexpr Duration kErrorTwice = std::chrono::milliseconds(10);
constexpr Duration kFirstBusyPause = std::chrono::milliseconds(1);
constexpr Duration kLongestBusyPause = std::chrono::milliseconds(32);

Error of_file(Error error, const MailboxChannel& channel, Step step) {
    error.slave = channel.station().number;
    error.step = step;
    return error;
}

// Passes a transfer the mail that no exchange accepts.
class Overheard final : public MailListener {
  public:
    Overheard(MailboxChannel& channel, FoeTransfer& transfer)
        : MailListener(wire::MailboxType::foe), transfer_(transfer) {
        only_slave = channel.station().number;
        channel.mailboxes().listen_last(*this);
    }

  private:
    bool take(const UnaskedMail& mail) override {
        transfer_.overhear(mail.data);
        return false;
    }

    FoeTransfer& transfer_;
};

// Sends the slave an error message when a transfer ends early for any reason: an error, a timeout, or a cancelled
// request. If the slave may answer twice, the next transfer waits for the second answer.
class TransferEnd {
  public:
    TransferEnd(MailboxChannel& channel, const MailSession& session, const FoeTransfer& transfer)
        : channel_(channel), session_(session), transfer_(transfer) {}
    TransferEnd(const TransferEnd&) = delete;
    TransferEnd& operator=(const TransferEnd&) = delete;
    ~TransferEnd() {
        if (!session_.holds()) return;
        const bool ended_by_slave = transfer_.error().code == Errc::foe_error;
        if (transfer_.has_repeated() || ended_by_slave) {
            const Duration again = std::max(mail_timing::kOwedPatience, slowest);
            const Duration most = transfer_.has_repeated() ? again : kErrorTwice;
            channel_.owe_reply(wire::MailboxType::foe, kKey, channel_.engine().now() + most);
        }
        const bool ended_well = transfer_.over() && transfer_.error().code == Errc::none;
        if (!ended_well && transfer_.late() != 0)
            channel_.owe_files(transfer_.late(), channel_.engine().now() + mail_timing::kOwedPatience);
        if (transfer_.must_abort()) channel_.send_final_message(wire::MailboxType::foe, transfer_.abort_message());
    }
    // The longest time that the slave needs for all answers to the last message, if the message was repeated.
    Duration slowest{0};

  private:
    MailboxChannel& channel_;
    const MailSession& session_;
    const FoeTransfer& transfer_;
};

// Measures how long a slave has been busy with one packet, and determines the pause before the message is sent again.
class BusySlave {
  public:
    BusySlave(const FoeRequest& request, Time give_up) : most_(request.busy_timeout), give_up_(give_up) {}
    void answers() {
        since_ = kNever;
        pause_ = kFirstBusyPause;
    }
    // The time at which the message is sent again; kNever: the slave has been busy for too long.
    [[nodiscard]] Time again_at(Time now) {
        since_ = std::min(since_, now);
        if (now >= give_up_ || now - since_ >= most_) return kNever;
        const Time at = std::min(later(now, pause_), give_up_);
        pause_ = std::min(2 * pause_, kLongestBusyPause);
        return at;
    }

  private:
    Duration most_;
    Time give_up_;
    Time since_ = kNever;
    Duration pause_ = kFirstBusyPause;
};

Task<Result<>> transfer_file(MailboxChannel& channel, MailSession& session, FoeTransfer& transfer,
                             const MailPatience& patience, Step step) {
    TransferEnd end(channel, session, transfer);
    const Overheard overheard(channel, transfer);
    Engine& engine = channel.engine();
    BusySlave busy(transfer.request(), patience.give_up);
    unsigned again = 0;
    Time asked{};  // when the message was sent for the first time
    while (!transfer.over()) {
        if (!session.holds()) co_return of_file({.code = channel.cut_by()}, channel, step);
        const bool ready = transfer.prepare();
        if (transfer.over()) break;
        if (!ready) {  // the application has no octets, or no room for octets, at present
            if (engine.now() >= patience.give_up) co_return of_file({.code = Errc::timeout}, channel, step);
            co_await engine.sleep_until(std::min(patience.give_up, later(engine.now(), kFirstBusyPause)));
            continue;
        }
        const bool reply = transfer.awaits_reply();
        MailExchange exchange(
            session, transfer,
            {.patience = patience, .key = kKey, .reply = reply, .distinct = !transfer.is_like_first()});
        if (again == 0) asked = engine.now();
        const Error failed = co_await exchange;
        if (failed.code == Errc::reply_lost && again < kMostAskedAgain) {
            ++again;
            transfer.repeats();
            continue;
        }
        if (failed.code != Errc::none) co_return of_file(failed, channel, step);
        // The slave answers in order, so it has answered all earlier messages and their repetitions.
        if (reply) end.slowest = again == 0 ? Duration{0} : (again + 1) * (engine.now() - asked);
        if (const unsigned late = channel.late_files(); late > again) transfer.doubt(late - again);
        again = 0;
        if (!reply && !transfer.over()) transfer.finish();
        if (!transfer.is_busy()) {
            busy.answers();
            continue;
        }
        const Time at = busy.again_at(engine.now());
        if (at == kNever) co_return of_file({.code = Errc::timeout}, channel, step);
        co_await engine.sleep_until(at);
    }
    if (transfer.error().code != Errc::none) co_return of_file(transfer.error(), channel, step);
    co_return Nothing{};
}

// The error if a transfer cannot begin; code none: it can.
Error check_room(const MailboxChannel& channel, const FoeRequest& request, Step step) {
    const std::size_t needed = foe::kHeaderBytes + std::max<std::size_t>(request.name.size(), 1);
    if (channel.send_room() <= foe::kHeaderBytes || channel.receive_room() <= foe::kHeaderBytes)
        return of_file({.code = Errc::unsupported}, channel, step);
    if (channel.send_room() >= needed) return {};
    return of_file({.code = Errc::invalid_argument, .detail = static_cast<std::uint32_t>(Argument::file_name)}, channel,
                   step);
}

// Waits for the turn of the transfer, and allocates the memory of its packets.
Task<Result<>> begin_transfer(MailboxChannel& channel, FoeRequest& request, MailSession& session, ArenaBuffer& packet,
                              std::size_t room, Step step) {
    FoeAccess::set_bytes(request, 0);
    FoeAccess::set_text(request, {});
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return of_file(refused, channel, step);
    const Error small = check_room(channel, request, step);
    if (small.code != Errc::none) co_return small;
    if (!packet.reserve(room - foe::kHeaderBytes))
        co_return of_file({.code = Errc::capacity, .detail = Error::kTasks}, channel, step);
    co_return Nothing{};
}

}  // namespace

Task<Result<>> foe_read(MailboxChannel& channel, FoeRead& request, const MailPatience& patience) {
    constexpr Step kStep = Step::foe_read;
    MailSession session(channel, wire::MailboxType::foe, patience.priority, patience.give_up);
    ArenaBuffer packet(channel.arena());
    const std::size_t room = channel.receive_room();
    co_await required(begin_transfer(channel, request, session, packet, room, kStep));
    MemorySink memory(request.data);
    ByteSink& sink = request.sink != nullptr ? *request.sink : memory;
    FoeReadTransfer transfer(request, sink, packet.bytes().first(room - foe::kHeaderBytes));
    auto done = co_await transfer_file(channel, session, transfer, patience, kStep);
    if (done) co_return done;
    Error error = done.error();
    if (error.code == Errc::capacity && error.detail == 0)
        error.actual = static_cast<std::uint32_t>(request.data.size());
    co_return error;
}

Task<Result<>> foe_write(MailboxChannel& channel, FoeWrite& request, const MailPatience& patience) {
    constexpr Step kStep = Step::foe_write;
    MailSession session(channel, wire::MailboxType::foe, patience.priority, patience.give_up);
    ArenaBuffer packet(channel.arena());
    const std::size_t room = channel.send_room();
    co_await required(begin_transfer(channel, request, session, packet, room, kStep));
    MemorySource memory(request.data);
    ByteSource& source = request.source != nullptr ? *request.source : memory;
    FoeWriteTransfer transfer(request, source, packet.bytes().first(room - foe::kHeaderBytes));
    co_return co_await required(transfer_file(channel, session, transfer, patience, kStep));
}

}  // namespace margay
