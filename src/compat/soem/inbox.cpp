#include "compat/soem/inbox.hpp"

#include <algorithm>

namespace margay::soem {

Inbox::Inbox(Context& context) {
    for (const MailboxType type : {MailboxType::error, MailboxType::aoe, MailboxType::eoe, MailboxType::coe,
                                   MailboxType::foe, MailboxType::soe, MailboxType::voe})
        static_cast<void>(listen(context, ears_.emplace_back(*this, type)));
}

bool Inbox::Ear::take(const UnaskedMail& mail) {
    auto& letters = inbox_.letters_;
    if (letters.size() >= kMost) letters.pop_front();
    letters.push_back({mail.slave, mail.type, {mail.data.begin(), mail.data.end()}});
    return true;
}

std::optional<Letter> Inbox::take(std::uint16_t slave, std::optional<MailboxType> type) {
    const auto found = std::ranges::find_if(letters_, [&](const Letter& letter) {
        return letter.slave == slave && (type ? letter.type == *type : letter.type != MailboxType::error);
    });
    if (found == letters_.end()) return std::nullopt;
    Letter letter = std::move(*found);
    letters_.erase(found);
    return letter;
}

std::optional<Letter> Inbox::take_any(MailboxType type) {
    const auto found = std::ranges::find(letters_, type, &Letter::type);
    if (found == letters_.end()) return std::nullopt;
    Letter letter = std::move(*found);
    letters_.erase(found);
    return letter;
}

}  // namespace margay::soem
