// Bringing up the segment: from nothing known to every slave in PREOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// The whole of config_init(); returns the number of slaves.
[[nodiscard]] Task<Result<std::uint16_t>> scan(Network& network);

// The parts of it.
[[nodiscard]] Task<Result<std::uint16_t>> count_slaves(Network& network);
// All slaves to INIT, and what a master before has left taken away. The value says whether all were seen in
// INIT.
[[nodiscard]] Task<Result<bool>> reset_slaves(Network& network);

// Configures the mailbox SyncManagers of one slave and brings it to PREOP. Its EEPROM must have been offered to the
// PDI: some slaves refuse without.
[[nodiscard]] Task<Result<>> bring_to_preop(Network& network, Slave& slave);

}  // namespace margay
