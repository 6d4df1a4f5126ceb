// CoE emergency error codes (ETG.1000.6 table "Emergency error codes").
#pragma once

#include <cstdint>
#include <string_view>

namespace margay::wire {

// Text of a code if the standard has one, otherwise the text of its class of codes.
[[nodiscard]] std::string_view emergency_text(std::uint16_t code);

}  // namespace margay::wire
