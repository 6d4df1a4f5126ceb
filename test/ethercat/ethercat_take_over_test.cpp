// ethercat on an interface: it reads the states before it writes anything, and leaves a segment in OP to its master.
#include "ethercat/ethercat_fixture.hpp"
#include "process/netns.hpp"

namespace margay::process {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 60s;

TEST(EthercatTakeOver, ASegmentInOpIsLeftToItsMaster) {
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";
    Cable cable;
    if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    const auto run = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), bin + "ethercat");
        Child child(cable.master_namespace(), arguments);
        const int status = child.wait(kPatience);
        return Ran{status, child.output(), child.errors()};
    };
    Child segment(cable.segment_namespace(), {bin + "virtual_segment", Cable::kSegment, "demo"});
    ASSERT_TRUE(segment.says("serving", kPatience)) << segment.errors();
    const auto first = run({"slaves", "-S", Cable::kMaster});
    EXPECT_EQ(first.status, 0) << first.err;
    EXPECT_TRUE(first.out.starts_with("0  0:0  PREOP  +  EtherCAT coupler\n")) << first.out;

    Child master(cable.master_namespace(),
                 {bin + "simple_io", Cable::kMaster, "--cycles", "100000000", "--period", "2000"});
    ASSERT_TRUE(master.says("all slaves in OP", kPatience)) << master.output() << master.errors();
    const auto before = segment.output().size();
    for (const std::vector<std::string>& command : {std::vector<std::string>{"slaves"},
                                                    {"states", "INIT"},
                                                    {"reg_write", "-p", "0", "-t", "uint8", "0xF80", "1"},
                                                    {"domains"},
                                                    {"rescan"}}) {
        auto words = command;
        words.insert(words.end(), {"--source", Cable::kMaster});
        const auto ran = run(words);
        EXPECT_EQ(ran.status, 1) << command[0];
        EXPECT_EQ(ran.out, "") << command[0];
        EXPECT_TRUE(contains(ran.err, "slaves of this segment are in SAFEOP or OP (5 slaves answer)")) << ran.err;
    }
    EXPECT_FALSE(contains(segment.output().substr(before), ": INIT")) << segment.output().substr(before);
    const auto taken = run({"slaves", "-S", Cable::kMaster, "--take-over"});
    EXPECT_TRUE(contains(taken.out, "EtherCAT coupler")) << taken.err;
    EXPECT_TRUE(segment.says("slave 1 (coupler): INIT", kPatience)) << segment.output();
    master.terminate();
    (void)master.wait(kPatience);
}

}  // namespace
}  // namespace margay::process
