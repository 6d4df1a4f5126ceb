#include "mailbox/late_answers.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr unsigned drive_of(std::uint64_t key) { return static_cast<unsigned>(key % wire::soe::kDrives); }

}  // namespace

// The counters for an exchange of this key. The lower half of a key is the type of an EoE request; its lowest octet is
// the drive of an SoE request (SoeTransfer::key()).
LateAnswers::Places LateAnswers::places(wire::MailboxType type, std::uint64_t key) {
    constexpr std::uint8_t kDrives = wire::soe::kDrives;
    const bool any = key == mail_key::kAny;
    if (type == wire::MailboxType::soe)
        return any ? Places{0, kDrives} : Places{static_cast<std::uint8_t>(drive_of(key)), 1};
    if (type != wire::MailboxType::eoe) return {};
    if (any) return {kDrives, kEoeCalls};
    const unsigned call = call_of(static_cast<std::uint32_t>(key));
    if (call >= kEoeCalls) return {};
    return {static_cast<std::uint8_t>(kDrives + call), 1};
}

void LateAnswers::set(unsigned place, unsigned late) {
    const unsigned shift = place % 2U * 4U;
    const unsigned others = pairs_[place / 2U] & ~(kMost << shift);
    pairs_[place / 2U] = static_cast<std::uint8_t>(others | late << shift);
}

unsigned LateAnswers::count(wire::MailboxType type, std::uint64_t key) const {
    const Places of = places(type, key);
    unsigned most = 0;
    for (unsigned n = 0; n < of.count; ++n) most = std::max(most, at(of.first + n));
    return most;
}

void LateAnswers::add(wire::MailboxType type, std::uint64_t key) {
    const Places of = places(type, key);
    for (unsigned place = of.first; place < of.first + of.count; ++place) set(place, std::min(at(place) + 1U, kMost));
    if (of.count == 0) return;
    Open& open = open_of(type);
    const bool all = key == mail_key::kAny;
    const bool eoe = type == wire::MailboxType::eoe;
    // EoE: a late answer of the type of the question may be mistaken for the answer to the question. Then only one more
    // answer is needed.
    const bool behind = eoe ? all || of.first - wire::soe::kDrives != open.which : all || of.first == open.which;
    if (behind) open.after = static_cast<std::uint8_t>(std::min(open.after + 1U, kMost)) & 0xFU;
}

// ------------------------------------------------------------------ questions

std::optional<LateAnswers::Question> LateAnswers::next_question(wire::MailboxType type, std::uint64_t key) const {
    if (type == wire::MailboxType::soe) {
        const Numbers& numbers = numbers_[drive_of(key)];
        if (numbers.unanswered == kNumbers) return std::nullopt;
        return static_cast<Question>((numbers.last + 1U) % kNumbers);
    }
    constexpr auto kFirst = wire::soe::kDrives;
    const Open& open = open_of(type);
    if (open.needs != 0 && kFirst + open.which != places(type, key).first) return open.which;
    std::optional<Question> best;
    unsigned least = kMost;
    for (const auto read : {wire::eoe::Type::get_ip_request, wire::eoe::Type::get_filter_request}) {
        const unsigned call = call_of(static_cast<unsigned>(read));
        if (kFirst + call == places(type, key).first || at(kFirst + call) >= least) continue;
        least = at(kFirst + call);
        best = static_cast<Question>(call);
    }
    return best;
}

void LateAnswers::ask(wire::MailboxType type, std::uint64_t key, Question question) {
    Open& open = open_of(type);
    open.waits = 1;
    if (type == wire::MailboxType::eoe && open.needs != 0 && open.which == question)
        return add_question(type, question);
    const bool soe = type == wire::MailboxType::soe;
    if (soe && open.needs != 0 && open.which == drive_of(key) && numbers_[open.which].last == question) return;
    open.after = 0;
    open.needs = 1;
    if (soe) {
        open.which = static_cast<std::uint8_t>(drive_of(key)) & 7U;
        Numbers& numbers = numbers_[drive_of(key)];
        numbers.last = question & 7U;
        numbers.unanswered = static_cast<std::uint8_t>(std::min<unsigned>(numbers.unanswered + 1U, kNumbers)) & 0xFU;
        return;
    }
    const unsigned place = wire::soe::kDrives + unsigned{question};
    open.which = question & 7U;
    open.needs = static_cast<std::uint8_t>(std::min(at(place) + 1U, kMost)) & 0xFU;
    add_question(type, question);
}

void LateAnswers::add_question(wire::MailboxType type, Question question) {
    const unsigned place = wire::soe::kDrives + unsigned{question};
    if (type == wire::MailboxType::eoe) set(place, std::min(at(place) + 1U, kMost));
}

void LateAnswers::hear(wire::MailboxType type, std::uint64_t key, Question question) {
    if (type == wire::MailboxType::soe)
        hear_drive(drive_of(key), question);
    else
        hear_call(question);
}

bool LateAnswers::is_open(wire::MailboxType type, std::uint64_t key) const {
    const Open& open = open_of(type);
    return open.waits != 0 && (type == wire::MailboxType::eoe || drive_of(key) == open.which);
}

// The drive has answered all earlier requests, earlier questions included.
void LateAnswers::hear_drive(unsigned drive, unsigned number) {
    Numbers& numbers = numbers_[drive];
    const unsigned behind = (numbers.last + kNumbers - number) % kNumbers;
    if (behind >= numbers.unanswered) return;
    numbers.unanswered = static_cast<std::uint8_t>(behind) & 0xFU;
    Open& open = open_[0];
    open.answered = 1;
    if (behind != 0 || open.needs == 0 || open.which != drive) return;
    open.waits = 0;
    open.needs = 0;
    limit(drive, open.after);
}

// Counts one answer of the type of the question: the answer to the question, or to an earlier request.
void LateAnswers::hear_call(unsigned call) {
    const unsigned place = wire::soe::kDrives + call;
    limit(place, std::max(at(place), 1U) - 1U);
    Open& open = open_[1];
    if (open.needs == 0 || open.which != call) return;
    open.needs = static_cast<std::uint8_t>(open.needs - 1U) & 0xFU;
    open.waits = 0;  // one more answer is needed, so the question must be sent once more
    if (open.needs != 0) return;
    open.answered = 1;
    for (unsigned other = 0; other < kEoeCalls; ++other)
        if (other != call) limit(wire::soe::kDrives + other, open.after);
}

void LateAnswers::end() {
    for (unsigned call = 0; call < kEoeCalls; ++call) set(wire::soe::kDrives + call, 0);
    open_[1].waits = 0;
    open_[1].needs = 0;
}

// The answer to the message that ends a write (soe.cpp) does not count.
void LateAnswers::note(const wire::MailboxMessage& mail) {
    if (mail.header.type == wire::MailboxType::soe) {
        const auto header = wire::soe::load_header(mail.data);
        if (header.idn().number() != 0 || header.idn().of_product())
            limit(header.drive, std::max(at(header.drive), 1U) - 1U);
        else if (header.opcode == wire::soe::Opcode::read_response)
            hear_drive(header.drive, header.number >> 12U & 7U);
    } else if (mail.header.type == wire::MailboxType::eoe) {
        const auto response = static_cast<unsigned>(wire::eoe::load_header(mail.data).type);
        const unsigned call = call_of(response - 1U);
        if (response % 2 != 0 && call < kEoeCalls) hear_call(call);
    }
}

}  // namespace margay
