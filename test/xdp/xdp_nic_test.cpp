// The AF_XDP NIC on a veth pair in network namespaces of the test.
#include "port/host.hpp"
#include "process/netns.hpp"

#include <margay/parts/oshw/xdp/xdp_nic.hpp>
#include <margay/parts/wire/ethernet.hpp>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

namespace margay {
namespace {

using process::Cable;
using Mode = XdpNic::Mode;
using Frame = std::vector<std::byte>;

// `type`: the EtherType, with the VLAN tag before it for a frame in a VLAN.
Frame frame_of(std::initializer_list<unsigned> type, unsigned mark, std::size_t bytes = 60) {
    Frame frame(12, std::byte{0xFF});
    frame[6] = std::byte{0x02};
    for (const unsigned octet : type) frame.push_back(static_cast<std::byte>(octet));
    frame.push_back(static_cast<std::byte>(mark));
    frame.resize(bytes);
    return frame;
}

class Xdp : public testing::Test {
  protected:
    Cable cable;
    PacketNic far;
    XdpNic nic;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        Cable::inside(cable.segment_namespace(),
                      [&] { ASSERT_TRUE(far.open(Cable::kSegment, PacketNic::Side::segment).ok()) << far.problem(); });
    }
    Result<> open(XdpNic& which, const XdpNic::Settings& settings = {}) {
        Result<> done = Error{};
        Cable::inside(cable.master_namespace(), [&] { done = which.open(Cable::kMaster, settings); });
        return done;
    }
    // Waits for a frame.
    static Frame next(Nic& from, int milliseconds = 1000) {
        Frame frame(2000);
        for (int n = 0; n < 2; ++n) {
            if (const auto length = from.receive(frame); length != 0) {
                frame.resize(length);
                return frame;
            }
            pollfd waiting{from.wait_handle(), POLLIN, 0};
            (void)::poll(&waiting, 1, milliseconds);
        }
        return {};
    }
    std::string link() {
        std::string said;
        process::run("ip -n " + cable.master_namespace() + " -d link show dev " + Cable::kMaster, &said);
        return said;
    }
};

class XdpModes : public Xdp, public testing::WithParamInterface<Mode> {};

TEST_P(XdpModes, FramesOfEverySizeGoBothWays) {
    ASSERT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
    EXPECT_EQ(nic.mode(), GetParam());
    for (const std::size_t bytes : {60U, 61U, 64U, 500U, 1513U, 1514U}) {
        const Frame out = frame_of({0x88, 0xA4}, 1, bytes);
        ASSERT_EQ(nic.send(out), SendStatus::sent) << bytes;
        EXPECT_EQ(next(far), out) << bytes;
        const Frame in = frame_of({0x88, 0xA4}, 2, bytes);
        ASSERT_EQ(far.send(in), SendStatus::sent) << bytes;
        EXPECT_EQ(next(nic), in) << bytes;
    }
    // More frames than there are chunks for sending, and more than the receive ring has.
    for (unsigned n = 0; n < 1000; ++n) {
        ASSERT_EQ(nic.send(frame_of({0x88, 0xA4}, n)), SendStatus::sent) << n;
        ASSERT_EQ(next(far), frame_of({0x88, 0xA4}, n)) << n;
        ASSERT_EQ(far.send(frame_of({0x88, 0xA4}, n + 1)), SendStatus::sent) << n;
        ASSERT_EQ(next(nic), frame_of({0x88, 0xA4}, n + 1)) << n;
    }
    EXPECT_EQ(nic.overruns(), 0U);
}

TEST_P(XdpModes, AShortFrameIsPadded) {
    ASSERT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
    ASSERT_EQ(nic.send(frame_of({0x88, 0xA4}, 7, 30)), SendStatus::sent);
    EXPECT_EQ(next(far), frame_of({0x88, 0xA4}, 7, 60));
}

TEST_P(XdpModes, ATaggedFrameComesWithoutItsTag) {
    ASSERT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
    ASSERT_EQ(far.send(frame_of({0x81, 0x00, 0x00, 0x05, 0x88, 0xA4}, 9, 64)), SendStatus::sent);
    EXPECT_EQ(next(nic), frame_of({0x88, 0xA4}, 9, 60));
}

TEST_P(XdpModes, OtherFramesGoOnToTheSystem) {
    int other = -1;
    Cable::inside(cable.master_namespace(), [&] {
        other = ::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, htons(0x88B5));
        sockaddr_ll address{};
        address.sll_family = AF_PACKET;
        address.sll_protocol = htons(0x88B5);
        address.sll_ifindex = static_cast<int>(::if_nametoindex(Cable::kMaster));
        ASSERT_EQ(::bind(other, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    });
    ASSERT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
    const Frame frame = frame_of({0x88, 0xB5}, 3);
    ASSERT_EQ(far.send(frame), SendStatus::sent);
    pollfd waiting{other, POLLIN, 0};
    EXPECT_EQ(::poll(&waiting, 1, 1000), 1);
    Frame got(100);
    EXPECT_EQ(::recv(other, got.data(), got.size(), 0), static_cast<ssize_t>(frame.size()));
    EXPECT_EQ(next(nic, 20), Frame());
    ::close(other);
}

TEST_P(XdpModes, TheProgramIsGoneAfterClose) {
    ASSERT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
    EXPECT_NE(link().find("prog/xdp"), std::string::npos) << link();
    nic.close();
    EXPECT_EQ(link().find("prog/xdp"), std::string::npos) << link();
    EXPECT_EQ(nic.send(frame_of({0x88, 0xA4}, 1)), SendStatus::failed);
    EXPECT_EQ(nic.receive({}), 0U);
    EXPECT_TRUE(open(nic, {.mode = GetParam()}).ok()) << nic.problem();
}

TEST_P(XdpModes, TheProgramIsGoneAfterTheProcessWasKilled) {
    std::array<int, 2> opened{};
    ASSERT_EQ(::pipe(opened.data()), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        XdpNic own;
        const bool good = open(own, {.mode = GetParam()}).ok();
        (void)!::write(opened[1], good ? "y" : "n", 1);
        for (;;) ::pause();
    }
    char answer = 0;
    ASSERT_EQ(::read(opened[0], &answer, 1), 1);
    EXPECT_EQ(answer, 'y');
    EXPECT_NE(link().find("prog/xdp"), std::string::npos) << link();
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    ::close(opened[0]);
    ::close(opened[1]);
    // The kernel frees the socket a moment after the process.
    bool gone = false;
    for (int n = 0; n < 200 && !gone; ++n) {
        gone = link().find("prog/xdp") == std::string::npos;
        if (!gone) ::usleep(10'000);
    }
    EXPECT_TRUE(gone) << link();
}

INSTANTIATE_TEST_SUITE_P(Modes, XdpModes, testing::Values(Mode::copy, Mode::generic),
                         [](const auto& mode) { return std::string(to_text(mode.param)); });

// ------------------------------------------------------------------ the way through the whole master

TEST_F(Xdp, ThePortSuitePasses) {
    ASSERT_TRUE(open(nic).ok()) << nic.problem();
    port::SlaveOnCable slave(far);
    struct Bench : port::Host {
        Cable* cable = nullptr;
    } bench;
    bench.cable = &cable;
    LinuxOsal osal;
    auto port = bench.port(osal, &nic);
    port.plug = [](void* user, bool in) {
        const auto& all = *static_cast<Bench*>(static_cast<port::Host*>(user))->cable;
        all.ip(all.segment_namespace(), std::string("link set ") + Cable::kSegment + (in ? " up" : " down"));
    };
    port.longest_call = std::chrono::milliseconds(1);  // system calls on a busy machine
    const auto verdict = check_port(port);
    EXPECT_EQ(verdict.failed, 0U) << bench.text();
    EXPECT_EQ(verdict.skipped, 0U) << bench.text();
    EXPECT_EQ(verdict.passed, 37U);
}

// ------------------------------------------------------------------ what can be wrong

TEST_F(Xdp, AVethHasNoZeroCopy) {
    const auto done = open(nic, {.mode = Mode::zero_copy});
    EXPECT_FALSE(done.ok());
    EXPECT_NE(nic.problem().find("without copies"), std::string_view::npos) << nic.problem();
    EXPECT_EQ(link().find("prog/xdp"), std::string::npos) << link();
    EXPECT_TRUE(open(nic).ok()) << nic.problem();
    EXPECT_EQ(nic.mode(), Mode::copy);
}

TEST_F(Xdp, AnInterfaceThatDoesNotExist) {
    const auto done = nic.open("nosuch");
    EXPECT_EQ(done.error().actual, static_cast<std::uint32_t>(ENODEV));
    EXPECT_NE(nic.problem().find("there is no interface \"nosuch\""), std::string_view::npos) << nic.problem();
}

TEST_F(Xdp, AQueueThatDoesNotExist) {
    EXPECT_EQ(open(nic, {.queue = 77}).error().actual, static_cast<std::uint32_t>(EINVAL));
    EXPECT_NE(nic.problem().find("receive queue"), std::string_view::npos) << nic.problem();
    EXPECT_FALSE(open(nic, {.queue = 100'000}).ok());
    EXPECT_NE(nic.problem().find("receive queue does not exist"), std::string_view::npos) << nic.problem();
}

TEST_F(Xdp, AnotherProgramIsAttachedAlready) {
    ASSERT_TRUE(open(nic).ok()) << nic.problem();
    XdpNic second;
    EXPECT_EQ(open(second).error().actual, static_cast<std::uint32_t>(EBUSY));
    EXPECT_NE(second.problem().find("another XDP program is attached"), std::string_view::npos) << second.problem();
    // The first socket still works.
    ASSERT_EQ(far.send(frame_of({0x88, 0xA4}, 5)), SendStatus::sent);
    EXPECT_EQ(next(nic), frame_of({0x88, 0xA4}, 5));
}

// The kernel reports another error if the programs have different modes.
TEST_F(Xdp, AProgramOfAnotherModeIsAttachedAlready) {
    ASSERT_TRUE(open(nic, {.mode = XdpNic::Mode::generic}).ok()) << nic.problem();
    XdpNic second;
    EXPECT_EQ(open(second, {.mode = XdpNic::Mode::copy}).error().actual, static_cast<std::uint32_t>(EBUSY));
    EXPECT_NE(second.problem().find("another XDP program is attached"), std::string_view::npos) << second.problem();
    EXPECT_NE(second.problem().find("ends with the process"), std::string_view::npos) << second.problem();
}

// The kernel frees the queue of a closed XDP socket with a delay. A program that starts when another program has ended
// waits for this.
TEST_F(Xdp, OpeningWaitsForAnInterfaceThatIsAboutToBeFree) {
    ASSERT_TRUE(open(nic).ok()) << nic.problem();
    XdpNic second;
    std::thread closing([&] {
        ::usleep(100'000);
        nic.close();
    });
    const auto opened = open(second);
    closing.join();
    ASSERT_TRUE(opened.ok()) << second.problem();
    for (int n = 0; n < 20; ++n) ASSERT_TRUE(open(second).ok()) << n << ": " << second.problem();
    ASSERT_EQ(far.send(frame_of({0x88, 0xA4}, 5)), SendStatus::sent);
    EXPECT_EQ(next(second), frame_of({0x88, 0xA4}, 5));
}

TEST_F(Xdp, WithoutPrivileges) {
    const pid_t child = ::fork();
    if (child == 0) {
        Cable::inside(cable.master_namespace(), [] {
            if (::setgid(65534) != 0 || ::setuid(65534) != 0) ::_exit(2);
            XdpNic own;
            const bool good = own.open(Cable::kMaster).error().actual == static_cast<std::uint32_t>(EPERM) &&
                              own.problem().find("cap_bpf,cap_net_admin,cap_net_raw+ep") != std::string_view::npos;
            if (!good) std::printf("%s\n", std::string(own.problem()).c_str());
            std::fflush(stdout);
            ::_exit(good ? 0 : 1);
        });
    }
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
}

// Slaves do not process, when the interface is up again, a frame that could not be sent while it was down.
TEST_F(Xdp, AFrameThatCouldNotBeSentIsNotProcessedLater) {
    ASSERT_TRUE(open(nic, {.mode = Mode::generic}).ok()) << nic.problem();
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " down"));
    EXPECT_EQ(nic.send(frame_of({0x88, 0xA4}, 1)), SendStatus::failed);
    EXPECT_NE(nic.last_error(), 0);
    EXPECT_EQ(nic.link_state(), LinkState::down);
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " up"));
    for (int n = 0; n < 100 && nic.link_state() != LinkState::up; ++n) ::usleep(10'000);
    ASSERT_EQ(nic.send(frame_of({0x88, 0xA4}, 2)), SendStatus::sent);
    EXPECT_EQ(next(far), frame_of({0x88, 0xA4}, 2));  // the far end receives EtherCAT frames only
}

}  // namespace
}  // namespace margay
