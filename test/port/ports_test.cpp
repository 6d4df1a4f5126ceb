// The ports of this project pass the suite.
#include "port/host.hpp"
#include "process/netns.hpp"

#include <margay/parts/osal/posix/posix_osal.hpp>
#include <margay/parts/osal/virtual/virtual_osal.hpp>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace margay::port {
namespace {

using Names = std::vector<std::string>;
using process::Cable;

TEST(Ports, LinuxOsalPasses) {
    Host host;
    LinuxOsal osal;
    const auto verdict = check_port(host.port(osal));
    EXPECT_EQ(verdict.failed, 0u) << host.text();
    EXPECT_EQ(verdict.skipped, 0u) << host.text();
    EXPECT_EQ(verdict.passed, 17u);
}

TEST(Ports, PosixOsalPasses) {
    Host host;
    PosixOsal osal;
    const auto verdict = check_port(host.port(osal));
    EXPECT_EQ(verdict.failed, 0u) << host.text();
    EXPECT_EQ(verdict.skipped, 0u) << host.text();
    EXPECT_EQ(verdict.passed, 17u);
}

// The pipe and the socket have large numbers in a program with many open files.
TEST(Ports, PosixOsalPassesWithFileDescriptorsBeyondSelect) {
    rlimit old{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &old), 0);
    rlimit more = old;
    more.rlim_cur = std::min<rlim_t>(old.rlim_max, 4096);
    if (more.rlim_cur < FD_SETSIZE + 10) GTEST_SKIP() << "the limit of open files is " << old.rlim_max;
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &more), 0);
    std::vector<int> taken;
    while (taken.empty() || taken.back() < FD_SETSIZE) taken.push_back(::dup(0));
    {
        Host host;
        PosixOsal osal;
        EXPECT_EQ(check_port(host.port(osal)).failed, 0u) << host.text();
    }
    for (const int one : taken) ::close(one);
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &old), 0);
}

TEST(Ports, PosixOsalWithoutAFreeFileDescriptorPassesAllButWake) {
    rlimit old{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &old), 0);
    rlimit none = old;
    none.rlim_cur = 0;
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
    PosixOsal osal;
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &old), 0);
    Host host;
    const auto verdict = check_port(host.port(osal));
    // Each wait() lasts at most 1 ms, so a lost wake() delays by at most 1 ms.
    EXPECT_EQ(verdict.failed, 0u) << host.text();
}

// A signal handler may call this function.
TEST(Ports, WakeKeepsErrno) {
    PosixOsal osal;
    errno = ENOENT;
    for (unsigned n = 0; n < 100'000; ++n) osal.wake();  // more than a pipe takes
    EXPECT_EQ(errno, ENOENT);
}

TEST(Ports, VirtualOsalAndSimulatedNicPass) {
    Host host;
    VirtualOsal osal;
    sim::Segment segment;
    put_slave_into(segment, osal.now());
    SimulatedNic nic(segment, osal);
    auto port = host.without_threads(osal, &nic);
    struct Bench {
        Host& host;
        sim::Segment& segment;
    } bench{host, segment};
    port.user = &bench;
    port.print = [](void* user, std::string_view line) { static_cast<Bench*>(user)->host.lines.emplace_back(line); };
    port.plug = [](void* user, bool in) { static_cast<Bench*>(user)->segment.set_cable({0, 0}, in); };
    const auto verdict = check_port(port);
    EXPECT_EQ(verdict.failed, 0u) << host.text();
    EXPECT_EQ(verdict.passed, 26u) << host.text();
    // In virtual time there is one thread and no other clock.
    EXPECT_EQ(host.skipped(),
              (Names{"now() counts at the rate of a second clock", "wake() ends one wait(), not all later ones",
                     "wake() ends a wait()", "wake() before a wait() ends it", "wake() ends a wait() without a limit",
                     "wake_sleepers() ends a sleep", "wake_sleepers() ends the sleep of all threads",
                     "threads have different numbers", "now() is right when two threads call it",
                     "wake_sleepers() ends a sleep without a limit", "wake() ends a wait() for the NIC"}));
}

// For a NIC that has these times, the suite also checks "sent at", "received at" and "send at".
TEST(Ports, ASimulatedNicWithTimesPasses) {
    Host host;
    VirtualOsal osal;
    sim::Segment segment;
    put_slave_into(segment, osal.now());
    SimulatedNic nic(segment, osal,
                     {.wire_time = true, .time_stamps = true, .clock_drift_ppb = 100'000, .timed_frames = 4});
    const auto verdict = check_port(host.without_threads(osal, &nic));
    EXPECT_EQ(verdict.failed, 0u) << host.text();
    EXPECT_EQ(verdict.passed, 25u + 7u) << host.text();
}

// The port of Linux with a real interface: a veth pair in namespaces of the test.
struct PortsOnCable : testing::Test {
    Cable cable;
    PacketNic master;
    PacketNic far;
    Host host;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        Cable::inside(cable.master_namespace(),
                      [&] { ASSERT_TRUE(master.open(Cable::kMaster).ok()) << master.problem(); });
        Cable::inside(cable.segment_namespace(),
                      [&] { ASSERT_TRUE(far.open(Cable::kSegment, PacketNic::Side::segment).ok()) << far.problem(); });
    }
    void expect_pass(Osal& osal, unsigned checks = 37) {
        SlaveOnCable slave(far);
        struct Bench : Host {
            Cable* cable = nullptr;
        } bench;
        bench.cable = &cable;
        auto port = bench.port(osal, &master);
        port.plug = [](void* user, bool in) {
            const auto& all = *static_cast<Bench*>(static_cast<Host*>(user))->cable;
            all.ip(all.segment_namespace(), std::string("link set ") + Cable::kSegment + (in ? " up" : " down"));
        };
        port.longest_call = std::chrono::milliseconds(1);  // system calls on a busy machine
        const auto verdict = check_port(port);
        EXPECT_EQ(verdict.failed, 0u) << bench.text();
        EXPECT_EQ(verdict.skipped, 0u) << bench.text();
        EXPECT_EQ(verdict.passed, checks);
    }
};

TEST_F(PortsOnCable, LinuxOsalAndPacketNicPass) {
    LinuxOsal osal;
    expect_pass(osal);
}

TEST_F(PortsOnCable, PacketNicWithTimeStampsPasses) {
    LinuxOsal osal;
    ASSERT_TRUE(master.stamp_frames(PacketNic::Stamps::software, PacketNic::Stamped::both).ok()) << master.problem();
    expect_pass(osal, 37 + 4);
}

TEST_F(PortsOnCable, PosixOsalAndPacketNicPass) {
    PosixOsal osal;
    expect_pass(osal);
}

}  // namespace
}  // namespace margay::port
