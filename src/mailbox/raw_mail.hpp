// Messages of any protocol over a mailbox channel, and mail that a sequence waits for without a message of its own.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/mailbox.hpp>

namespace margay {

// The first octets of received mail go to `request.answer`, and its size to `request.bytes`, also if it is larger. The
// request outlives the task.
[[nodiscard]] Task<Result<>> transfer_raw(MailboxChannel& channel, RawMail& request, const MailPatience& patience);
// Without a message: waits for mail that no exchange and no other listener takes.
[[nodiscard]] Task<Result<>> await_raw(MailboxChannel& channel, RawMail& request, const MailPatience& patience);

}  // namespace margay
