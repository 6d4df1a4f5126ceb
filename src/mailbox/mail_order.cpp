#include "mailbox/mail_order.hpp"

#include <algorithm>

namespace margay {
namespace {

// Most late answers come within this time, so the sequence waits for it before it sends a question.
constexpr Duration kMostComeWithin = std::chrono::milliseconds(5);
constexpr Duration kLookAgain = std::chrono::milliseconds(1);

// Sends the question repeatedly until its answer has come.
Task<Result<>> ask_question(MailboxChannel& channel, MailSession& session, std::uint64_t key, MailClient& question,
                            LateAnswers::Question number, MailPatience patience) {
    LateAnswers& late = channel.late_answers();
    const wire::MailboxType type = session.type();
    unsigned lost = 0;
    do {
        late.ask(type, key, number);
        MailExchange exchange(session, question, {.patience = patience});
        const Error failed = co_await exchange;
        if (failed.code == Errc::none) late.hear(type, key, number);
        if (failed.code == Errc::reply_lost) ++lost;
        const bool again = failed.code == Errc::none || failed.code == Errc::reply_lost;
        if (!again || lost > kMostAskedAgain) co_return failed;
    } while (late.needs(type) != 0);
    channel.end_wait(type, key);
    co_return Nothing{};
}

}  // namespace

Task<Result<>> settle_late_answers(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                   MailClient& question, std::optional<LateAnswers::Question> number,
                                   MailPatience patience) {
    constexpr Error kTooLate{.code = Errc::timeout, .step = Step::mailbox_receive};
    Engine& engine = channel.engine();
    LateAnswers& late = channel.late_answers();
    const wire::MailboxType type = session.type();
    const Time begun = engine.now();
    const Time most = patience.for_one(begun);
    const Time half = begun + (most - begun) / 2;
    const bool asked = late.is_open(type, key);
    const unsigned needs = late.needs(type);
    const bool trusted = late.trusts(type);
    const bool doubtful = late.count(type, key) != 0;
    const Time own = trusted && doubtful ? most : half;
    const Time until = asked ? own : std::min(half, later(begun, kMostComeWithin));
    channel.glance();
    while ((late.count(type, key) != 0 || late.is_open(type, key)) && engine.now() < until) {
        if (asked && late.needs(type) != needs && late.needs(type) != 0) break;  // one more is needed
        co_await engine.sleep_until(std::min(until, later(engine.now(), kLookAgain)));
        channel.look_once();
    }
    if (late.is_open(type, key)) {
        late.drop(type);
        if (trusted && late.count(type, key) != 0) co_return kTooLate;
    } else if (late.count(type, key) != 0 && number && engine.now() < most) {
        patience.give_up = late.trusts(type) || engine.now() >= half ? most : half;
        auto answered = co_await ask_question(channel, session, key, question, *number, patience);
        const bool silent = !answered && answered.error().code == Errc::timeout;
        if (silent && late.trusts(type)) co_return kTooLate;
        if (!answered && !silent) late.drop(type);
    }
    const Time now = engine.now();
    const bool settled = late.count(type, key) == 0;
    // The slave is slow. The request ends here, so that the next request finds the slave idle.
    if (settled ? doubtful && now > half && patience.for_one(now) - now < (most - begun) / 2
                : late.count(type, key) == LateAnswers::kMost)
        co_return kTooLate;
    co_return Nothing{};
}

}  // namespace margay
