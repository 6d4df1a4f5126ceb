// The library on a Cortex-M4 with a LAN9118, without a system and on FreeRTOS: QEMU's board mps2-an386.
#include "qemu/machine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <string>
#include <thread>

namespace margay::qemu {
namespace {

using namespace std::chrono_literals;

const std::string kBuild = "embedded_arm_builds/";

// The work of an application from the scan to a loss of power. Each step waits for its outcome, so a slow machine does
// not matter.
void expect_whole_way(const std::string& image_name) {
    Machine machine(image_name);
    if (!machine.missing().empty()) GTEST_SKIP() << machine.missing();

    ASSERT_TRUE(machine.says("4 slaves, ")) << machine.report();
    ASSERT_TRUE(machine.says("all slaves are in OP")) << machine.report();
    ASSERT_TRUE(machine.segment().says("slave 4 (drive): OP", 10s)) << machine.report();
    ASSERT_TRUE(machine.says("slave 4: vendor 0x")) << machine.report();

    // The program prints inputs that change.
    machine.tell_segment("set inputs 0 0x5a");
    ASSERT_TRUE(machine.says(": all right, first input 90")) << machine.report();
    machine.tell_segment("set inputs 0 0x11");
    ASSERT_TRUE(machine.says(": all right, first input 17")) << machine.report();

    // Two losses of power. After each one, the state, the process data and the SDOs are as before.
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
// A Cortex-M4 also executes the code of a Cortex-M0+. The atomic operations of this code block interrupts.
TEST(Mps2, AMasterCompiledForArmv6MGoesTheWholeWay) { expect_whole_way("embedded_cortex_m0plus_builds/master"); }

// The conformance suite on the board. When the suite asks for the cable to be pulled out, QEMU's monitor sets the link
// down.
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
    // bench_cycle counts the instructions on x86-64. The upper limit detects a larger number, with some tolerance.
    EXPECT_GT(instructions, 100u) << "something was left out";
    EXPECT_LT(instructions, 600u) << line;
}

// Returns the address of a symbol of the linker script, or 0 when arm-none-eabi-nm or the symbol is missing.
std::uint32_t address_of(const std::string& symbol, const std::string& image_name) {
    std::string symbols;
    (void)process::run("arm-none-eabi-nm " + image(image_name).string(), &symbols);
    const auto at = symbols.find(" B " + symbol + "\n");
    const auto with_data = at == std::string::npos ? symbols.find(" D " + symbol + "\n") : at;
    return with_data == std::string::npos || with_data < 8
               ? 0
               : static_cast<std::uint32_t>(std::stoul(symbols.substr(with_data - 8, 8), nullptr, 16));
}

// The program for SDO reading of test/embedded/sizes: 8 slaves, 24 KiB of RAM with the stack. The memory above .bss is
// zero at the start, and only the stack writes to it. An interrupt at the deepest place needs additional octets.
TEST(Mps2, TheProgramForSdoReadingNeeds24KibWithItsStack) {
    const std::string name = kBuild + "sdo";
    Machine machine(name);
    if (!machine.missing().empty()) GTEST_SKIP() << machine.missing();
    const auto data_begin = address_of("data_begin", name);
    const auto bss_end = address_of("bss_end", name);
    const auto stack_top = address_of("stack_top", name);
    ASSERT_TRUE(data_begin < bss_end && bss_end < stack_top) << "no symbols by arm-none-eabi-nm";
    std::size_t stack = 0;
    const auto measure = [&](const std::string& when) {
        const auto all = machine.memory(bss_end, stack_top - bss_end);
        ASSERT_EQ(all.size(), stack_top - bss_end) << machine.report();
        stack = std::max(stack, all.size() - std::min(all.find_first_not_of('\0'), all.size()));
        std::cout << when << ": " << stack << " octets of stack were in use\n";
    };

    ASSERT_TRUE(machine.segment().says("slave 4 (drive): OP", 120s)) << machine.report();
    std::this_thread::sleep_for(2s);  // the time for the SDO
    measure("after the bring-up and an SDO");
    for (const auto* slave : {"4", "2"}) {
        machine.tell_segment(std::string("power off ") + slave);
        std::this_thread::sleep_for(500ms);
        machine.tell_segment(std::string("power on ") + slave);
        std::this_thread::sleep_for(1s);
    }
    measure("after losses of power");
    machine.tell_segment("drop 0.2");
    std::this_thread::sleep_for(2s);
    measure("with lost frames");

    const auto ram = bss_end - data_begin;
    std::cout << "SDO reading: " << ram << " octets of RAM and " << stack << " of stack: " << ram + stack << "\n";
    EXPECT_GT(stack, 1000U) << "the program has not run";
    EXPECT_LE(ram + stack, 24U * 1024);
}

}  // namespace
}  // namespace margay::qemu
