#include "common/cycle_plan.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::samples {
namespace {

void follow_clocks(CyclePlan& plan, const files::EniConfiguration& eni) {
    if (!eni.clocks || eni.clocks->group >= plan.every.size()) return;
    const Duration cycle = plan.period * plan.every[eni.clocks->group];
    plan.clock = {.group = eni.clocks->group, .set_value = -cycle / 2, .phase = {.cycle = cycle}};
    const Duration of_file = eni.groups.empty() ? Duration{0} : eni.groups[eni.clocks->group].cycle;
    if (of_file > Duration{0} && of_file != cycle)
        plan.remark =
            fmt::format("the ENI uses clocks in a cycle of {} µs: slaves with SYNC0 may refuse a cycle of {} µs",
                        of_file / std::chrono::microseconds(1), cycle / std::chrono::microseconds(1));
}

}  // namespace

CyclePlan plan_cycles(const files::EniConfiguration* eni, Duration cycle) {
    CyclePlan plan;
    if (cycle > Duration{0}) plan.period = cycle;
    if (eni == nullptr) return plan;
    if (eni->groups.empty()) {
        follow_clocks(plan, *eni);
        return plan;
    }
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
    follow_clocks(plan, *eni);
    return plan;
}

}  // namespace margay::samples
