// The table of mailbox protocols. An entry says what happens to mail that is not a reply.
#pragma once

#include "wire/mailbox.hpp"

namespace margay {

class MailboxChannel;

struct MailProtocol {
    wire::MailboxType type;
    // False: the channel counts the mail as unexpected.
    bool (*unasked)(MailboxChannel& channel, const wire::MailboxMessage& mail);
};

// nullptr when the table has no such protocol.
[[nodiscard]] const MailProtocol* find_protocol(wire::MailboxType type);

}  // namespace margay
