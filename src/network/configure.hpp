// From PREOP to SAFEOP: writes the registers that one slave needs to exchange process data.
#pragma once

#include "network/image_layout.hpp"
#include "network/network.hpp"

namespace margay {

// Written to registers to clear them: at most 16 FMMUs.
inline constexpr std::array<std::byte, 256> kClearedRegisters{};

// Writes SyncManagers, FMMUs and watchdogs of a slave that lay_out() has placed, and brings it to SAFEOP, with the
// commands and the hook of its configuration. A slave in SAFEOP or OP is first brought back to PREOP. Used for the
// first start and for a slave that has come back. While a cycle is running (`running`) the FMMUs are activated last,
// when the slave is in SAFEOP: the slave takes part exactly from the reply to that datagram on.
[[nodiscard]] Task<Result<>> configure_process_data(Network& network, Slave& slave, const ImageLayout& layout,
                                                    bool running);

// Clears the slave's FMMUs. After the reply the slave takes part no more.
[[nodiscard]] Task<Result<>> clear_fmmus(Network& network, Slave& slave);

// Clears all SyncManagers of a slave in INIT, and its SYNC activation.
[[nodiscard]] Task<Result<>> clear_sync_managers(Network& network, const Slave& slave);

// Whether the slave has the FMMUs that its place in the image requires.
[[nodiscard]] Task<Result<bool>> has_fmmus(Network& network, Slave& slave, const ImageLayout& layout);

}  // namespace margay
