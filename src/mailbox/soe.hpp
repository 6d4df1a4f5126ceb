// Parameters of a drive over a mailbox channel: one request at a time for each slave, the others wait for their turn.
#pragma once

#include "mailbox/channel.hpp"
#include "mailbox/soe_transfer.hpp"

namespace margay {

// Reads the elements of a parameter into `into`, which outlives the task, and returns their number of octets. Errors:
// soe_error (detail: the SoE error code), capacity (expected: octets of the elements), protocol, mailbox_error,
// timeout, mailbox_full …
[[nodiscard]] Task<Result<std::size_t>> soe_read(MailboxChannel& channel, SoeTarget target, MutableBytes into,
                                                 const MailPatience& patience);

// The error of a drive that answers with another number of octets than the element has.
[[nodiscard]] Error soe_wrong_size(const MailboxChannel& channel, const SoeTarget& target, std::size_t expected,
                                   std::size_t actual);

// Writes `value`, which outlives the task.
[[nodiscard]] Task<Result<>> soe_write(MailboxChannel& channel, SoeTarget target, Bytes value,
                                       const MailPatience& patience);

// Executes a procedure command: sets it, waits until its data state reports the end, and clears it. A command that is
// given up is cleared too, whatever the reason. Errors: the errors of reading and writing, command_failed (detail: the
// data state). Between its reads other requests to the slave have their turn.
[[nodiscard]] Task<Result<>> soe_execute(MailboxChannel& channel, SoeTarget target, const MailPatience& patience);

}  // namespace margay
