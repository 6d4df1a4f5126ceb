// CoE emergency error codes (ETG.1000.6 table "Emergency error codes").
#pragma once

#include <cstdint>
#include <string_view>

namespace margay::wire {

// In words: of the code itself where the standard has it, else of the class that it belongs to.
[[nodiscard]] std::string_view emergency_text(std::uint16_t code);

}  // namespace margay::wire
