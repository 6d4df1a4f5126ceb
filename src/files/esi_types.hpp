// Names of basic data types of CoE (ETG.1000.6).
#pragma once

#include <cstdint>
#include <string_view>

namespace margay::files {

// The use of a SyncManager that the SII calls unused. The schema has no word for it.
inline constexpr const char* kUnusedSm = "Unused";

// For an unknown number: a type that has this number of bits, or "" if there is none.
[[nodiscard]] std::string_view data_type_name(std::uint16_t number, std::uint32_t bits);

}  // namespace margay::files
