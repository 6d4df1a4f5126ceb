// State transitions by their abbreviations in ESI and ENI files.
#pragma once

#include <margay/startup.hpp>

#include <array>
#include <string_view>

namespace margay::files {

inline constexpr std::array kTransitions{
    Transition::init_to_preop, Transition::preop_to_safeop, Transition::safeop_to_op,    Transition::op_to_safeop,
    Transition::op_to_preop,   Transition::op_to_init,      Transition::safeop_to_preop, Transition::safeop_to_init,
    Transition::preop_to_init, Transition::init_to_boot,    Transition::boot_to_init};

// Transition::none: the abbreviation is unknown.
[[nodiscard]] inline Transition transition_by_initials(std::string_view text) {
    for (const Transition one : kTransitions)
        if (initials(one) == text) return one;
    return Transition::none;
}

}  // namespace margay::files
