// Names of entries of process data.
#pragma once

#include "network/network.hpp"

#include <span>

namespace margay {

// Writes the name of an entry into `into`, which outlives the task, and returns its octets: of the object dictionary
// where the slave has SDO information and a name there, else of the PDOs of its SII; 0 when nobody has one. Errors:
// those of asking; that the dictionary does not have the object is none.
[[nodiscard]] Task<Result<std::size_t>> find_entry_name(Network& network, Slave& slave, std::uint16_t index,
                                                        std::uint8_t subindex, std::span<char> into,
                                                        MailPatience patience);

}  // namespace margay
