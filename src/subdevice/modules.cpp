#include "subdevice/modules.hpp"

#include <algorithm>

namespace margay::subdevice {

wire::AlStatusCode check_modules(const ObjectDictionary& dictionary) {
    const auto expected = static_cast<unsigned>(dictionary.number(kConfiguredModules, 0));
    if (expected == 0 || dictionary.find(kDetectedModules) == nullptr) return wire::AlStatusCode::none;
    const auto found = static_cast<unsigned>(dictionary.number(kDetectedModules, 0));
    const auto ident = [&](std::uint16_t list, unsigned count, unsigned slot) {
        return slot <= count ? dictionary.number(list, slot) : std::uint64_t{0};
    };
    for (unsigned slot = 1; slot <= std::max(expected, found); ++slot)
        if (ident(kConfiguredModules, expected, slot) != ident(kDetectedModules, found, slot))
            return wire::AlStatusCode::module_list_mismatch;
    return wire::AlStatusCode::none;
}

}  // namespace margay::subdevice
