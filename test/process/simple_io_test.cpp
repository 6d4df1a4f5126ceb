// The program simple_io, over a cable to a second process with a simulated segment, which then loses its power.
#include <places.hpp>
#include "netns.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kSimpleIo = std::string(MARGAY_BIN_DIR) + "/simple_io";
const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
constexpr auto kLimit = 60s;

TEST(SimpleIo, BringsASegmentToOpOverACableAndBackThereAfterALossOfPower) {
    const Cable cable;
    if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
    auto segment = std::make_unique<Child>(cable.segment_namespace(),
                                           std::vector<std::string>{kVirtualSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(segment->says("serv", kLimit)) << segment->output() << segment->errors();
    Child master(cable.master_namespace(), {kSimpleIo, Cable::kMaster, "--cycles", "100000000", "--period", "2000"});
    ASSERT_TRUE(master.says("all slaves in OP", kLimit)) << master.output() << master.errors();
    // A new process acts as a segment after power-up: no station addresses, INIT.
    segment->terminate();
    EXPECT_EQ(segment->wait(kLimit), 0) << segment->errors();
    EXPECT_TRUE(master.says("no frame comes back from the segment", kLimit)) << master.output() << master.errors();
    segment = std::make_unique<Child>(cable.segment_namespace(),
                                      std::vector<std::string>{kVirtualSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(segment->says("serv", kLimit)) << segment->output() << segment->errors();
    for (int slave = 1; slave <= 5; ++slave)
        EXPECT_TRUE(master.says("slave " + std::to_string(slave) + ": recovered, in OP", kLimit))
            << master.output() << master.errors();
    EXPECT_TRUE(master.says("found again, in INIT, as after a loss of power", kLimit)) << master.output();
    EXPECT_TRUE(master.says("group 0: working counter right again", kLimit)) << master.output();
    // After a signal it prints its results and leaves the slaves in INIT.
    master.terminate();
    EXPECT_EQ(master.wait(kLimit), 1) << "cycles were lost";
    EXPECT_NE(master.output().find("slave 2 (8-channel digital input): 00"), std::string::npos) << master.output();
    EXPECT_TRUE(segment->says("slave 5 (setting): INIT", kLimit)) << segment->output();
}

}  // namespace
}  // namespace margay::process
