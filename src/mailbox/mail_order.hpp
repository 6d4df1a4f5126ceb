// Requests of EoE and SoE, whose answers do not identify the request: how a sequence finds its own answer while late
// answers to earlier requests may come (LateAnswers). A slave answers the requests of a protocol (SoE: of a drive) in
// their order. So the sequence first sends a question whose answer cannot be mistaken for a late answer: after this
// answer, no late answer can follow. If the answer to the question comes late, the next sequence uses it. If a slave
// has answered a question once, it gets no request before it has answered the next question, so that a slow slave does
// not get more requests than it answers. For a slave that has never answered a question, the sequence sends its request
// once more for each late answer: the last answer then belongs to this sequence.
#pragma once

#include "mailbox/channel.hpp"

namespace margay {

// How often a request is sent. `late`: LateAnswers::count(). It is a member of sequences, so it is small.
class OrderedAsks {
  public:
    explicit OrderedAsks(unsigned late) : late_(static_cast<std::uint8_t>(late)) {}
    // Call it after an exchange with this outcome. Returns whether the request must be sent again.
    [[nodiscard]] bool again(Errc outcome, unsigned late) {
        const unsigned added = late > late_ ? late - late_ : 0U;  // the own message that was lost, or a broken answer
        late_ = static_cast<std::uint8_t>(late);
        if (outcome == Errc::reply_lost) {
            own_ = static_cast<std::uint8_t>(own_ + added);
            return ++lost_ <= kMostAskedAgain;
        }
        const bool whole = outcome == Errc::none && added == 0;
        return whole && ++answered_ + own_ <= late_;
    }
    // Whether a message was sent again because its reply seemed to be lost. The slave may have answered both messages.
    [[nodiscard]] bool has_repeated() const { return lost_ != 0; }

  private:
    std::uint8_t late_;  // answers that may come, answers to this sequence included
    std::uint8_t own_ = 0;
    std::uint8_t lost_ = 0;
    std::uint8_t answered_ = 0;
};

// Waits until no late answer to an exchange of `key` can come, and sends the question for this purpose: see above.
// `question` composes the one that LateAnswers::next_question() has named, and outlives the task. Success: the request
// can be sent once, and once more for each late answer. Errc::timeout: the remaining time is too short for an answer.
[[nodiscard]] Task<Result<>> settle_late_answers(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                                 MailClient& question, std::optional<LateAnswers::Question> number,
                                                 MailPatience patience);

}  // namespace margay
