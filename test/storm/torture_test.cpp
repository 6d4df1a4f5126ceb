// A tree of twenty slaves for a hundred thousand cycles on a bad line. Then every wire is broken and every slave
// switched off, at every step of a bring-up and of a recovery. The rules of the storm apply: no input is delivered as
// valid that the slave never had, no output is applied that the application did not write, every request ends, and all
// slaves come back.
#include "storm/operations.hpp"
#include "storm/run.hpp"

#include <gtest/gtest.h>

namespace margay::storm {
namespace {

// 20 devices: junctions with lines at their ports.
Plan tree(std::uint64_t seed) {
    Plan plan;
    plan.seed = seed;
    plan.settings.calm = 1;
    constexpr std::array<std::string_view, 4> kLeaves{"digital_io_16", "digital_out_8", "digital_in_16", "analog_in_4"};
    plan.devices.push_back({0, "junction", {}, -1, 0});
    for (std::uint32_t j = 1; j <= 3; ++j)
        plan.devices.push_back({j, "junction", {}, static_cast<std::int32_t>(j - 1), 1});
    std::uint32_t id = 4;
    for (std::uint32_t j = 0; j < 4; ++j)
        for (const std::uint32_t port : {2U, 3U}) {
            auto parent = static_cast<std::int32_t>(j);
            for (std::uint32_t n = 0; n < 2; ++n) {
                plan.devices.push_back({id, std::string(kLeaves[id % 4]), {}, parent, n == 0 ? port : 1});
                parent = static_cast<std::int32_t>(id++);
            }
        }
    return plan;
}

void expect_good(const Plan& plan, const std::string& what, unsigned cpu_seconds = 60) {
    const auto verdict = execute(plan, cpu_seconds);
    if (verdict.good()) return;
    if (const char* const reason = known_reason(verdict); reason != nullptr) {
        std::printf("%s: %s, known: %s\n", what.c_str(), verdict.rule.c_str(), reason);
        return;
    }
    ADD_FAILURE() << what << ", seed " << plan.seed << ": " << verdict.rule << "\n"
                  << verdict.detail << "\n"
                  << to_text(plan);
}

void hundred_thousand_cycles(std::uint64_t seed) {
    Plan plan = tree(seed);
    ASSERT_EQ(plan.devices.size(), 20U);
    // 10 % of the frames are lost, half of them on the way out; 5 % are duplicated; 10 % are delayed, which changes
    // their order.
    plan.steps = {{1000, Op::drop, {50'000, 50'000}},
                  {0, Op::duplicate, {25'000, 25'000}},
                  {0, Op::delay, {100'000, 2'000}},
                  {100'000'000, Op::late, {0}}};
    std::printf("seed %llu\n", static_cast<unsigned long long>(seed));
    expect_good(plan, "100 000 cycles", 300);
}

TEST(Torture, AHundredThousandCyclesOnABadLine) { hundred_thousand_cycles(1); }

// All slaves are in OP. Each cable is broken, each slave loses its power supply, and the same again at moments of the
// recovery.
TEST(Torture, EveryWireAndEverySlaveAgainDuringTheRecovery) {
    const Plan base = tree(2);
    for (std::uint32_t device = 0; device < base.devices.size(); ++device)
        for (const bool power : {false, true})
            for (const std::uint32_t again : {900U, 7'300U, 33'000U}) {
                Plan plan = base;
                plan.seed = 100 * device + power;
                const Op off = power ? Op::power_off : Op::cut;
                const Op on = power ? Op::power_on : Op::mend;
                plan.steps = {
                    {1000, off, {device}}, {30'000, on, {device}}, {again, off, {device}}, {5'000, on, {device}}};
                expect_good(plan, std::string(power ? "power" : "cable") + " of device " + std::to_string(device) +
                                      ", again after " + std::to_string(again) + " us");
            }
}

// Scan and mapping of a line of five slaves, interrupted at each moment in turn. The moment advances by a prime number
// of microseconds, so that it meets different steps.
TEST(Torture, EveryWireAndEverySlaveAtEveryStepOfTheBringUp) {
    Plan base;
    base.devices = {{0, "coupler", {}, -1, 0},
                    {1, "digital_io_16", {}, 0, 1},
                    {2, "soe_drive", {}, 1, 1},
                    {3, "digital_out_8", {}, 2, 1},
                    {4, "encoder", {}, 3, 1}};
    for (std::uint32_t device = 0; device < base.devices.size(); ++device)
        for (const bool power : {false, true})
            for (std::uint32_t at = 1; at < 400'000; at += 9'973) {
                Plan plan = base;
                plan.seed = at;
                // The mapping starts 300 ms later, whatever the result of the scan.
                const Step map{0, Op::map, {0}};
                plan.steps = {{0, Op::submit, {0, *kind_by_name("scan"), 0, 0, 0}}};
                const Step off{0, power ? Op::power_off : Op::cut, {device}};
                const Step on{20'000, power ? Op::power_on : Op::mend, {device}};
                std::uint32_t now = 0;
                const auto add = [&](Step step, std::uint32_t when) {
                    step.after_us = when - now;
                    now = when;
                    plan.steps.push_back(step);
                };
                if (at > 280'000) {
                    add(map, 300'000);
                    if (at > 300'000)
                        add(off, at), add(on, at + 20'000);
                    else
                        continue;
                } else {
                    add(off, at);
                    add(on, at + 20'000);
                    add(map, 300'000);
                }
                add({0, Op::submit, {1, *kind_by_name("supervise"), 0, 0, 0}}, 1'000'000);
                add({0, Op::late, {0}}, 1'100'000);
                expect_good(plan, std::string(power ? "power" : "cable") + " of device " + std::to_string(device) +
                                      " at " + std::to_string(at) + " us");
            }
}

}  // namespace
}  // namespace margay::storm
