// Texts for people: characters that are not seen are replaced.
#pragma once

#include <string>
#include <string_view>

namespace margay::samples {

// The text with ? in the place of characters that are not seen (in UTF-8): they turn the direction of a text, or make
// it look like another one. Controls and octets that are no UTF-8 stay.
[[nodiscard]] std::string visible(std::string_view text);

}  // namespace margay::samples
