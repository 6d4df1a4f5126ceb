// What process data a slave has by the parameters of its drives (IEC 61800-7-204: telegram type S-0-0015, configuration
// lists of AT S-0-0016 and MDT S-0-0024, attributes of what they list).
#pragma once

#include "mailbox/found_sms.hpp"
#include "mailbox/soe.hpp"

namespace margay {

// What is found: outputs are the MDT, inputs the AT, each with the data of all drives one behind the other, and
// for each drive the control word or status word first. The drives are those of number 0 to 7 that answer. False, and
// nothing found, when the slave has no SoE or no drive answers: no failure, the SII may know. Errors: anything but the
// refusal of a drive that is not there; error().index is the IDN.
[[nodiscard]] Task<Result<bool>> find_sms_by_soe(MailboxChannel& channel, const Slave& slave, FoundSms& found);

}  // namespace margay
