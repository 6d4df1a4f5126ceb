// From PREOP to SAFEOP: what one slave needs to exchange process data goes into its registers.
#pragma once

#include "network/image_layout.hpp"
#include "network/network.hpp"

namespace margay {

// Writes SyncManagers, FMMUs and watchdogs of a slave that lay_out() has placed, and brings it to SAFEOP, with what its
// configuration wants around that; from SAFEOP or OP it goes back to PREOP first. The same for the first time and for a
// slave that has come back. Beside a running cycle the FMMUs become active last, when the slave is in SAFEOP: with the
// reply to that one datagram it takes part, neither earlier nor later.
[[nodiscard]] Task<Result<>> configure_process_data(Network& network, Slave& slave, const ImageLayout& layout,
                                                    bool running);

// Takes the slave's FMMUs away: with the reply it takes part no more.
[[nodiscard]] Task<Result<>> clear_fmmus(Network& network, Slave& slave);

// Whether the FMMUs of the slave are those that its place in the image asks for.
[[nodiscard]] Task<Result<bool>> has_fmmus(Network& network, Slave& slave, const ImageLayout& layout);

}  // namespace margay
