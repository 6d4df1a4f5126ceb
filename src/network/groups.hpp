// Mapping a group of slaves: from the discovery of their process data to SAFEOP.
#pragma once

#include "network/network.hpp"

namespace margay {

// The memory of an image: memory of the caller, or a function that provides the memory when the size is known.
struct ImageMemory {
    MutableBytes image{};
    std::span<std::byte> (*provide)(std::size_t bytes, void* user) = nullptr;
    void* user = nullptr;
};

// Discovers the process data, lays out the image and configures the slaves; returns the used octets of the image. See
// config_map(). After an error of one slave the group may be mapped nevertheless, when its `mapped` is true: the other
// slaves are then in SAFEOP.
[[nodiscard]] Task<Result<std::size_t>> map_group(Network& network, std::uint8_t number, const ImageMemory& memory);

}  // namespace margay
