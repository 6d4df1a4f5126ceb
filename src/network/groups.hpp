// The groups of a network, and mapping one: from the slaves' process data to SAFEOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// Discovers, lays out and configures; returns the octets of the image in use. See config_map(). After an error of one
// slave the group is mapped all the same when `mapped` says so: the others are in SAFEOP.
[[nodiscard]] Task<Result<std::size_t>> map_group(Network& network, std::uint8_t number, MutableBytes image);

}  // namespace margay
