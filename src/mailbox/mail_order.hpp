// Requests of EoE and SoE whose answers do not tell which request they answer: how a sequence finds its own answer
// while late ones to earlier requests may come (MailboxChannel::late_answers()).
//
// A slave answers the requests of a protocol (SoE: of a drive) in their order. So the sequence first asks a question
// whose answer looks like no late one: when it comes, no late one can follow. For a slave without an answer to the
// question, the sequence sends its request once more for each late answer: the last answer then is one to this
// sequence.
#pragma once

#include "mailbox/channel.hpp"

namespace margay {

// How often a request is sent. `late`: MailboxChannel::late_answers(). It is a member of sequences, so it is small.
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
    std::uint8_t late_;  // answers that may come, those to this sequence included
    std::uint8_t own_ = 0;
    std::uint8_t lost_ = 0;
    std::uint8_t answered_ = 0;
};

// Asks the question, of the protocol of the session, if late answers to an exchange of `key` may come, and waits for
// its answer for half of the time that the sequence has: the slave may never answer it. `question_key`: the key of its
// own late answer; 0: the answer cannot be taken for another one. `question` outlives the task.
[[nodiscard]] Task<Result<>> settle_late_answers(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                                 MailClient& question, std::uint64_t question_key,
                                                 MailPatience patience);

}  // namespace margay
