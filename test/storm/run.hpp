// Executes a plan in a separate process, so that a crash or an endless loop is also a result, and reduces plans that
// fail.
#pragma once

#include "storm/plan.hpp"

namespace margay::storm {

struct Verdict {
    std::string rule;    // empty: no rule was broken
    std::string detail;  // details, or the error output of a crash
    double simulated_seconds = 0;
    [[nodiscard]] bool good() const { return rule.empty(); }
};

#ifdef __SANITIZE_THREAD__
constexpr unsigned kCpuSeconds = 900;
#else
constexpr unsigned kCpuSeconds = 60;
#endif

// `cpu_seconds` limits the CPU time of the process.
[[nodiscard]] Verdict execute(const Plan& plan, unsigned cpu_seconds = kCpuSeconds);

// Finds a smaller plan that breaks the same rule, in at most `most` runs.
[[nodiscard]] Plan shrink(const Plan& plan, const std::string& rule, unsigned most = 400);

// The sentence of the issue about a known failure; nullptr when the failure is not known.
[[nodiscard]] const char* known_reason(const Verdict& verdict);

}  // namespace margay::storm
