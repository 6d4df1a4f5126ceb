// An SII image in words.
#pragma once

#include "util/bytes.hpp"
#include "wire/sii_check.hpp"

#include <string>
#include <vector>

namespace margay::samples {

// Everything in it, category by category; what is not known is shown as octets. What can be read is shown,
// however bad the rest is.
[[nodiscard]] std::string sii_text(Bytes image);

// All that the strict check finds.
[[nodiscard]] std::vector<wire::sii::Finding> sii_findings(Bytes image);

// "word 0x0007: the checksum of the configuration area is wrong (expected 0x10, found 0xff)".
[[nodiscard]] std::string finding_text(const wire::sii::Finding& finding);

}  // namespace margay::samples
