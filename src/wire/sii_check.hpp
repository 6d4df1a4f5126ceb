// A strict look at a whole SII image: everything that is wrong with it, each fault with its place. What a
// master can make use of nevertheless is a matter of the readers in sii_category.hpp, which go on where this
// complains.
#pragma once

#include "wire/sii.hpp"

#include <span>

namespace margay::wire::sii {

struct Finding {
    Fault fault = Fault::none;
    std::uint16_t category = category::kEnd;  // type of the category it is in; kEnd: none, the fixed part or the chain
    std::uint32_t word = 0;                   // where: the start of what is at fault
    std::uint32_t expected = 0;               // as the fault has it, both 0 where there is nothing to compare
    std::uint32_t actual = 0;
    friend constexpr bool operator==(const Finding&, const Finding&) = default;
};

// Looks at all of `image` and puts what it finds into `findings`, in the order of the image, as far as there
// is room. Returns how many there are, which may be more than were put. No allocation; time grows with the
// image's length.
[[nodiscard]] std::size_t check_image(Bytes image, std::span<Finding> findings);

}  // namespace margay::wire::sii
