// The objects of a modular device (ETG.5001 "Modular Device Profile"): 0xF000 says how the objects of the modules are
// arranged, 0xF030 is the list of modules that the master expects, 0xF050 the list of modules that the device has
// found. Each list has one ident of 32 bits for each slot; 0: the slot is empty. A device that has both lists refuses
// SAFEOP with AL status code 0x0070 while the master has written a list that differs from the modules that were found.
//
//     constexpr std::uint8_t kSlots = 4;
//     struct Values {
//         using modules = ModuleValues<kSlots, 16>;                        // behind the other values of the device
//         static constexpr std::size_t bytes = 16 + modules::bytes;
//     };
//     constexpr auto kProfile = module_profile_entries(kSlots, 0x10);     // slot n has objects 0x6000 + n * 0x10 …
//     constexpr auto kExpected = configured_module_entries<Values::modules>();
//     constexpr auto kFound = detected_module_entries<Values::modules>();
//     … record(0xF000, "Modular device profile", kProfile), array(0xF030, "Configured modules", kExpected),
//       array(0xF050, "Detected modules", kFound) …
//
// The firmware writes the idents that it finds by ModuleValues::store_found().
#pragma once

#include "subdevice/object_dictionary.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay::subdevice {

inline constexpr std::uint16_t kModuleProfile = 0xF000;
inline constexpr std::uint16_t kConfiguredModules = 0xF030;
inline constexpr std::uint16_t kDetectedModules = 0xF050;

// Values in the image from `Offset` on, for `Slots` slots (1 to 254).
template <std::uint8_t Slots, std::size_t Offset>
struct ModuleValues {
    static_assert(Slots >= 1 && Slots <= 254);
    static constexpr std::uint8_t slots = Slots;
    using configured_count = Field<std::uint8_t, Offset>;
    using configured_first = Field<std::uint32_t, Offset + 1>;
    using found_count = Field<std::uint8_t, Offset + 1 + 4 * Slots>;
    using found_first = Field<std::uint32_t, Offset + 2 + 4 * Slots>;
    static constexpr std::size_t bytes = 2 + 8 * Slots;

    // `idents`: of the slots from the first one on; the other slots are empty. With the lock of the dictionary held.
    static void store_found(MutableBytes image, std::span<const std::uint32_t> idents) {
        found_count::store(image, static_cast<std::uint8_t>(std::min<std::size_t>(idents.size(), Slots)));
        for (std::size_t n = 0; n < Slots; ++n)
            store_le(image, found_first::offset + 4 * n, n < idents.size() ? idents[n] : std::uint32_t{0});
    }
};

// `distance`: between the indices of the objects of two slots that follow each other.
[[nodiscard]] constexpr std::array<Entry, 3> module_profile_entries(std::uint16_t slots, std::uint16_t distance) {
    return {entry_count(2), constant<std::uint16_t>(1, "Index distance", distance),
            constant<std::uint16_t>(2, "Maximum number of modules", slots)};
}

template <class V>
[[nodiscard]] constexpr std::array<Entry, 2> configured_module_entries() {
    return {value<typename V::configured_count>(0, "SubIndex 000", od::kReadWritePreop).within(kLimits<0, V::slots>),
            value<typename V::configured_first>(1, "Module ident", od::kReadWritePreop).times(V::slots)};
}

template <class V>
[[nodiscard]] constexpr std::array<Entry, 2> detected_module_entries() {
    return {value<typename V::found_count>(0, "SubIndex 000", od::kReadOnly),
            value<typename V::found_first>(1, "Module ident", od::kReadOnly).times(V::slots)};
}

// Compares the two lists. An empty list in 0xF030 is no expectation. AlStatusCode::none when the lists agree, or when
// the device has no such objects.
[[nodiscard]] wire::AlStatusCode check_modules(const ObjectDictionary& dictionary);

}  // namespace margay::subdevice
