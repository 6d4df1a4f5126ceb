// Names of basic data types of CoE (ETG.1000.6).
#pragma once

#include <margay/files/esi.hpp>

#include <cstdint>
#include <optional>
#include <string_view>

namespace margay::files {

// The text for an unused SyncManager. The schema has no word for it.
inline constexpr const char* kUnusedSm = "Unused";

// The direction of a SyncManager of process data with a name of the vendor, from its control octet. nullopt: it has no
// such name, or the octet is the octet of a mailbox.
[[nodiscard]] std::optional<Direction> direction_by_control(const EsiSyncManager& sm);

// For an unknown number: a type that has this number of bits, or "" if there is none.
[[nodiscard]] std::string_view data_type_name(std::uint16_t number, std::uint32_t bits);

}  // namespace margay::files
