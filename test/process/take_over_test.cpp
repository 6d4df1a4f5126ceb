// Slaves under another master: the programs read before they write, and continue only with --take-over.
#include <places.hpp>
#include "netns.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kBin = std::string(MARGAY_BIN_DIR) + "/";
constexpr auto kLimit = 60s;

struct TakeOver : testing::Test {
    Cable cable;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    }
    struct Result {
        int code;
        std::string output;
        std::string errors;
    };
    Result run(std::vector<std::string> arguments) {
        arguments[0] = kBin + arguments[0];
        Child child(cable.master_namespace(), arguments);
        const int code = child.wait(kLimit);
        return {code, child.output(), child.errors()};
    }
};

TEST_F(TakeOver, ASegmentInOpIsLeftToItsMaster) {
    Child segment(cable.segment_namespace(), {kBin + "virtual_segment", Cable::kSegment, "demo"});
    ASSERT_TRUE(segment.says("serving", kLimit)) << segment.errors();
    Child master(cable.master_namespace(),
                 {kBin + "simple_io", Cable::kMaster, "--cycles", "100000000", "--period", "2000"});
    ASSERT_TRUE(master.says("all slaves in OP", kLimit)) << master.output() << master.errors();
    const auto before = segment.output().size();
    const std::vector<std::vector<std::string>> programs = {
        {"slaveinfo", Cable::kMaster},
        {"slaveinfo", Cable::kMaster, "--json"},
        {"simple_io", Cable::kMaster, "--cycles", "10"},
        {"segment_monitor", Cable::kMaster, "--plain", "--cycles", "10"},
        {"eepromtool", Cable::kMaster, "1", "dump"}};
    for (const auto& program : programs) {
        const auto ran = run(program);
        EXPECT_EQ(ran.code, 1) << program[0] << ran.errors;
        EXPECT_EQ(ran.output, "") << program[0];
        EXPECT_NE(ran.errors.find("slaves of this segment are in SAFEOP or OP (5 slaves answer)"), std::string::npos)
            << ran.errors;
        EXPECT_NE(ran.errors.find("--take-over"), std::string::npos) << ran.errors;
    }
    EXPECT_EQ(segment.output().substr(before).find(": INIT"), std::string::npos) << segment.output().substr(before);
    const auto taken = run({"slaveinfo", Cable::kMaster, "--take-over"});
    EXPECT_EQ(taken.output.substr(0, 15), "5 slaves found\n") << taken.errors;
    EXPECT_TRUE(segment.says("slave 1 (coupler): INIT", kLimit)) << segment.output();
    master.terminate();
    (void)master.wait(kLimit);
}

}  // namespace
}  // namespace margay::process
