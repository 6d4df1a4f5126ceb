// Runs a plan in a process of its own, so that a crash or an endless loop is a result like any other, and makes plans
// that fail smaller.
#pragma once

#include "storm/plan.hpp"

namespace margay::storm {

struct Verdict {
    std::string rule;    // empty: everything held
    std::string detail;  // or what a crash has left on its error output
    double simulated_seconds = 0;
    [[nodiscard]] bool good() const { return rule.empty(); }
};

// `cpu_seconds` is all the time it has.
[[nodiscard]] Verdict execute(const Plan& plan, unsigned cpu_seconds = 60);

// A smaller plan that breaks the same rule; `most` runs are tried.
[[nodiscard]] Plan shrink(const Plan& plan, const std::string& rule, unsigned most = 400);

// Rules that are known to be broken, with the sentence of the issue that says so; nullptr: it is not known.
[[nodiscard]] const char* known_reason(const Verdict& verdict);

}  // namespace margay::storm
