// A JSON document as text.
#pragma once

#include <nlohmann/json.hpp>

#include <string>

namespace margay::samples {

// With a line end. Octets that are no UTF-8, for example in a file name or an argument, become U+FFFD.
[[nodiscard]] inline std::string json_text(const nlohmann::ordered_json& json) {
    return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace margay::samples
