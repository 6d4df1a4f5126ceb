// SDO transfers over a mailbox channel: one at a time for each slave, the others wait for their turn.
#pragma once

#include "mailbox/channel.hpp"
#include "mailbox/coe_transfer.hpp"

namespace margay {

// Reads an object into `into`, which outlives the task, and returns its number of octets. When the slave refuses a
// complete access, single accesses replace it; see sdo_upload_singly(). Errors: sdo_abort (detail: the abort code),
// capacity (expected: octets of the value), protocol, mailbox_error, timeout, mailbox_full …
[[nodiscard]] Task<Result<std::size_t>> sdo_upload(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                   const MailPatience& patience);

// Writes `value`, which outlives the task. Single accesses replace a refused complete access.
[[nodiscard]] Task<Result<>> sdo_download(MailboxChannel& channel, SdoObject object, Bytes value,
                                          const MailPatience& patience);

// The same without single accesses as replacement.
[[nodiscard]] Task<Result<std::size_t>> sdo_upload_once(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                        const MailPatience& patience);
[[nodiscard]] Task<Result<>> sdo_download_once(MailboxChannel& channel, SdoObject object, Bytes value,
                                               const MailPatience& patience);

// Executes a transfer of any kind: waits for its turn, exchanges its messages, and aborts it in the slave when it ends
// early. `transfer` outlives the task. Errors as above; stream_failed, wrong_size of a transfer with a source or a
// sink.
[[nodiscard]] Task<Result<>> run_transfer(MailboxChannel& channel, SdoTransfer& transfer, const MailPatience& patience,
                                          Step step);

// Waits until no reply to an earlier request can arrive that would be mistaken for the reply to a request of this key
// (MailboxChannel::is_doubtful()): a slave that is slow, or that keeps messages in a queue, still answers a request
// that was given up. The slave answers in order, so the sequence reads another object. `session` is of CoE. Errors: the
// errors of an exchange, complete with `step` and the index and subindex of the key.
[[nodiscard]] Task<Result<>> settle_owed(MailboxChannel& channel, MailSession& session, std::uint64_t key,
                                         MailPatience patience, Step step);

// Whether the abort may mean that complete access is not possible.
[[nodiscard]] bool may_be_complete_access(const Error& error);
// Whether the abort certainly means this. Then complete access is not tried again with this slave.
[[nodiscard]] bool is_complete_access_refused(const Error& error);

}  // namespace margay
