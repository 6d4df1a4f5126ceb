// What the storm finds and is not mended yet: by rule, with the reason. Empty: every seed has to hold.
#include "storm/run.hpp"

#include <algorithm>
#include <span>

namespace margay::storm {
namespace {

struct Known {
    std::string_view rule;    // begins so
    std::string_view detail;  // and holds this
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
