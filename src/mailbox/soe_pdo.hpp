// Reads the process data of a slave from the parameters of its drives (IEC 61800-7-204: telegram type S-0-0015,
// configuration lists of AT S-0-0016 and MDT S-0-0024, attributes of the listed parameters).
#pragma once

#include "mailbox/found_sms.hpp"
#include "mailbox/soe.hpp"
#include "util/check_value.hpp"

namespace margay {

// The functions of SoE that a context itself uses.
struct SoeFeature {
    Task<Result<bool>> (*find_sms)(MailboxChannel& channel, const Slave& slave, FoundSms& found, CheckValue& content);
};

// Outputs are the MDT, inputs the AT. Each contains the data of all drives in sequence; for each drive the control word
// or the status word is first. The drives are the numbers 0 to 7 that answer. False, and nothing found, when the slave
// has no SoE or no drive answers: this is not a failure, the SII may contain the process data. Errors: anything but the
// refusal of a drive that does not exist; error().index is the IDN. `content`: the drives, and the parameters in their
// order with their lengths, are added.
[[nodiscard]] Task<Result<bool>> find_sms_by_soe(MailboxChannel& channel, const Slave& slave, FoundSms& found,
                                                 CheckValue& content);

}  // namespace margay
