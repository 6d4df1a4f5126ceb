// Texts for people, in which invisible characters are replaced.
#pragma once

#include <string>
#include <string_view>

namespace margay::samples {

// The text with ? in place of invisible characters (in UTF-8), because they reverse the direction of a text or make it
// look like another text. Control characters and octets that are not UTF-8 are kept.
[[nodiscard]] std::string visible(std::string_view text);

}  // namespace margay::samples
