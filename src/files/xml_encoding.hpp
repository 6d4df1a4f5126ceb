// The encodings of XML files besides UTF-8.
#pragma once

#include <string>
#include <string_view>

namespace margay::files {

// In UTF-8.
[[nodiscard]] std::string from_latin1(std::string_view octets);
[[nodiscard]] std::string from_windows_1252(std::string_view octets);

}  // namespace margay::files
