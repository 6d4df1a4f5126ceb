// Faults that the storm finds and that are not fixed yet: the rule and the reason. The list is empty: no seed may fail.
#include "storm/run.hpp"

#include <algorithm>
#include <span>

namespace margay::storm {
namespace {

struct Known {
    std::string_view rule;    // the beginning of the rule
    std::string_view detail;  // a part of the detail
    const char* reason;
};

constexpr std::span<const Known> kKnown{};

}  // namespace

const char* known_reason(const Verdict& verdict) {
    for (const auto& known : kKnown)
        if (verdict.rule.starts_with(known.rule) && verdict.detail.find(known.detail) != std::string::npos)
            return known.reason;
    return nullptr;
}

}  // namespace margay::storm
