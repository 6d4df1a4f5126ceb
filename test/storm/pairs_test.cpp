// Every pair of operations at the same time, in both orders: with a supervision and cycles, and without them.
#include "storm/operations.hpp"
#include "storm/run.hpp"

#include <gtest/gtest.h>

namespace margay::storm {
namespace {

Plan devices() {
    Plan plan;
    plan.seed = 11;
    plan.devices = {{0, "coupler", {}, -1, 0},
                    {1, "digital_io_16", {}, 0, 1},
                    {2, "soe_drive", {}, 1, 1},
                    {3, "digital_out_8", {}, 2, 1}};
    return plan;
}

Step submit(std::uint32_t after_us, std::uint32_t slot, std::uint32_t kind, std::uint32_t slave) {
    return {after_us, Op::submit, {slot, kind, slave, 2, 0}};
}

// The name of a device with the protocol of the request; nullptr: an I/O device has the protocol.
const char* device_for(std::uint32_t kind) {
    const std::string_view name = kind_name(kind);
    if (name.starts_with("voe")) return "voe_device";
    if (name.starts_with("aoe")) return "aoe_gateway";
    if (name.starts_with("eoe")) return "eoe_gateway";
    if (name.starts_with("foe")) return "bootloader_open";
    return nullptr;
}

void try_all(const Plan& base, std::uint32_t apart_us) {
    unsigned failed = 0;
    for (std::uint32_t first = 0; first < kinds().size(); ++first)
        for (std::uint32_t second = 0; second < kinds().size(); ++second) {
            Plan plan = base;
            const char* const device = device_for(first) != nullptr ? device_for(first) : device_for(second);
            if (device != nullptr) plan.devices[1].name = device;
            plan.steps.push_back(submit(1000, 0, first, 2));
            plan.steps.push_back(submit(apart_us, 1, second, 2));
            plan.steps.push_back({20'000, Op::late, {0}});
            const auto verdict = execute(plan);
            if (verdict.good()) continue;
            const char* const reason = known_reason(verdict);
            if (reason == nullptr) ++failed;
            std::printf("%s and %s: %s%s%s\n", kind_name(first).data(), kind_name(second).data(), verdict.rule.c_str(),
                        reason == nullptr ? "" : ", known: ", reason == nullptr ? verdict.detail.c_str() : reason);
        }
    EXPECT_EQ(failed, 0U) << "pairs of " << kinds().size() * kinds().size();
}

TEST(Pairs, SideBySideUnderSupervision) {
    Plan plan = devices();
    plan.settings.calm = 1;
    try_all(plan, 0);
}

TEST(Pairs, SideBySideBesideTheCycle) {
    Plan plan = devices();
    plan.steps.push_back(submit(0, 2, *kind_by_name("scan"), 0));
    plan.steps.push_back(submit(1'000'000, 3, *kind_by_name("map"), 0));
    plan.steps.push_back({1'000'000, Op::late, {0}});
    try_all(plan, 0);
}

TEST(Pairs, TheSecondOneALittleLater) {
    Plan plan = devices();
    plan.steps.push_back(submit(0, 2, *kind_by_name("scan"), 0));
    plan.steps.push_back(submit(1'000'000, 3, *kind_by_name("map"), 0));
    plan.steps.push_back({1'000'000, Op::late, {0}});
    try_all(plan, 730);
}

}  // namespace
}  // namespace margay::storm
