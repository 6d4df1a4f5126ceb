#include "common/cycle_plan.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::samples {

CyclePlan plan_cycles(const files::EniConfiguration* eni, Duration cycle) {
    CyclePlan plan;
    if (cycle > Duration{0}) plan.period = cycle;
    if (eni == nullptr || eni->groups.empty()) return plan;
    std::vector<Duration> wanted;
    for (const auto& group : eni->groups)
        wanted.push_back(cycle > Duration{0} && eni->groups.size() == 1 ? cycle
                         : group.cycle > Duration{0}                    ? group.cycle
                                                                        : plan.period);
    plan.period = std::ranges::min(wanted);
    plan.every.clear();
    for (const Duration each : wanted) {
        if (each % plan.period != Duration{0})
            plan.error = fmt::format("the ENI has a cycle of {} µs, which is no multiple of its shortest one, {} µs",
                                     each / std::chrono::microseconds(1), plan.period / std::chrono::microseconds(1));
        plan.every.push_back(static_cast<unsigned>(each / plan.period));
    }
    if (cycle > Duration{0} && wanted.size() > 1)
        plan.error = fmt::format("the ENI has {} cycles with times of their own", wanted.size());
    return plan;
}

}  // namespace margay::samples
