// Late replies: which replies to abandoned exchanges may still arrive, and which exchanges wait for these replies. This
// file also has the messages that end operations early.
//
// A slave answers the messages of a protocol in their order. So a reply cannot arrive any more when the slave has
// answered a later request (CoE: settle_owed() sends such a request), or when a slave that works on one message at a
// time has taken a later message. For slaves that keep messages in a queue, and for protocols without such a request,
// the channel waits for a time.
#include "mailbox/channel.hpp"
#include "mailbox/mailboxes.hpp"
#include "wire/coe.hpp"
#include "wire/eoe.hpp"
#include "wire/foe.hpp"
#include "wire/soe.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay {

// ------------------------------------------------------------------ what is owed

std::size_t MailboxChannel::owed_place(wire::MailboxType type) {
    return type == wire::MailboxType::coe ? 0 : type == wire::MailboxType::foe ? 1 : 2;
}

MailboxChannel::Owed& MailboxChannel::owe(wire::MailboxType type, std::uint64_t key, std::uint8_t mails, Time until) {
    Owed& owed = owed_of(type);
    left_open_ = true;
    if (key == 0) return owed;
    if (!is_current(owed, now()) && !(owed.mails != 0 && owed.lasts))
        owed = {.key = key,
                .until = until,
                .type = type,
                .fences = owed.fences,
                .questions = owed.questions,
                .spare = owed.spare};
    if (type == wire::MailboxType::coe) owed.questions |= question_bit(key);
    if (owed.key != key) owed.key = mail_key::kAny;
    if (owed.type != type) owed.type = wire::MailboxType::error;
    owed.guessed = false;
    owed.until = std::max(owed.until, until);
    owed.mails = static_cast<std::uint8_t>(std::min<unsigned>(owed.mails + mails, MailExchange::kManyMails));
    return owed;
}

void MailboxChannel::owe_reply(wire::MailboxType type, std::uint64_t key, Time until) {
    (void)owe(type, key, 1, until);
    late_until_ = std::max(late_until_, until);
    look_soon();
    ensure_pump();
    kick();
}

void MailboxChannel::owe_files(unsigned files, Time until) {
    owe_reply(wire::MailboxType::foe, mail_key::of(mail_key::Kind::foe), until);
    Owed& owed = owed_of(wire::MailboxType::foe);
    owed.lasts = true;
    owed.files = static_cast<std::uint8_t>(std::clamp<unsigned>(files, owed.files, UINT8_MAX - 1U));
    owed.mails = std::max(owed.mails, owed.files);
}

// The channel waits for the reply as long as the exchange itself would have waited, unless the next exchanges can
// distinguish the late reply from their own replies.
void MailboxChannel::owe_answer_to(const MailExchange& exchange) {
    const auto& options = exchange.options_;
    if (!options.reply) {
        unanswered_until_ = now() + mail_timing::kOwedPatience;
        return;
    }
    late_until_ = now() + mail_timing::kOwedPatience;
    const Time most = options.distinct ? late_until_ : std::max(late_until_, exchange.wanted_until_);
    Owed& owed = owe(exchange.type_, options.key, options.mails, most);
    make_last(owed, exchange);
}

void MailboxChannel::make_last(Owed& owed, const MailExchange& exchange) {
    if (exchange.options_.key != 0) late_.add(exchange.type_, exchange.options_.key);
    if (!is_in_order(exchange)) return;
    owed.lasts = true;
    if (exchange.type_ == wire::MailboxType::foe && owed.files != UINT8_MAX) ++owed.files;
}

// Notes that an exchange has ended by mail that may not be its reply.
void MailboxChannel::owe_in_doubt(const MailExchange& exchange) {
    Owed& owed = owed_of(exchange.type_);
    const bool alone = !is_current(owed, now()) || owed.guessed;
    owe_reply(exchange.type_, exchange.options_.key, now() + mail_timing::kOwedPatience);
    owed.guessed = alone;
    make_last(owed, exchange);
}

bool MailboxChannel::must_wait(const MailExchange& exchange) const {
    const std::uint64_t key = exchange.options_.key;
    const Owed& owed = owed_[owed_place(exchange.type_)];
    if (key == 0 || !is_current(owed, now())) return false;
    if (owed.type != wire::MailboxType::error && owed.type != exchange.type_) return false;
    return owed.key == key || owed.key == mail_key::kAny || key == mail_key::kAny;
}

bool MailboxChannel::is_owed() const {
    const Time t = now();
    return std::ranges::any_of(owed_, [&](const Owed& owed) { return is_current(owed, t); });
}

bool MailboxChannel::is_doubtful(std::uint64_t key) const {
    const Owed& owed = owed_[0];
    const bool alike = owed.key == key || owed.key == mail_key::kAny || key == mail_key::kAny;
    const unsigned like = key == mail_key::kAny ? UINT8_MAX : question_bit(key);
    const bool asked = (owed.questions & like) != 0;
    return key != 0 && ((owed.mails != 0 && owed.lasts && alike) || asked);
}

// ------------------------------------------------------------------ questions

namespace {

// Objects that a device answers at once, perhaps by an abort.
constexpr std::array kQuestions{
    mail_key::of(mail_key::Kind::sdo, 0x1000, 0), mail_key::of(mail_key::Kind::sdo, 0x1018, 1),
    mail_key::of(mail_key::Kind::sdo, 0x1018, 2), mail_key::of(mail_key::Kind::sdo, 0x1018, 3),
    mail_key::of(mail_key::Kind::sdo, 0x1018, 4), mail_key::of(mail_key::Kind::sdo, 0x1018, 0),
    mail_key::of(mail_key::Kind::sdo, 0x1001, 0), mail_key::of(mail_key::Kind::sdo, 0x1000, 1)};

}  // namespace

std::uint8_t MailboxChannel::question_bit(std::uint64_t key) {
    const auto at = std::ranges::find(kQuestions, key);
    return at == kQuestions.end() ? std::uint8_t{0} : static_cast<std::uint8_t>(1U << (at - kQuestions.begin()));
}

std::uint64_t MailboxChannel::next_question() {
    const auto free = [&](std::uint64_t key) { return (owed_[0].questions & question_bit(key)) == 0; };
    const auto at = std::ranges::find_if(kQuestions, free);
    if (at != kQuestions.end()) return *at;
    // No question was answered: the slave may have dropped all of them. A spare question asks for a subindex that does
    // not exist. The slave answers by an abort, which names the object.
    owed_[0].spare = owed_[0].spare == UINT8_MAX ? std::uint8_t{2} : static_cast<std::uint8_t>(owed_[0].spare + 1);
    return mail_key::of(mail_key::Kind::sdo, 0x1000, owed_[0].spare);
}

void MailboxChannel::note_question(std::uint64_t key) { owed_[0].questions |= question_bit(key); }

// ------------------------------------------------------------------ what ends it

// SDO replies name their object. Mail that slaves send on their own is no reply.
bool MailboxChannel::can_answer(std::uint64_t key, const wire::MailboxMessage& mail) {
    namespace coe = wire::coe;
    const Bytes data = mail.data;
    switch (mail.header.type) {
        case wire::MailboxType::coe: {
            if (data.size() < coe::kHeaderBytes) return false;
            const auto service = coe::load_header(data).service;
            if (key == mail_key::kAny) return service != coe::Service::emergency && service != coe::Service::tx_pdo;
            if (data.size() < coe::kSdoBytes) return false;
            const auto specifier = coe::sdo::specifier(coe::SdoLayout::command::load(data));
            const bool aborts = specifier == coe::kAbortSpecifier;
            const bool initiates = specifier == coe::response::kUpload || specifier == coe::response::kDownload;
            const bool replies = service == coe::Service::sdo_response && (aborts || initiates);
            return (replies || (service == coe::Service::sdo_request && aborts)) &&
                   key == mail_key::of(mail_key::Kind::sdo, coe::SdoLayout::index::load(data),
                                       coe::SdoLayout::subindex::load(data));
        }
        case wire::MailboxType::eoe: {
            if (data.size() < wire::eoe::kHeaderBytes) return false;
            const auto type = wire::eoe::load_header(data).type;
            return type != wire::eoe::Type::fragment && type != wire::eoe::Type::time_stamp_response;
        }
        case wire::MailboxType::soe: {
            if (data.size() < wire::soe::kHeaderBytes) return false;
            const auto header = wire::soe::load_header(data);
            if (header.incomplete) return false;  // the answer has several mails, and this mail is not the last one
            const auto opcode = header.opcode;
            return opcode == wire::soe::Opcode::read_response || opcode == wire::soe::Opcode::write_response;
        }
        case wire::MailboxType::foe: {
            // A late packet from the middle of a transfer is not one of the replies that Owed::mails counts.
            namespace foe = wire::foe;
            if (data.size() < foe::kHeaderBytes) return false;
            const auto opcode = foe::Layout::opcode::load(data);
            const auto number = foe::Layout::packet_number::load(data);
            return (opcode != foe::Opcode::data && opcode != foe::Opcode::acknowledge) || number <= 1;
        }
        default: return true;
    }
}

namespace {

// An answer for a subindex of 0x1000 that next_question() has taken from Owed::spare.
bool is_spare_question(const wire::MailboxMessage& mail) {
    namespace coe = wire::coe;
    return mail.data.size() >= coe::kSdoBytes && coe::SdoLayout::index::load(mail.data) == 0x1000 &&
           coe::SdoLayout::subindex::load(mail.data) > 1;
}

// Whether the mail is the answer to the message that ends a write (soe.cpp). The mail has been checked by can_answer().
bool is_answer_to_end(const wire::MailboxMessage& mail) {
    namespace soe = wire::soe;
    if (mail.header.type != wire::MailboxType::soe) return false;
    const auto header = soe::load_header(mail.data);
    return header.opcode == soe::Opcode::write_response && header.number == 0;
}

bool is_first_packet(const wire::MailboxMessage& mail) {
    namespace foe = wire::foe;
    return mail.header.type == wire::MailboxType::foe && mail.data.size() >= foe::kHeaderBytes &&
           foe::Layout::opcode::load(mail.data) == foe::Opcode::data &&
           foe::Layout::packet_number::load(mail.data) == 1;
}

}  // namespace

// Notes mail that no exchange and no listener has accepted. Mail with the protocol of an owed reply most likely is this
// reply.
void MailboxChannel::note_late(const wire::MailboxMessage& mail) {
    if (can_answer(mail_key::kAny, mail)) late_.note(mail);
    Owed& owed = owed_of(mail.header.type);
    if (mail.header.type == wire::MailboxType::coe) {
        bool of_question = is_spare_question(mail);
        for (const std::uint64_t key : kQuestions)
            if (can_answer(key, mail)) {
                of_question |= (owed.questions & question_bit(key)) != 0;
                owed.questions &= static_cast<std::uint8_t>(~question_bit(key));
            }
        // An answer to a question is not one of the replies that Owed::mails counts.
        if (of_question && owed.key == mail_key::kAny) return;
    }
    if (owed.mails == 0 || owed.mails == MailExchange::kManyMails || owed.type != mail.header.type) return;
    if (!can_answer(owed.key, mail)) return;
    // The slave has answered all messages that came before the end of the write.
    owed.mails = is_answer_to_end(mail) ? std::uint8_t{0} : static_cast<std::uint8_t>(owed.mails - 1);
    if (owed.files != 0 && is_first_packet(mail)) --owed.files;
    if (!is_owed()) late_until_ = Time::min();
}

// The exchanges of a session follow each other, so this exchange was sent after the abandoned exchanges. But the slave
// may have sent a TxPDO on its own, the first reply to a file may be the late reply, and a late reply may have ended
// a question (key 0).
void MailboxChannel::note_answered(const MailExchange& exchange) {
    if (exchange.session_ == nullptr || exchange.options_.key == 0) return;
    const bool coe = exchange.type_ == wire::MailboxType::coe;
    const bool foe = exchange.type_ == wire::MailboxType::foe;
    const bool pdo = mail_key::kind_of(exchange.options_.key) == mail_key::Kind::tx_pdo;
    if (!(coe && !pdo) && !(foe && exchange.options_.distinct)) return;
    if (Owed& owed = owed_of(exchange.type_); owed.lasts) owed.mails = owed.questions = owed.files = 0;
}

// ------------------------------------------------------------------ messages that end operations

namespace {

class FinalClient final : public MailClient {
  public:
    explicit FinalClient(Bytes message) : message_(message) {}
    std::size_t compose(MutableBytes data) override {
        if (data.size() < message_.size()) return 0;
        std::ranges::copy(message_, data.begin());
        return message_.size();
    }
    Taken accept(const wire::MailboxMessage&) override { return Taken::no; }

  private:
    Bytes message_;
};

}  // namespace

// Holds the exchanges that wait for a late reply.
class MailboxChannel::Fence {
  public:
    Fence(MailboxChannel& channel, wire::MailboxType type)
        : channel_(channel), place_(owed_place(type)), epoch_(channel.epoch_) {
        ++owed().fences;
    }
    Fence(const Fence&) = delete;
    Fence& operator=(const Fence&) = delete;
    ~Fence() {
        if (channel_.epoch_ != epoch_) return;
        --owed().fences;
        channel_.kick();
    }
    // Whether the fence still holds exchanges: the mailbox was not closed since.
    [[nodiscard]] bool stands() const { return channel_.epoch_ == epoch_ && owed().mails != 0; }
    [[nodiscard]] Owed& owed() const { return channel_.owed_[place_]; }

  private:
    MailboxChannel& channel_;
    std::size_t place_;
    std::uint32_t epoch_;
};

// A slave that processes one message at a time accepts this message only after it has answered the earlier message.
// Until then, the reply to the exchange that was given up may come, after any time.
Task<Result<>> MailboxChannel::deliver(FinalMessage message) {
    constexpr std::uint16_t kStatusOfSm0 =
        wire::reg::sync_manager(0).address + static_cast<std::uint16_t>(wire::SyncManagerLayout::status::offset);
    const Fence fence(*this, message.type);
    FinalClient client(Bytes(message.octets).first(message.bytes));
    const Duration patience = fence.stands() ? mail_timing::kFencePatience : mail_timing::kFinalPatience;
    const Time most = later(now(), patience);
    MailExchange exchange(*this, message.type, client,
                          {.patience = {.give_up = most, .each = patience}, .reply = false});
    constexpr MailPriority kBeforeAll = 3;
    exchange.priority = kBeforeAll;
    const Error failed = co_await exchange;
    for (bool full = true; full && failed.code == Errc::none && fence.stands() && now() < most;) {
        std::array<std::byte, 1> status{};
        Datagram look(engine_->link(), wire::Command::FPRD, {address_, kStatusOfSm0}, MutableBytes(status));
        auto reply = co_await look;
        full = !reply.ok() || reply.wkc != 1 ||
               (std::to_integer<unsigned>(status[0]) & wire::sm_status::kMailboxFull) != 0;
        if (full) co_await engine_->sleep_for(mail_timing::kLongestPause);
    }
    if (fence.stands()) fence.owed().until = std::max(fence.owed().until, now() + mail_timing::kOwedPatience);
    if (failed.code == Errc::none) unfinished_ &= static_cast<std::uint8_t>(~message.ends);
    if (failed.code != Errc::none && failed.code != cut_by_) co_return failed;
    co_return Nothing{};
}

void MailboxChannel::send_final_message(wire::MailboxType type, Bytes data, std::uint8_t ends) {
    FinalMessage message{.type = type, .bytes = static_cast<std::uint8_t>(data.size()), .ends = ends};
    if (!is_reachable() || data.size() > message.octets.size()) return;
    std::ranges::copy(data, message.octets.begin());
    const TaskReference task = deliver(message);
    if (task) (void)mailboxes_->tasks_.start(task);
}

void MailboxChannel::end_operations(std::uint8_t which, EndOperations how) {
    unfinished_ |= which;
    end_unfinished_ = how;
    if (is_reachable()) how(*this, which);
}

}  // namespace margay
