// A JSON document as text.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace margay::samples {

// The document with a line end. Octets that are not UTF-8, for example in a file name or an argument, become U+FFFD.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& json);

}  // namespace margay::samples
