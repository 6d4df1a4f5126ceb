// Names of entries of process data.
#pragma once

#include "network/network.hpp"

#include <span>

namespace margay {

// Writes the name of an entry to `into`, which outlives the task, and returns its octets. The name is from the object
// dictionary if the slave has SDO information and a name there, otherwise from the PDOs of its SII; 0 when there is no
// name. Errors: the errors of reading; it is no error that the dictionary does not have the object.
[[nodiscard]] Task<Result<std::size_t>> find_entry_name(Network& network, Slave& slave, std::uint16_t index,
                                                        std::uint8_t subindex, std::span<char> into,
                                                        const MailPatience& patience);

}  // namespace margay
