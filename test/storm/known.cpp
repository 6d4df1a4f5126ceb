// Faults that the storm finds and that are not fixed yet: the rule and the sentence of the issue. This list should
// become empty.
#include "storm/run.hpp"

#include <algorithm>
#include <array>

namespace margay::storm {
namespace {

struct Known {
    std::string_view rule;    // the beginning of the rule
    std::string_view detail;  // a part of the detail
    const char* reason;
};

constexpr std::array kKnown{
    Known{"the arena does not return to its level", "",
          "something of a mailbox stays when a slave leaves (seeds 6, 66)"},
    Known{"the cycle is right without a slave", "", "expected working counter beside hooks that fail (seeds 278, 363)"},
    Known{"a supervised slave does not come back", "soe_drive", "found again in INIT and not helped (seed 91)"},
    Known{"an input is delivered as good that the slave did not have", "digital_in_16",
          "a mapping beside the cycle (seed 61)"},
    Known{"an input is in the image that the slave never had", "digital_in_16", "seed 324"},
    Known{"while a group is mapped: an input is delivered as good that the slave did not have", "bootloader",
          "the library's bootloader has its inputs in another SyncManager than its SII says (seed 189)"},
    Known{"an input is delivered as good that the slave did not have", "bootloader",
          "new: the library's bootloader has its inputs in another SyncManager than its SII says"},
};

}  // namespace

const char* known_reason(const Verdict& verdict) {
    for (const auto& known : kKnown)
        if (verdict.rule.starts_with(known.rule) && verdict.detail.find(known.detail) != std::string::npos)
            return known.reason;
    return nullptr;
}

}  // namespace margay::storm
