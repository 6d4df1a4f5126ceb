// Parameters of a drive over a mailbox channel: one request at a time for each slave, in turn.
#pragma once

#include "mailbox/channel.hpp"
#include "mailbox/soe_transfer.hpp"

namespace margay {

// Reads the elements of a parameter into `into`, which outlives the task, and returns how many octets they have.
// Errors: soe_error (detail: its code), capacity (expected: octets there are), protocol, mailbox_error, timeout,
// mailbox_full …
[[nodiscard]] Task<Result<std::size_t>> soe_read(MailboxChannel& channel, SoeTarget target, MutableBytes into,
                                                 MailPatience patience);

// Writes `value`, which outlives the task.
[[nodiscard]] Task<Result<>> soe_write(MailboxChannel& channel, SoeTarget target, Bytes value, MailPatience patience);

// Executes a procedure command: sets it, waits until its data state says that it is done, and takes it back. One that
// is given up, for whatever reason, is taken back too. Errors: those of reading and writing, command_failed (detail:
// the data state). Other requests to the slave have their turns meanwhile.
[[nodiscard]] Task<Result<>> soe_execute(MailboxChannel& channel, SoeTarget target, MailPatience patience);

// Mail of type SoE that no request waits for: notifications and emergencies go to the slave's hook.
[[nodiscard]] bool soe_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail);

}  // namespace margay
