// The texts of invalid arguments.
#pragma once

#include <margay/error.hpp>

#include <string_view>

namespace margay {

// The name of an argument in the API, and the values that it may have; empty: not known. A static string.
[[nodiscard]] std::string_view argument_text(Argument argument);

}  // namespace margay
