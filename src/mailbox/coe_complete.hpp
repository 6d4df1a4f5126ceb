// Complete access made up of single accesses, for slaves that do not have it: the octets are laid out as a complete
// access would lay them (ETG.1000.6 "Complete access": subindex 0 in 16 bits, the others one behind the other), each
// value taking whole octets.
#pragma once

#include "mailbox/coe_sdo.hpp"

namespace margay {

// Subindices that the object leaves out are passed over.
[[nodiscard]] Task<Result<std::size_t>> sdo_upload_singly(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                                          MailPatience patience);

// How long each value is follows from the kind of object (PDO assignment and mapping), and else from reading it first.
// Of PDO assignments and mappings subindex 0 is set to zero first; with all objects it is written last, unless it is
// read-only and has that value.
[[nodiscard]] Task<Result<>> sdo_download_singly(MailboxChannel& channel, SdoObject object, Bytes value,
                                                 MailPatience patience);

}  // namespace margay
