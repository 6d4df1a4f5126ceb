// The protocols of a mailbox: one line each. A line says what happens to mail that answers no request.
#pragma once

#include "wire/mailbox.hpp"

namespace margay {

class MailboxChannel;

struct MailProtocol {
    wire::MailboxType type;
    // False: of no kind that is kept.
    bool (*unasked)(MailboxChannel& channel, const wire::MailboxMessage& mail);
};

// nullptr when there is no such line.
[[nodiscard]] const MailProtocol* find_protocol(wire::MailboxType type);

}  // namespace margay
