// Counts the answers that may still arrive to requests for EoE parameters and SoE requests that were given up. Such an
// answer does not say which request it answers, and no pause is long enough to exclude it. The answer to a question
// excludes it: a slave answers EoE requests in order, and each drive answers SoE requests in order (mail_order.hpp). A
// question is also remembered, because its own answer may come late.
#pragma once

#include "mailbox/exchange.hpp"
#include "wire/eoe.hpp"
#include "wire/soe.hpp"

#include <array>
#include <optional>

namespace margay {

// Each channel has one, so it is small.
class LateAnswers {
  public:
    static constexpr unsigned kMost = 15;  // means 15 or more
    // The number of a question. SoE: the question reads S-0-0000 to S-7-0000 of the drive, and its number is the
    // parameter set of this IDN. EoE: the question is one of the reads, and its number is call_of() of that read.
    using Question = std::uint8_t;

    // How many answers may still arrive that look like an answer to an exchange of this key.
    [[nodiscard]] unsigned count(wire::MailboxType type, std::uint64_t key) const;
    void add(wire::MailboxType type, std::uint64_t key);

    // The question to ask before an exchange of this key. Nothing: too many answers to each question may still arrive.
    [[nodiscard]] std::optional<Question> next_question(wire::MailboxType type, std::uint64_t key) const;
    // Call it when the question is sent. The same question as before counts as a repetition. Otherwise the last
    // question is replaced.
    void ask(wire::MailboxType type, std::uint64_t key, Question question);
    // Call it when the question is sent once more.
    void add_question(wire::MailboxType type, Question question);
    // Call it when the exchange of the question has received an answer.
    void hear(wire::MailboxType type, std::uint64_t key, Question question);
    // Whether a question for exchanges of this key waits for its answer.
    [[nodiscard]] bool is_open(wire::MailboxType type, std::uint64_t key) const;
    // How many answers of the kind of the question must still come; 0: no late answer can follow.
    [[nodiscard]] unsigned needs(wire::MailboxType type) const { return open_of(type).needs; }
    // Call it when the answer to the question seems to be lost. If the answer comes later, it still counts.
    void drop(wire::MailboxType type) { open_of(type).waits = open_of(type).answered = 0; }
    // Whether the slave has answered a question before, in time or late.
    [[nodiscard]] bool trusts(wire::MailboxType type) const { return open_of(type).answered != 0; }

    // EoE: call it when the slave has answered a request whose answer cannot be mistaken for a late answer. So no late
    // answer can come any more.
    void end();

    // Call it for mail that no exchange and no listener has accepted, and that may be the answer to a request.
    void note(const wire::MailboxMessage& mail);

    // The four requests for EoE parameters have the even types of messages from 2 on.
    [[nodiscard]] static constexpr unsigned call_of(unsigned message) { return (message - 2U) / 2U; }
    [[nodiscard]] static constexpr wire::eoe::Type message_of(Question call) {
        return static_cast<wire::eoe::Type>(2U * call + 2U);
    }

  private:
    static constexpr std::uint8_t kEoeCalls = 4;
    static constexpr std::uint8_t kNumbers = 8;  // questions of a drive
    struct Places {
        std::uint8_t first = 0;
        std::uint8_t count = 0;
    };
    // The last question.
    struct Open {
        std::uint8_t which : 3 = 0;  // SoE: the drive; EoE: the question
        std::uint8_t waits : 1 = 0;
        std::uint8_t after : 4 = 0;  // how many requests that were sent after the question were given up
        // How many answers of its type must come, so that the last one is certainly not late.
        std::uint8_t needs : 4 = 0;
        std::uint8_t answered : 1 = 0;  // see trusts()
    };
    struct Numbers {
        std::uint8_t last : 3 = 0;
        std::uint8_t unanswered : 4 = 0;
    };

    [[nodiscard]] static Places places(wire::MailboxType type, std::uint64_t key);
    [[nodiscard]] unsigned at(unsigned place) const { return pairs_[place / 2U] >> place % 2U * 4U & kMost; }
    void set(unsigned place, unsigned late);
    void limit(unsigned place, unsigned most) { set(place, at(place) < most ? at(place) : most); }
    [[nodiscard]] Open& open_of(wire::MailboxType type) { return open_[type == wire::MailboxType::eoe ? 1 : 0]; }
    [[nodiscard]] const Open& open_of(wire::MailboxType type) const {
        return open_[type == wire::MailboxType::eoe ? 1 : 0];
    }
    void hear_drive(unsigned drive, unsigned number);
    void hear_call(unsigned call);

    std::array<std::uint8_t, (wire::soe::kDrives + kEoeCalls) / 2> pairs_{};  // 4 bits for each drive and EoE request
    std::array<Numbers, wire::soe::kDrives> numbers_{};
    std::array<Open, 2> open_{};  // SoE, EoE
};

}  // namespace margay
