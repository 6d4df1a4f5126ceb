// Describes an SII image as text.
#pragma once

#include "util/bytes.hpp"
#include "wire/sii_check.hpp"

#include <string>
#include <vector>

namespace margay::samples {

// The whole image as text, category by category. Unknown categories are shown as octets. In a damaged image everything
// that can be read is shown.
[[nodiscard]] std::string sii_text(Bytes image);
// The same for the content of an EEPROM up to the end of its categories. A larger EEPROM is not a fault.
[[nodiscard]] std::string sii_text_of_used_part(Bytes image);

// All findings of the strict check.
[[nodiscard]] std::vector<wire::sii::Finding> sii_findings(Bytes image);

// A finding as text: "word 0x0007: the checksum of the configuration area is wrong (expected 0x10, found 0xff)".
[[nodiscard]] std::string finding_text(const wire::sii::Finding& finding);

}  // namespace margay::samples
