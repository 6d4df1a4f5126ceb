// A strict check of a whole SII image that reports every fault with its location. The readers in sii_category.hpp are
// tolerant: they continue with content that this check reports, as far as a master can use it.
#pragma once

#include "wire/sii.hpp"

#include <span>

namespace margay::wire::sii {

struct Finding {
    Fault fault = Fault::none;
    std::uint16_t category = category::kEnd;  // type of the category with the fault; kEnd: the fixed part or the chain
    std::uint32_t word = 0;                   // word address of the faulty content
    std::uint32_t expected = 0;               // meaning depends on the fault; both 0 when there is nothing to compare
    std::uint32_t actual = 0;
    friend constexpr bool operator==(const Finding&, const Finding&) = default;
};

// Checks `image` completely and writes the findings into `findings` in the order of the image, as far as there is
// space. Returns the number of findings, which may be larger than the size of `findings`. Does not allocate; the time
// is proportional to the size of the image.
[[nodiscard]] std::size_t check_image(Bytes image, std::span<Finding> findings);

}  // namespace margay::wire::sii
