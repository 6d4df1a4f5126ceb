// Whether a text is well-formed XML in the points that the XML library does not check.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace margay::files {

struct FormFault {
    std::size_t offset = 0;
    std::string text{};
};

// The first fault of a text in UTF-8: characters that XML 1.0 does not have, references to undefined entities, "<" in
// the value of an attribute, "]]>" in a text, "--" in a comment, and an XML declaration at a wrong place or with wrong
// content. Elements, attributes and their nesting are left to the XML library. The check ends at a document type, which
// the reader refuses.
[[nodiscard]] std::optional<FormFault> form_fault(std::string_view text);

}  // namespace margay::files
