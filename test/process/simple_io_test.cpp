// The program simple_io, over a cable to a second process with a simulated segment, which then loses its power.
#include <places.hpp>
#include "netns.hpp"
#include "shell.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kSimpleIo = std::string(MARGAY_BIN_DIR) + "/simple_io";
const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
constexpr auto kLimit = 60s;

// The outputs of a slave as simple_io prints them at its end: " 00 00 …".
std::string outputs_of(const std::string& text, int slave) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        const auto at = line.find(") outputs:");
        if (line.starts_with("slave " + std::to_string(slave) + " (") && at != std::string::npos)
            return line.substr(at + std::string(") outputs:").size());
    }
    return "none";
}

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

// A counter in the control word of a drive switches the drive on and moves it.
TEST(SimpleIo, LeavesAllOutputsAtZeroUnlessACounterIsAskedFor) {
    const ShellFolder folder;
    const auto plain = folder.run(kSimpleIo + " sim:drives --cycles 5000");
    EXPECT_EQ(plain.status, 0) << plain.err;
    EXPECT_EQ(outputs_of(plain.out, 1).find_first_not_of(" 0"), std::string::npos) << plain.out;
    EXPECT_EQ(outputs_of(plain.out, 5).find_first_not_of(" 0"), std::string::npos) << plain.out;
    EXPECT_TRUE(contains(plain.out, "slave 1 (Servo drive): 50 02 ")) << "switch on disabled: " << plain.out;
}

TEST(SimpleIo, CountsInTheOutputsThatAreNoDrivesAndNamesTheDrives) {
    const ShellFolder folder;
    const auto counted = folder.run(kSimpleIo + " sim:drives --cycles 5000 --count");
    EXPECT_EQ(counted.status, 0) << counted.err;
    for (int slave = 1; slave <= 4; ++slave) {
        EXPECT_TRUE(contains(counted.out, "slave " + std::to_string(slave) +
                                              " (Servo drive): a drive (device profile 402): its outputs stay 0 "
                                              "(--drives-too includes it)\n"))
            << counted.out;
        EXPECT_EQ(outputs_of(counted.out, slave).find_first_not_of(" 0"), std::string::npos) << counted.out;
    }
    EXPECT_TRUE(contains(counted.out, "slave 1 (Servo drive): 50 02 ")) << "switch on disabled: " << counted.out;
    EXPECT_TRUE(outputs_of(counted.out, 5).starts_with(" 4e 4e")) << "4999 / 64: " << counted.out;

    const auto all = folder.run(kSimpleIo + " sim:drives --cycles 5000 --count --drives-too");
    EXPECT_TRUE(outputs_of(all.out, 1).starts_with(" 4e 4e")) << all.out;
    EXPECT_FALSE(contains(all.out, "its outputs stay 0")) << all.out;
    EXPECT_EQ(folder.run(kSimpleIo + " sim:drives --cycles 10 --drives-too").status, 2) << "without --count";
    EXPECT_TRUE(contains(folder.run(kSimpleIo + " --help").out, "DANGER")) << "the help warns";
}

TEST(SimpleIo, DoesNotMistakeTerminalsForDrives) {
    const ShellFolder folder;
    const auto counted = folder.run(kSimpleIo + " sim:demo --cycles 1000 --count");
    EXPECT_FALSE(contains(counted.out, "its outputs stay 0")) << counted.out;
    EXPECT_EQ(outputs_of(counted.out, 3), " 0f") << "an output terminal with object 0x7040:1: " << counted.out;
}

TEST(SimpleIo, LeavesSoeDrivesAlone) {
    const ShellFolder folder;
    const auto counted = folder.run(kSimpleIo + " sim:servodrives --cycles 1000 --count");
    EXPECT_TRUE(contains(counted.out, ": a drive (SoE): its outputs stay 0")) << counted.out << counted.err;
}

}  // namespace
}  // namespace margay::process
