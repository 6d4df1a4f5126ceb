// SDO transfers over a mailbox channel: one at a time for each slave, in turn.
#pragma once

#include "mailbox/channel.hpp"
#include "mailbox/coe_transfer.hpp"

namespace margay {

// Reads an object into `into`, which outlives the task, and returns how many octets it has. A complete access that the
// slave refuses is made up of single ones; see sdo_upload_singly(). Errors: sdo_abort (detail: the abort code),
// capacity (expected: octets of the value), protocol, mailbox_error, timeout, mailbox_full …
[[nodiscard]] Task<Result<std::size_t>> sdo_upload(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                   MailPatience patience);

// Writes `value`, which outlives the task.
[[nodiscard]] Task<Result<>> sdo_download(MailboxChannel& channel, SdoObject object, Bytes value,
                                          MailPatience patience);

// The same without fallback.
[[nodiscard]] Task<Result<std::size_t>> sdo_upload_once(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                        MailPatience patience);
[[nodiscard]] Task<Result<>> sdo_download_once(MailboxChannel& channel, SdoObject object, Bytes value,
                                               MailPatience patience);

// An abort that may mean "not by complete access".
[[nodiscard]] bool may_be_complete_access(const Error& error);
// One that surely does: the slave need not be asked again.
[[nodiscard]] bool is_complete_access_refused(const Error& error);

}  // namespace margay
