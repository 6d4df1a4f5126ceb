// The texts of what an application has given wrongly or not at all: arguments, features, memory.
#pragma once

#include <margay/error.hpp>

#include <string_view>

namespace margay {

// The name of an argument in the API, and the values that it may have; empty: not known. A static string.
// `where`: the error, of which step and slave decide which states are allowed.
[[nodiscard]] std::string_view argument_text(Argument argument, const Error& where);

// Whether a feature that the context does not have would be needed; feature_text() is then the cause.
[[nodiscard]] bool needs_feature(const Error& e);
[[nodiscard]] std::string_view feature_text(const Error& e);

// The memory of the application that is too small, by its name in the API.
[[nodiscard]] std::string_view capacity_text(const Error& e);

// Which configuration is gone, and when it must be written.
[[nodiscard]] std::string_view lost_text(const Error& e);

// Why no slave can have the list of PDOs.
[[nodiscard]] std::string_view pdo_list_text(PdoListFault why);

}  // namespace margay
