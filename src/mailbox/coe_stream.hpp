// SDO transfers of values of any size, which come from a source of the application or go to a sink.
#pragma once

#include "mailbox/coe_sdo.hpp"

#include <margay/coe_stream.hpp>

namespace margay {

// A transfer cannot start again after octets have gone to the sink, or come from the source: when a reply is lost for
// good, it ends with Errc::reply_lost. A refused complete access is not replaced by single accesses.
[[nodiscard]] Task<Result<>> sdo_upload_stream(MailboxChannel& channel, SdoUploadStream& request,
                                               const MailPatience& patience);
[[nodiscard]] Task<Result<>> sdo_download_stream(MailboxChannel& channel, SdoDownloadStream& request,
                                                 const MailPatience& patience);

}  // namespace margay
