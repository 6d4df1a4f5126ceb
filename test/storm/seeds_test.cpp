// The seeds of the test suite, and plans that failed once.
#include "storm/run.hpp"

#include <gtest/gtest.h>
#include <places.hpp>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace margay::storm {
namespace {

// The number of seeds, starting at 1: about two minutes on one core. The number is fixed, so that the suite is the
// same on all machines. A run under sanitizers lasts several times as long.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::uint64_t kSeeds = 80;
#else
constexpr std::uint64_t kSeeds = 400;
#endif

TEST(Storm, Seeds) {
    double simulated = 0;
    unsigned known = 0;
    unsigned failed = 0;
    std::time_t begin = std::time(nullptr);
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        const Plan plan = make_plan(seed);
        const auto verdict = execute(plan);
        simulated += verdict.simulated_seconds;
        if (verdict.good()) continue;
        if (known_reason(verdict) != nullptr) {
            ++known;
            continue;
        }
        ADD_FAILURE() << "seed " << seed << ": " << verdict.rule << "\n" << verdict.detail;
        if (failed++ == 0) std::printf("%s", to_text(shrink(plan, verdict.rule)).c_str());
    }
    const auto took = static_cast<double>(std::max<std::time_t>(std::time(nullptr) - begin, 1));
    std::printf("%llu seeds, %.0f simulated seconds, %.0f a second; %u broke a rule in a way that is known\n",
                static_cast<unsigned long long>(kSeeds), simulated, simulated / took, known);
}

TEST(Storm, PlansThatOnceFailed) {
    unsigned count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(MARGAY_SOURCE_DIR "/test/storm/plans")) {
        if (entry.path().extension() != ".plan") continue;
        std::ifstream file(entry.path());
        std::ostringstream text;
        text << file.rdbuf();
        std::string why;
        const auto plan = parse_plan(text.str(), why);
        ASSERT_TRUE(plan) << entry.path() << ": " << why;
        ++count;
        // A plan with "# known: …" shows a fault that is not fixed yet.
        const auto verdict = execute(*plan);
        const bool known = text.str().find("# known:") != std::string::npos;
        if (known)
            std::printf("%s: %s\n", entry.path().filename().c_str(),
                        verdict.good() ? "is mended: take its mark away" : verdict.rule.c_str());
        else
            EXPECT_TRUE(verdict.good()) << entry.path() << ": " << verdict.rule << "\n" << verdict.detail;
    }
    EXPECT_GT(count, 0U);
}

// The same seed generates the same plan, and the text form contains the complete plan.
TEST(Storm, APlanIsTheSameAsItsText) {
    for (std::uint64_t seed = 1; seed < 200; ++seed) {
        const std::string text = to_text(make_plan(seed));
        EXPECT_EQ(text, to_text(make_plan(seed)));
        std::string why;
        const auto read = parse_plan(text, why);
        ASSERT_TRUE(read) << why;
        EXPECT_EQ(to_text(*read), text);
    }
}

// Two runs of a plan end at the same nanosecond of virtual time.
TEST(Storm, ARunIsTheSameEachTime) {
    for (const std::uint64_t seed : {3U, 8U, 21U}) {
        const auto once = execute(make_plan(seed));
        const auto again = execute(make_plan(seed));
        EXPECT_EQ(once.rule, again.rule);
        EXPECT_EQ(once.simulated_seconds, again.simulated_seconds);
    }
}

// The storm finds a broken rule and reduces the plan. This plan has two devices at one port, so one of them is never
// found.
TEST(Storm, APlanThatFailsIsMadeSmaller) {
    Plan plan = make_plan(5);
    plan.steps.resize(6);
    plan.settings = {.calm = 1, .groups = 2, .in_flight = 2};
    plan.devices = {{0, "junction", {}, -1, 0},
                    {1, "digital_io_16", {}, 0, 1},
                    {2, "digital_out_8", {}, 0, 1},
                    {3, "junction", {}, 0, 2},
                    {4, "digital_in_8", {}, 3, 1}};
    const auto verdict = execute(plan);
    ASSERT_EQ(verdict.rule, "bring-up") << verdict.detail;
    const Plan small = shrink(plan, verdict.rule);
    EXPECT_TRUE(small.steps.empty());
    EXPECT_EQ(small.devices.size(), 3U);
    EXPECT_EQ(small.settings.groups, 1U);
    EXPECT_EQ(execute(small).rule, verdict.rule);
}

// A wrong plan is reported.
TEST(Storm, APlanThatCannotBeIsRefused) {
    std::string why;
    const auto plan = parse_plan("device 0 junction -1 0\nafter 0 quirk 0 7\n", why);
    ASSERT_TRUE(plan) << why;
    EXPECT_TRUE(execute(*plan).good());
    const auto no_device = parse_plan("device 0 nobody -1 0\n", why);
    ASSERT_TRUE(no_device) << why;
    EXPECT_EQ(execute(*no_device).rule, "bad plan");
    EXPECT_FALSE(parse_plan("device 0 junction -1 0\nafter 5 unheard 1\n", why));
    EXPECT_EQ(why, "line 2: after 5 unheard 1");
}

}  // namespace
}  // namespace margay::storm
