#include "mailbox/mail_order.hpp"

#include <algorithm>

namespace margay {
namespace {

// Most late answers come so soon. They are waited for before the slave is asked.
constexpr Duration kMostComeWithin = std::chrono::milliseconds(5);
constexpr Duration kGlanceAgain = std::chrono::milliseconds(1);

}  // namespace

Task<Result<>> settle_late_answers(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                   MailClient& question, std::uint64_t question_key, MailPatience patience) {
    Engine& engine = channel.engine();
    const wire::MailboxType type = session.type();
    const Time begun = engine.now();
    patience.give_up = begun + (patience.for_one(begun) - begun) / 2;
    channel.glance();
    const Time soon = std::min(patience.give_up, later(begun, kMostComeWithin));
    while (channel.late_answers(type, key) != 0 && engine.now() < soon) co_await engine.sleep_for(kGlanceAgain);
    Error failed{.code = Errc::reply_lost};
    for (unsigned n = 0; n <= kMostAskedAgain && failed.code == Errc::reply_lost; ++n) {
        if (channel.late_answers(type, key) == 0) break;
        if (question_key != 0) channel.add_late_answer(type, question_key);
        MailExchange exchange(session, question, {.patience = patience});
        failed = co_await exchange;
        if (failed.code != Errc::none) continue;
        channel.forget_late_answers(type, key);
        for (; n != 0 && question_key != 0; --n) channel.add_late_answer(type, question_key);
    }
    co_return Nothing{};
}

}  // namespace margay
