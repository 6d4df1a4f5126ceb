// Makes the object of a dictionary for an ESI from the description that a slave has reported.
#pragma once

#include <margay/files/esi.hpp>

#include <cstdint>
#include <span>
#include <string>

namespace margay::files {

struct SaidEntry {
    std::uint8_t subindex = 0;
    std::uint16_t access = 0;  // the same bits as EntryDescription::access
    std::uint16_t data_type = 0;
    std::uint16_t bits = 0;
    std::string name{};
};

// `entries`: the entries that the slave describes, in their order.
[[nodiscard]] EsiObject esi_object(std::uint16_t index, std::string name, unsigned max_subindex,
                                   std::span<const SaidEntry> entries);

}  // namespace margay::files
