// The program simple_io, over a cable to a second process with a simulated segment, which then loses its power.
#include <places.hpp>
#include "netns.hpp"
#include "shell.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

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
    // After a signal, simple_io prints its results and leaves the slaves in INIT.
    master.terminate();
    EXPECT_EQ(master.wait(kLimit), 1) << "cycles were lost";
    EXPECT_NE(master.output().find("slave 2 (8-channel digital input): 00"), std::string::npos) << master.output();
    EXPECT_TRUE(segment->says("slave 5 (setting): INIT", kLimit)) << segment->output();
}

// The NIC of a simulated segment has all time stamps, and they are exact.
TEST(SimpleIo, FramesLeaveAtTheirTimeInTheCycle) {
    const ShellFolder folder;
    const auto ran =
        folder.run(kSimpleIo + " sim:demo --cycles 200 --send-at 300 --stamps hardware --histogram times.json");
    EXPECT_EQ(ran.status, 0) << ran.err << ran.out;
    const auto json = nlohmann::json::parse(content_of(folder.path() / "times.json"));
    EXPECT_EQ(json["wire_period_ns"]["count"], 199);
    EXPECT_EQ(json["wire_period_ns"]["min"], 1'000'000);
    EXPECT_EQ(json["wire_period_ns"]["max"], 1'000'000);
    EXPECT_EQ(json["wire_round_trip_ns"]["count"], 200);
    EXPECT_GE(json["received_ns"]["min"], 300'000) << "after the beginning of the cycle";
    EXPECT_GT(json["wire_round_trip_ns"]["min"], 0);
    EXPECT_LT(json["wire_round_trip_ns"]["max"], json["received_ns"]["min"].get<int>() - 300'000) << "without the host";
    EXPECT_FALSE(json.contains("not_sent_at_their_time"));
    EXPECT_FALSE(json.contains("without_stamps"));
    const auto at_once = folder.run(kSimpleIo + " sim:demo --cycles 200 --histogram plain.json");
    EXPECT_EQ(at_once.status, 0) << at_once.err;
    const auto plain = nlohmann::json::parse(content_of(folder.path() / "plain.json"));
    EXPECT_LT(plain["received_ns"]["max"], 300'000);
    EXPECT_FALSE(plain.contains("wire_period_ns"));
    EXPECT_EQ(folder.run(kSimpleIo + " sim:demo --send-at 2000").status, 2);
    EXPECT_EQ(folder.run(kSimpleIo + " sim:demo --stamps exact").status, 2);
}

// A veth pair has time stamps of the kernel. This kernel may lack a queueing discipline that holds frames.
TEST(SimpleIo, TimesOfFramesOverACable) {
    const Cable cable;
    if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
    Child segment(cable.segment_namespace(), {kVirtualSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(segment.says("serv", kLimit)) << segment.output() << segment.errors();
    const ShellFolder folder;
    const auto run = [&](const std::string& arguments) {
        return folder.run("ip netns exec " + cable.master_namespace() + " " + kSimpleIo + " " + Cable::kMaster +
                          " --cycles 50 --period 5000 " + arguments);
    };
    const auto stamped = run("--stamps software --histogram times.json");
    EXPECT_NE(stamped.status, 3) << stamped.err;
    EXPECT_TRUE(contains(stamped.out, "round trip on the wire, by the NIC: min ")) << stamped.out << stamped.err;
    const auto json = nlohmann::json::parse(content_of(folder.path() / "times.json"));
    EXPECT_GE(json["wire_round_trip_ns"]["count"], 40);
    EXPECT_LE(json["wire_round_trip_ns"]["min"], json["round_trip_ns"]["max"]);
    const auto hardware = run("--stamps hardware");
    EXPECT_EQ(hardware.status, 3);
    EXPECT_TRUE(contains(hardware.err, "its driver has no hardware time stamps")) << hardware.err;
    const auto timed = run("--send-at 1000");
    if (timed.status == 3) {
        EXPECT_TRUE(contains(timed.err, "no frame can leave at a time by its queueing discipline")) << timed.err;
        EXPECT_TRUE(contains(timed.err, "mend it with: tc qdisc replace dev")) << timed.err;
    } else {
        EXPECT_LE(timed.status, 1) << timed.err;  // a cycle may be lost on a busy machine
        EXPECT_TRUE(contains(timed.out, "all slaves in OP")) << timed.out << timed.err;
    }
    const auto by_xdp = folder.run("ip netns exec " + cable.master_namespace() + " " + kSimpleIo +
                                   " xdp:" + Cable::kMaster + " --stamps software");
    EXPECT_EQ(by_xdp.status, 3);
    EXPECT_TRUE(contains(by_xdp.err, "AF_XDP has no times of frames")) << by_xdp.err;
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
