#include "mailbox/protocols.hpp"

#include "mailbox/coe_mail.hpp"
#include "mailbox/mailboxes.hpp"
#include "mailbox/soe_pdo.hpp"

namespace margay {

bool take_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail) {
    const SoeFeature* soe = channel.mailboxes().soe;
    switch (mail.header.type) {
        case wire::MailboxType::coe: return coe_unasked(channel, mail);
        case wire::MailboxType::soe: return soe != nullptr && soe->unasked(channel, mail);
        default: return false;
    }
}

}  // namespace margay
