// CoE mail that is not a reply: emergencies, and PDOs by mailbox.
#pragma once

#include "wire/mailbox.hpp"

namespace margay {

class MailboxChannel;

[[nodiscard]] bool coe_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail);

}  // namespace margay
