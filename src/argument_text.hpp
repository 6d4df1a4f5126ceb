// The texts for arguments, features and memory that an application has not provided, or has provided wrongly.
#pragma once

#include <margay/error.hpp>

#include <string_view>

namespace margay {

// The name of an argument in the API, and the values that it may have; empty: not known. A static string.
// `where`: the error, of which step and slave decide which states are allowed.
[[nodiscard]] std::string_view argument_text(Argument argument, const Error& where);

// Whether the error is caused by a feature that the context does not have; feature_text() is the text of this cause.
[[nodiscard]] bool needs_feature(const Error& e);
[[nodiscard]] std::string_view feature_text(const Error& e);

// The memory of the application that is too small, by its name in the API.
[[nodiscard]] std::string_view capacity_text(const Error& e);

// Names the configuration that was lost, and the time at which it must be written.
[[nodiscard]] std::string_view lost_text(const Error& e);

// The reason why no slave can have the list of PDOs.
[[nodiscard]] std::string_view pdo_list_text(PdoListFault why);

}  // namespace margay
