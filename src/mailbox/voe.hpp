// VoE over a mailbox channel, and the inbox for the messages of slaves.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/voe.hpp>

namespace margay {

// Sends a message. `data` outlives the task. Success: the mailbox of the slave has taken the message.
[[nodiscard]] Task<Result<>> voe_send(MailboxChannel& channel, VoeHeader header, Bytes data, MailPatience patience);

// Takes the next message out of the inbox of `request`, and waits for it until `end`. The request outlives the task.
[[nodiscard]] Task<Result<>> voe_receive(Mailboxes& mailboxes, VoeReceive& request, Time end);

}  // namespace margay
