// CoE mail that answers no request: emergencies, and PDOs that travel by mailbox.
#pragma once

#include "wire/mailbox.hpp"

namespace margay {

class MailboxChannel;

[[nodiscard]] bool coe_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail);

}  // namespace margay
