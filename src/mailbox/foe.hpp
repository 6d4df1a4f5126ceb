// File transfers over a mailbox channel: one at a time for each slave, the others wait for their turn.
#pragma once

#include "mailbox/channel.hpp"
#include "mailbox/foe_transfer.hpp"

namespace margay {

// Transfer a file; request.bytes() has the number of octets that were transferred. A transfer that ends early, whatever
// the reason, is ended in the slave by an error message. Errors: foe_error (detail: the FoE error code), capacity,
// stream_failed, protocol, mailbox_error, timeout, mailbox_full …
[[nodiscard]] Task<Result<>> foe_read(MailboxChannel& channel, FoeRead& request, const MailPatience& patience);
[[nodiscard]] Task<Result<>> foe_write(MailboxChannel& channel, FoeWrite& request, const MailPatience& patience);

}  // namespace margay
