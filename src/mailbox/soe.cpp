#include "mailbox/soe.hpp"

#include "mailbox/mail_order.hpp"

#include <algorithm>
#include <array>

namespace margay {

namespace soe = wire::soe;

namespace {

Error complete(Error error, const MailboxChannel& channel, const SoeTarget& target, Step step) {
    error.slave = channel.station().number;
    error.step = step;
    error.index = target.idn.value;
    error.subindex = target.drive;
    return error;
}

// ETG.1000.6 has no service that ends a write early. Only the last mail of a write contains the IDN, so this message
// completes the write, without an octet of the value, for an IDN that is never written: S-0-0000. A slave without an
// unfinished write refuses this message like any other write to this IDN. Later writes of the drive wait for the
// answer.
void end_writes(MailboxChannel& channel, std::uint8_t drives) {
    for (std::uint8_t drive = 0; drive < soe::kDrives; ++drive) {
        const auto bit = static_cast<std::uint8_t>(1U << drive);
        if ((drives & bit) == 0) continue;
        std::array<std::byte, soe::kHeaderBytes> end{};
        soe::store_header(end, {.opcode = soe::Opcode::write_request, .drive = drive, .elements = soe_element::kValue});
        channel.owe_reply(wire::MailboxType::soe, SoeTransfer::key(soe::Opcode::write_response, drive),
                          channel.engine().now() + mail_timing::kOwedPatience);
        channel.send_final_message(wire::MailboxType::soe, end, bit);
    }
}

// A slave keeps the mails of a write until the last one comes. The destructor ends a write that was given up in
// between, whatever the reason: otherwise the slave would add the next write to it.
class WriteEnd {
  public:
    WriteEnd(MailboxChannel& channel, std::uint8_t drive) : channel_(channel), drive_(drive) {}
    WriteEnd(const WriteEnd&) = delete;
    WriteEnd& operator=(const WriteEnd&) = delete;
    ~WriteEnd() {
        if (unfinished) channel_.end_operations(static_cast<std::uint8_t>(1U << drive_), end_writes);
    }
    bool unfinished = false;  // the slave may have received a mail of the write, and has not answered the write

  private:
    MailboxChannel& channel_;
    std::uint8_t drive_;
};

// Sends all messages except the last one. The slave does not reply to these. The channel has the memory of the
// sequence.
Task<Result<>> send_fragments([[maybe_unused]] MailboxChannel& channel, MailSession& session,
                              SoeWriteTransfer& transfer, const MailPatience& patience) {
    while (!transfer.at_last()) {
        MailExchange fragment(session, transfer, {.patience = patience, .reply = false});
        const Error failed = co_await fragment;
        if (failed.code != Errc::none) co_return failed;
        transfer.advance();
    }
    co_return Nothing{};
}

Task<Result<>> ask([[maybe_unused]] MailboxChannel& channel, MailSession& session, SoeTransfer& transfer,
                   const MailPatience& patience) {
    MailExchange exchange(session, transfer, {.patience = patience, .key = transfer.key(), .in_parts = true});
    const Error failed = co_await exchange;
    co_return failed;
}

// A read whose answer contains the IDN, of an IDN that no request of an application reads: S-0-0000, S-1-0000 …
class DriveQuestion final : public MailClient {
  public:
    DriveQuestion(std::uint8_t drive, unsigned number) : idn_(Idn::standard(0, number)), drive_(drive) {}
    std::size_t compose(MutableBytes data) override {
        if (data.size() < soe::kHeaderBytes) return 0;
        soe::store_header(data, {.opcode = soe::Opcode::read_request,
                                 .drive = drive_,
                                 .elements = soe_element::kDataState,
                                 .number = idn_.value});
        return soe::kHeaderBytes;
    }
    Taken accept(const wire::MailboxMessage& mail) override {
        if (mail.data.size() < soe::kHeaderBytes) return Taken::no;
        const auto header = soe::load_header(mail.data);
        const bool read = header.opcode == soe::Opcode::read_response && !header.incomplete;
        return read && header.drive == drive_ && header.idn() == idn_ ? Taken::all : Taken::no;
    }

  private:
    Idn idn_;
    std::uint8_t drive_;
};

Task<Result<>> settle_drive(MailboxChannel& channel, MailSession& session, const SoeTransfer& transfer,
                            const MailPatience& patience) {
    const auto number = channel.late_answers().next_question(wire::MailboxType::soe, transfer.key());
    DriveQuestion question(transfer.target().drive, number.value_or(0));
    co_return co_await required(settle_late_answers(channel, session, transfer.key(), question, number, patience));
}

unsigned late_of_drive(MailboxChannel& channel, const SoeTransfer& transfer) {
    return channel.late_answers().count(wire::MailboxType::soe, transfer.key());
}

bool is_in_doubt(MailboxChannel& channel, const SoeTransfer& transfer) {
    return late_of_drive(channel, transfer) != 0 ||
           channel.late_answers().is_open(wire::MailboxType::soe, transfer.key());
}

// A command remains set until it is cleared, so the destructor clears it when the sequence ends early.
class CommandGuard {
  public:
    CommandGuard(MailboxChannel& channel, const SoeTarget& target)
        : channel_(channel), target_(target), epoch_(channel.epoch()) {}
    CommandGuard(const CommandGuard&) = delete;
    CommandGuard& operator=(const CommandGuard&) = delete;
    ~CommandGuard() {
        if (!set || channel_.epoch() != epoch_) return;
        std::array<std::byte, soe::kHeaderBytes + 2> cancel{};
        soe::store_header(cancel, {.opcode = soe::Opcode::write_request,
                                   .drive = target_.drive,
                                   .elements = soe_element::kValue,
                                   .number = target_.idn.value});
        const std::uint64_t key = SoeTransfer::key(soe::Opcode::write_response, target_.drive);
        channel_.late_answers().add(wire::MailboxType::soe, key);
        channel_.owe_reply(wire::MailboxType::soe, key, channel_.engine().now() + mail_timing::kOwedPatience);
        channel_.send_final_message(wire::MailboxType::soe, cancel);
    }
    bool set = false;

  private:
    MailboxChannel& channel_;
    SoeTarget target_;
    std::uint32_t epoch_;
};

}  // namespace

Error soe_wrong_size(const MailboxChannel& channel, const SoeTarget& target, std::size_t expected, std::size_t actual) {
    Error error = complete({.code = Errc::wrong_size}, channel, target, Step::soe_read);
    error.expected = static_cast<std::uint32_t>(expected);
    error.actual = static_cast<std::uint32_t>(actual);
    return error;
}

Task<Result<std::size_t>> soe_read(MailboxChannel& channel, SoeTarget target, MutableBytes into,
                                   const MailPatience& patience) {
    constexpr Step kStep = Step::soe_read;
    MailSession session(channel, wire::MailboxType::soe, patience.priority, patience.give_up);
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return complete(refused, channel, target, kStep);
    SoeReadTransfer transfer(target, into);
    const Time begun = channel.engine().now();
    Result<> asked = Nothing{};
    if (is_in_doubt(channel, transfer)) asked = co_await settle_drive(channel, session, transfer, patience);
    if (!asked) co_return complete(asked.error(), channel, target, kStep);
    OrderedAsks asks(late_of_drive(channel, transfer));
    for (bool again = true; again; again = asks.again(asked.error().code, late_of_drive(channel, transfer))) {
        transfer.restart();
        asked = co_await ask(channel, session, transfer, patience);
    }
    if (asks.has_repeated()) channel.owe_second_reply(wire::MailboxType::soe, transfer.key(), begun);
    if (asked) asked = transfer.error();
    if (!asked) co_return complete(asked.error(), channel, target, kStep);
    co_return transfer.bytes();
}

Task<Result<>> soe_write(MailboxChannel& channel, SoeTarget target, Bytes value, const MailPatience& patience) {
    constexpr Step kStep = Step::soe_write;
    MailSession session(channel, wire::MailboxType::soe, patience.priority, patience.give_up);
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return complete(refused, channel, target, kStep);
    if (channel.send_room() <= soe::kHeaderBytes)
        co_return complete({.code = Errc::unsupported}, channel, target, kStep);
    SoeWriteTransfer transfer(target, value, channel.send_room());
    const Time begun = channel.engine().now();
    Result<> asked = Nothing{};
    if (is_in_doubt(channel, transfer)) asked = co_await settle_drive(channel, session, transfer, patience);
    if (!asked) co_return complete(asked.error(), channel, target, kStep);
    WriteEnd end(channel, target.drive);
    OrderedAsks asks(late_of_drive(channel, transfer));
    for (bool again = true; again; again = asks.again(asked.error().code, late_of_drive(channel, transfer))) {
        transfer.restart();
        end.unfinished = end.unfinished || !transfer.at_last();
        auto sent = co_await send_fragments(channel, session, transfer, patience);
        if (!sent) co_return complete(sent.error(), channel, target, kStep);
        asked = co_await ask(channel, session, transfer, patience);
    }
    if (asks.has_repeated()) channel.owe_second_reply(wire::MailboxType::soe, transfer.key(), begun);
    if (transfer.over()) end.unfinished = false;
    if (asked) asked = transfer.error();
    if (!asked) co_return complete(asked.error(), channel, target, kStep);
    co_return Nothing{};
}

Task<Result<>> soe_execute(MailboxChannel& channel, SoeTarget target, const MailPatience& patience) {
    constexpr Duration kLongestPause = std::chrono::milliseconds(32);
    std::array<std::byte, 2> octets{};
    store_le<std::uint16_t>(octets, 0, soe_command::kSet | soe_command::kEnable);
    target.elements = soe_element::kValue;
    const std::uint32_t epoch = channel.epoch();
    CommandGuard guard(channel, target);
    guard.set = true;
    auto set = co_await soe_write(channel, target, octets, patience);
    if (!set) {
        guard.set = set.error().code != Errc::soe_error;  // a refused command is not set
        co_return complete(set.error(), channel, target, Step::soe_command);
    }
    SoeTarget state = target;
    state.elements = soe_element::kDataState;
    std::uint16_t seen = 0;
    for (Duration pause = std::chrono::milliseconds(1);; pause = std::min(2 * pause, kLongestPause)) {
        // The slave has started again and does not execute the command any more.
        if (channel.epoch() != epoch)
            co_return complete({.code = channel.cut_by()}, channel, target, Step::soe_command);
        std::array<std::byte, 2> answer{};
        auto read = co_await soe_read(channel, state, answer, patience);
        if (read && *read != answer.size()) read = soe_wrong_size(channel, state, answer.size(), *read);
        if (!read) co_return complete(read.error(), channel, target, Step::soe_command);
        seen = load_le<std::uint16_t>(answer);
        if ((seen & soe_command::kFailed) != 0) break;
        constexpr unsigned kAll = soe_command::kSet | soe_command::kEnable | soe_command::kRunning;
        if ((seen & kAll) == (soe_command::kSet | soe_command::kEnable)) break;
        if (channel.engine().now() >= patience.give_up)
            co_return complete({.code = Errc::timeout, .detail = seen}, channel, target, Step::soe_command);
        co_await channel.engine().sleep_until(std::min(patience.give_up, channel.engine().now() + pause));
    }
    store_le<std::uint16_t>(octets, 0, 0);
    auto taken_back = co_await soe_write(channel, target, octets, patience);
    guard.set = !taken_back;
    if ((seen & soe_command::kFailed) != 0)
        co_return complete({.code = Errc::command_failed, .detail = seen}, channel, target, Step::soe_command);
    if (!taken_back) co_return complete(taken_back.error(), channel, target, Step::soe_command);
    co_return Nothing{};
}

}  // namespace margay
