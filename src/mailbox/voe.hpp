// VoE over a mailbox channel, and the inbox for the messages of slaves.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/voe.hpp>

namespace margay {

// Sends a message. `data` outlives the task. Success: the mailbox of the slave has accepted the message.
[[nodiscard]] Task<Result<>> voe_send(MailboxChannel& channel, VoeHeader header, Bytes data, MailPatience patience);

// The slaves that exchange VoE messages. The function returns the number of the next such slave after `slave`, and
// begins again with the first one; 0: there is none.
struct VoeSlaves {
    std::uint16_t (*next)(const void* user, std::uint16_t slave);
    const void* user;
};

// Takes the next message out of the inbox of `request`, and waits for it until `end`. Meanwhile it looks for mail: of
// the slave of the inbox, or of all `slaves` in turn. The request and the objects to which `slaves` refers outlive the
// task.
[[nodiscard]] Task<Result<>> voe_receive(Mailboxes& mailboxes, VoeReceive& request, Time end, VoeSlaves slaves);

}  // namespace margay
