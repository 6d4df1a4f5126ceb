// Mail that is not a reply, by protocol.
#pragma once

#include "wire/mailbox.hpp"

namespace margay {

class MailboxChannel;

// False: no protocol takes the mail, and the channel counts it as unexpected.
[[nodiscard]] bool take_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail);

}  // namespace margay
