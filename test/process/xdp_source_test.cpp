// The SOURCEs xdp: and try-xdp: of the programs, over a cable to a second process with a simulated segment.
#include <places.hpp>
#include "netns.hpp"
#include "shell.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kBin = std::string(MARGAY_BIN_DIR) + "/";
const std::string kMaster = Cable::kMaster;
constexpr auto kLimit = 60s;

struct XdpSource : testing::Test {
    Cable cable;
    std::unique_ptr<Child> segment;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    }
    struct Result {
        int code;
        std::string output;
        std::string errors;
    };
    Result run(std::vector<std::string> arguments) const {
        if (!arguments.front().starts_with("/")) arguments.front() = kBin + arguments.front();
        Child child(cable.master_namespace(), arguments);
        const int code = child.wait(kLimit);
        return {code, child.output(), child.errors()};
    }
    // Executes a program without the capabilities that XDP needs, but with the capability that AF_PACKET needs.
    Result run_without_bpf(std::vector<std::string> arguments) const {
        arguments.front() = kBin + arguments.front();
        const std::string lost = "-bpf,-sys_admin,-net_admin";
        arguments.insert(arguments.begin(), {"/usr/bin/setpriv", "--bounding-set", lost, "--inh-caps", lost});
        return run(arguments);
    }
    void serve() {
        segment = std::make_unique<Child>(cable.segment_namespace(),
                                          std::vector<std::string>{kBin + "virtual_segment", Cable::kSegment, "demo"});
        ASSERT_TRUE(segment->says("serv", kLimit)) << segment->output() << segment->errors();
    }
    // True when the program was built with libxdp and libbpf.
    bool built_with_xdp() const {
        return !contains(run({"slaveinfo", "xdp:no-such-if"}).errors, "was built without AF_XDP");
    }
    std::string attached() const {
        std::string said;
        process::run("ip -n " + cable.master_namespace() + " -d link show dev " + kMaster, &said);
        return said;
    }
};

TEST_F(XdpSource, SlaveinfoShowsTheSameAsOnTheSimulation) {
    if (!built_with_xdp()) GTEST_SKIP() << "slaveinfo was built without libxdp and libbpf";
    serve();
    const auto simulated = run({"slaveinfo", "sim:demo"});
    ASSERT_EQ(simulated.code, 0) << simulated.errors;
    for (const auto* prefix : {"xdp:", "try-xdp:"}) {
        const auto shown = run({"slaveinfo", prefix + kMaster});
        EXPECT_EQ(shown.code, 0) << shown.errors;
        EXPECT_EQ(shown.errors, "") << "no remark: AF_XDP works here";
        EXPECT_EQ(shown.output, simulated.output) << prefix;
        EXPECT_FALSE(contains(attached(), "prog/xdp")) << "detached at the end: " << attached();
    }
}

TEST_F(XdpSource, SimpleIoRunsInOpOnXdp) {
    if (!built_with_xdp()) GTEST_SKIP() << "simple_io was built without libxdp and libbpf";
    serve();
    Child master(cable.master_namespace(),
                 {kBin + "simple_io", "xdp:" + kMaster, "--cycles", "100000000", "--period", "2000"});
    ASSERT_TRUE(master.says("all slaves in OP", kLimit)) << master.output() << master.errors();
    EXPECT_TRUE(contains(attached(), "prog/xdp")) << attached();
    master.terminate();
    EXPECT_GE(master.wait(kLimit), 0) << "it ends by itself after a signal";
    EXPECT_TRUE(contains(master.output(), "slave 2 (8-channel digital input): 00")) << master.output();
    EXPECT_TRUE(segment->says("slave 5 (setting): INIT", kLimit)) << segment->output();
    EXPECT_FALSE(contains(attached(), "prog/xdp")) << attached();
}

// simple_io prints this only for an interface, and the fixture of this file has an interface.
TEST_F(XdpSource, ASpinThatIsLongerThanACycleIsNamed) {
    serve();
    const auto ran = run({"simple_io", kMaster, "--cycles", "3", "--period", "4000", "--spin", "5000"});
    EXPECT_EQ(ran.errors, "simple_io: --spin 5000 is longer than a cycle allows; the program uses 4000 µs\n");
    EXPECT_EQ(run({"simple_io", kMaster, "--cycles", "3", "--period", "4000", "--spin", "100"}).errors, "");
}

TEST_F(XdpSource, IsRefusedWithoutPrivilegesAndNamesThem) {
    if (!std::filesystem::exists("/usr/bin/setpriv")) GTEST_SKIP() << "setpriv is not installed";
    if (!built_with_xdp()) GTEST_SKIP() << "slaveinfo was built without libxdp and libbpf";
    serve();
    const auto refused = run_without_bpf({"slaveinfo", "xdp:" + kMaster});
    EXPECT_EQ(refused.code, 3) << refused.errors;
    EXPECT_EQ(refused.output, "");
    EXPECT_TRUE(contains(refused.errors, "CAP_BPF, CAP_NET_ADMIN and CAP_NET_RAW are needed")) << refused.errors;
    EXPECT_TRUE(contains(refused.errors, "sudo setcap cap_bpf,cap_net_admin,cap_net_raw+ep ")) << refused.errors;
}

TEST_F(XdpSource, FallsBackToAfPacketWithARemarkOnlyWhenAsked) {
    if (!std::filesystem::exists("/usr/bin/setpriv")) GTEST_SKIP() << "setpriv is not installed";
    serve();
    const auto shown = run_without_bpf({"slaveinfo", "try-xdp:" + kMaster});
    EXPECT_EQ(shown.code, 0) << shown.errors;
    EXPECT_TRUE(shown.errors.starts_with("slaveinfo: interface " + kMaster + ": ")) << shown.errors;
    EXPECT_TRUE(shown.errors.ends_with("; continuing with AF_PACKET\n")) << shown.errors;
    EXPECT_EQ(shown.output, run({"slaveinfo", "sim:demo"}).output);
}

TEST_F(XdpSource, WhatIsWrongWithTheInterfaceIsNamed) {
    if (!built_with_xdp()) GTEST_SKIP() << "slaveinfo was built without libxdp and libbpf";
    for (const auto* prefix : {"xdp:", "try-xdp:"}) {
        const auto missing = run({"slaveinfo", std::string(prefix) + "no-such-if"});
        EXPECT_EQ(missing.code, 3);
        EXPECT_TRUE(contains(missing.errors, "there is no interface \"no-such-if\"")) << missing.errors;
        EXPECT_FALSE(contains(missing.errors, "AF_PACKET")) << "the sentence is there once: " << missing.errors;
        const auto nameless = run({"slaveinfo", prefix});
        EXPECT_EQ(nameless.code, 3);
        EXPECT_TRUE(contains(nameless.errors, "the name of the interface is missing")) << nameless.errors;
        const auto same = run({"slaveinfo", prefix + kMaster + "+" + kMaster});
        EXPECT_EQ(same.code, 3);
        EXPECT_TRUE(contains(same.errors, "both interfaces are the same, a ring needs two")) << same.errors;
    }
}

// Another program uses the interface.
TEST_F(XdpSource, AnInterfaceInUseByAnotherXdpProgramIsNamed) {
    if (!built_with_xdp()) GTEST_SKIP() << "slaveinfo was built without libxdp and libbpf";
    serve();
    Child first(cable.master_namespace(),
                {kBin + "simple_io", "xdp:" + kMaster, "--cycles", "100000000", "--period", "2000"});
    ASSERT_TRUE(first.says("all slaves in OP", kLimit)) << first.output() << first.errors();
    const auto second = run({"slaveinfo", "xdp:" + kMaster});
    EXPECT_EQ(second.code, 3);
    EXPECT_TRUE(contains(second.errors, "another XDP program is attached to it")) << second.errors;
    EXPECT_FALSE(first.ended());
}

// AF_XDP at both ends of a ring, then AF_XDP at one end and AF_PACKET at the other end.
TEST_F(XdpSource, OpensBothEndsOfARing) {
    if (!built_with_xdp()) GTEST_SKIP() << "slaveinfo was built without libxdp and libbpf";
    const std::string master = cable.master_namespace();
    ASSERT_TRUE(cable.ip(master, "link add ring-m type veth peer name ring-s netns " + cable.segment_namespace()));
    ASSERT_TRUE(cable.ip(master, "link set ring-m up"));
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ring-s up"));
    const std::string ring = std::string(MARGAY_SOURCE_DIR) + "/test/compat/ring.toml";
    segment = std::make_unique<Child>(
        cable.segment_namespace(),
        std::vector<std::string>{kBin + "virtual_segment", std::string(Cable::kSegment) + "+ring-s", ring});
    ASSERT_TRUE(segment->says("serv", kLimit)) << segment->output() << segment->errors();
    const auto plain = run({"slaveinfo", kMaster + "+ring-m"});
    ASSERT_EQ(plain.code, 0) << plain.errors;
    EXPECT_TRUE(contains(plain.output, "slaves found")) << plain.output;
    for (const auto& source : {"xdp:" + kMaster + "+xdp:ring-m", "xdp:" + kMaster + "+ring-m"}) {
        const auto shown = run({"slaveinfo", source});
        EXPECT_EQ(shown.code, 0) << source << ": " << shown.errors;
        EXPECT_EQ(shown.errors, "") << source;
        EXPECT_EQ(shown.output, plain.output) << source;
    }
}

}  // namespace
}  // namespace margay::process
