// The groups of a network, and mapping one: from the slaves' process data to SAFEOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// Discovers, lays out and configures; returns the octets of the image in use. See config_map().
[[nodiscard]] Task<Result<std::size_t>> map_group(Network& network, std::uint8_t number, MutableBytes image);

}  // namespace margay
