// What the storm finds and is not mended yet: by rule, with the sentence of the issue. To be emptied.
#include "storm/run.hpp"

#include <algorithm>
#include <array>

namespace margay::storm {
namespace {

struct Known {
    std::string_view rule;    // begins so
    std::string_view detail;  // and holds this
    const char* reason;
};

constexpr std::array kKnown{
    Known{"the cycle is right with a wrong slave", "", "1: wrong slaves get outputs, working counter as expected"},
    Known{"a wrong slave has outputs", "", "1: wrong slaves get outputs"},
};

}  // namespace

const char* known_reason(const Verdict& verdict) {
    for (const auto& known : kKnown)
        if (verdict.rule.starts_with(known.rule) && verdict.detail.find(known.detail) != std::string::npos)
            return known.reason;
    return nullptr;
}

}  // namespace margay::storm
