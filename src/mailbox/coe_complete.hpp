// Complete access composed of single accesses, for slaves that do not support complete access. The octets have the
// layout of a complete access (ETG.1000.6 "Complete access": subindex 0 in 16 bits, then the other values without
// gaps); each value has whole octets.
#pragma once

#include "mailbox/coe_sdo.hpp"

namespace margay {

// Skips subindices that the object does not have.
[[nodiscard]] Task<Result<std::size_t>> sdo_upload_singly(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                          const MailPatience& patience);

// The length of each value is fixed by the standard for PDO assignments and mappings; for other objects the value is
// read first. In PDO assignments and mappings subindex 0 is set to zero first. In all objects subindex 0 is written
// last; it is no error if it is read-only and already has that value.
[[nodiscard]] Task<Result<>> sdo_download_singly(MailboxChannel& channel, SdoObject object, Bytes value,
                                                 const MailPatience& patience);

}  // namespace margay
