// The library on a Cortex-M4 with a LAN9118, without a system and on FreeRTOS: QEMU's board mps2-an386.
#include "qemu/machine.hpp"

#include <gtest/gtest.h>

#include <iostream>
#include <string>

namespace margay::qemu {
namespace {

using namespace std::chrono_literals;

const std::string kBuild = "embedded_arm_builds/";

// The whole way of an application. Each step ends with its outcome, however slow the machine is.
void expect_whole_way(const std::string& image_name) {
    Machine machine(image_name);
    if (!machine.missing().empty()) GTEST_SKIP() << machine.missing();

    ASSERT_TRUE(machine.says("4 slaves, ")) << machine.report();
    ASSERT_TRUE(machine.says("all slaves are in OP")) << machine.report();
    ASSERT_TRUE(machine.segment().says("slave 4 (drive): OP", 10s)) << machine.report();
    ASSERT_TRUE(machine.says("slave 4: vendor 0x")) << machine.report();

    // Process data both ways.
    machine.tell_segment("set inputs 0 0x5a");
    ASSERT_TRUE(machine.says(": all right, first input 90")) << machine.report();
    machine.tell_segment("set inputs 0 0x11");
    ASSERT_TRUE(machine.says(": all right, first input 17")) << machine.report();

    // A loss of power, twice. Afterwards all is as before: the state, the process data and the SDOs.
    for (unsigned n = 0; n < 2; ++n) {
        machine.tell_segment("power off 4");
        ASSERT_TRUE(machine.says("event: slave 4: lost")) << machine.report();
        ASSERT_TRUE(machine.says(": not all right")) << machine.report();
        machine.tell_segment("power on 4");
        ASSERT_TRUE(machine.says("event: slave 4: recovered, in OP")) << machine.report();
        ASSERT_TRUE(machine.says(": all right, first input 17")) << machine.report();
        ASSERT_TRUE(machine.says("slave 4: vendor 0x")) << machine.report();
    }
    EXPECT_EQ(machine.uart().find("ended"), std::string::npos) << machine.report();
}

TEST(Mps2, AMasterWithoutASystemGoesTheWholeWay) { expect_whole_way(kBuild + "master"); }
TEST(Mps2, AMasterInTwoTasksOfFreertosGoesTheWholeWay) { expect_whole_way(kBuild + "master_freertos"); }
// A Cortex-M4 executes the code of a Cortex-M0+, whose atomic operations block interrupts.
TEST(Mps2, AMasterCompiledForArmv6MGoesTheWholeWay) { expect_whole_way("embedded_cortex_m0plus_builds/master"); }

// The conformance suite on the board. Where it asks for the cable, QEMU's monitor unplugs it.
void expect_port_passes(const std::string& image_name, const std::string& verdict) {
    Machine machine(kBuild + image_name);
    if (!machine.missing().empty()) GTEST_SKIP() << machine.missing();
    ASSERT_TRUE(machine.says("please pull out the cable")) << machine.report();
    machine.tell_qemu("set_link net0 off");
    ASSERT_TRUE(machine.says("please connect the cable")) << machine.report();
    machine.tell_qemu("set_link net0 on");
    ASSERT_TRUE(machine.says("ok    link_state() follows the cable")) << machine.report();
    EXPECT_TRUE(machine.says(verdict)) << machine.report();
    EXPECT_TRUE(machine.says("the port passes")) << machine.report();
}

TEST(Mps2, OsalBareAndLan9118PassTheSuite) { expect_port_passes("check_port", "32 passed, 0 failed, 5 skipped"); }
TEST(Mps2, OsalFreertosAndLan9118PassTheSuite) {
    expect_port_passes("check_port_freertos", "37 passed, 0 failed, 0 skipped");
}

TEST(Mps2, TheInstructionsOfACycleAreCounted) {
    Machine machine(kBuild + "count_cycle", "-icount shift=0");
    if (!machine.missing().empty()) GTEST_SKIP() << machine.missing();
    ASSERT_TRUE(machine.says("instructions of a cycle: ")) << machine.report();
    ASSERT_TRUE(machine.says("\n")) << machine.report();
    const auto all = machine.uart();
    const auto line = all.substr(all.find("instructions of a cycle: "));
    const auto instructions = std::stoul(line.substr(line.find(": ") + 2));
    std::cout << "Cortex-M4, -Os: " << line;
    // Those of x86-64: bench_cycle. A limit with some room keeps it from growing.
    EXPECT_GT(instructions, 100u) << "something was left out";
    EXPECT_LT(instructions, 600u) << line;
}

}  // namespace
}  // namespace margay::qemu
