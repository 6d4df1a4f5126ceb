// Answers to requests of EoE parameters and SoE that were given up: how many may still arrive. They do not tell which
// request they answer, and no time ends the doubt. The answer to a question does: a slave answers the requests of EoE,
// and those to each drive of SoE, in their order (mail_order.hpp). A question is remembered also when its own answer
// comes late.
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
    static constexpr unsigned kMost = 15;  // so many or more
    // What tells one question from another. SoE: the parameter set of the IDN, S-0-0000 to S-7-0000, in a read of this
    // drive. EoE: one of the reads, see call_of().
    using Question = std::uint8_t;

    // So many answers that look like those to an exchange of this key may still arrive.
    [[nodiscard]] unsigned count(wire::MailboxType type, std::uint64_t key) const;
    void add(wire::MailboxType type, std::uint64_t key);

    // The question to ask before an exchange of this key. None: each one has too many answers that may be under way.
    [[nodiscard]] std::optional<Question> next_question(wire::MailboxType type, std::uint64_t key) const;
    // The question is sent. It goes on with the last one of the same kind, and replaces any other one.
    void ask(wire::MailboxType type, std::uint64_t key, Question question);
    // The question is sent once more.
    void add_question(wire::MailboxType type, Question question);
    // An answer to it has come to the exchange that waits for it.
    void hear(wire::MailboxType type, std::uint64_t key, Question question);
    // A question that concerns exchanges of this key waits for its answer.
    [[nodiscard]] bool is_open(wire::MailboxType type, std::uint64_t key) const;
    // So many answers of its kind must come.
    [[nodiscard]] unsigned needs(wire::MailboxType type) const { return open_of(type).needs; }
    // Its answer seems lost. When it comes later, it still counts.
    void drop(wire::MailboxType type) { open_of(type).waits = open_of(type).answered = 0; }
    // The slave has answered a question before, in time or late.
    [[nodiscard]] bool trusts(wire::MailboxType type) const { return open_of(type).answered != 0; }

    // EoE: the slave has answered a request that no late answer looked like, so no answer of before can come.
    void end();

    // Mail that nobody has taken, and that can answer a request.
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
        std::uint8_t after : 4 = 0;     // so many requests that were sent behind it were given up
        std::uint8_t needs : 4 = 0;     // so many answers of its kind until one is surely not of before; 0: it has come
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
