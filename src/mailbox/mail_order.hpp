// Requests of EoE and SoE whose answers do not tell which request they answer: how a sequence finds its own answer
// while late ones to earlier requests may come (LateAnswers).
//
// A slave answers the requests of a protocol (SoE: of a drive) in their order. So the sequence first asks a question
// whose answer looks like no late one: when it comes, no late one can follow. It may come late, too: then the next
// sequence knows. A slave that has once answered a question gets no request before it has answered the next one, so
// that a slow slave is not given more than it answers. For a slave that has never answered a question, the sequence
// sends its request once more for each late answer: the last answer then is one to this sequence.
#pragma once

#include "mailbox/channel.hpp"

namespace margay {

// How often a request is sent. `late`: LateAnswers::count(). It is a member of sequences, so it is small.
class OrderedAsks {
  public:
    explicit OrderedAsks(unsigned late) : late_(static_cast<std::uint8_t>(late)) {}
    // After an exchange with this outcome: whether the request must be sent again.
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
    // A message was sent again because its reply seemed lost. The slave may have answered both.
    [[nodiscard]] bool has_repeated() const { return lost_ != 0; }

  private:
    std::uint8_t late_;  // answers that may come, answers to this sequence included
    std::uint8_t own_ = 0;
    std::uint8_t lost_ = 0;
    std::uint8_t answered_ = 0;
};

// Waits until no late answer to an exchange of `key` can come, and asks the question for that: see above. `question`
// composes the one that LateAnswers::next_question() has named, and outlives the task. Success: the request can be sent
// once, and once more for each late answer. Errc::timeout: it cannot be answered in the time that is left.
[[nodiscard]] Task<Result<>> settle_late_answers(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                                 MailClient& question, std::optional<LateAnswers::Question> number,
                                                 MailPatience patience);

}  // namespace margay
