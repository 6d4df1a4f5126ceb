// PacketNic over a veth pair.
#include "oshw/linux/packet_nic.hpp"
#include "netns.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/filters/chance.hpp"
#include "wire/ethernet.hpp"

#include <gtest/gtest.h>
#include <linux/capability.h>
#include <poll.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <thread>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;
using process::Cable;
using Frame = std::vector<std::byte>;
using Side = PacketNic::Side;

// Random octets with the given EtherType.
Frame frame_of(std::size_t size, Chance& chance, std::uint16_t ether_type = wire::kEtherTypeEtherCat) {
    Frame frame(size);
    for (auto& octet : frame) octet = static_cast<std::byte>(chance.next());
    for (std::size_t i = 0; i < std::min<std::size_t>(6, size); ++i) frame[i] = std::byte{0xFF};
    if (size > 13) {
        frame[12] = static_cast<std::byte>(ether_type >> 8);
        frame[13] = static_cast<std::byte>(ether_type);
    }
    return frame;
}

struct PacketNicTest : testing::Test {
    Cable cable;
    PacketNic master;
    PacketNic segment;
    LinuxOsal osal;
    Chance chance{1};

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        Cable::inside(cable.master_namespace(),
                      [&] { ASSERT_TRUE(master.open(Cable::kMaster).ok()) << master.problem(); });
        Cable::inside(cable.segment_namespace(),
                      [&] { ASSERT_TRUE(segment.open(Cable::kSegment, Side::segment).ok()) << segment.problem(); });
    }

    // Waits for the next frame; empty when none arrives.
    Frame next(PacketNic& nic, Duration limit = 5s) {
        Frame buffer(2048);
        const auto until = osal.now() + limit;
        while (osal.now() < until) {
            if (const auto length = nic.receive(buffer)) {
                buffer.resize(length);
                return buffer;
            }
            osal.wait(until, nic.wait_handle());
        }
        return {};
    }
    // Checks that no frame is pending: a frame sent now is the next frame received.
    void expect_quiet(PacketNic& from, PacketNic& to) {
        const auto mark = frame_of(100, chance);
        ASSERT_EQ(from.send(mark), SendStatus::sent);
        EXPECT_EQ(next(to), mark);
    }
    // Calls open() in the master's namespace and returns problem().
    std::string problem_of(const std::string& interface) {
        PacketNic nic;
        bool opened = false;
        Cable::inside(cable.master_namespace(), [&] { opened = nic.open(interface).ok(); });
        EXPECT_EQ(opened, nic.problem().empty());
        EXPECT_EQ(nic.wait_handle() >= 0, opened);
        return std::string(nic.problem());
    }
};

TEST_F(PacketNicTest, CarriesFramesOfEveryLengthBothWays) {
    for (std::size_t size = 14; size <= wire::kMaxFrameBytes; size += size < 80 ? 1 : 97) {
        const auto frame = frame_of(size, chance);
        ASSERT_EQ(master.send(frame), SendStatus::sent) << size << ": " << std::strerror(master.last_error());
        ASSERT_EQ(next(segment), frame) << size;
        ASSERT_EQ(segment.send(frame), SendStatus::sent) << size;
        ASSERT_EQ(next(master), frame) << size;
    }
}

TEST_F(PacketNicTest, NoiseOfEveryLengthIsSentWholeOrRefused) {
    for (std::size_t size = 0; size <= 1600; ++size) {
        const auto frame = frame_of(size, chance);
        const bool legal = size >= wire::kEthernetHeaderBytes && size <= wire::kMaxFrameBytes;
        ASSERT_EQ(master.send(frame), legal ? SendStatus::sent : SendStatus::failed) << size;
        if (legal) {
            ASSERT_EQ(next(segment), frame) << size;
        } else {
            EXPECT_NE(master.last_error(), 0) << size;
        }
    }
    expect_quiet(master, segment);
}

TEST_F(PacketNicTest, OnlyEtherCatWithoutVlanTagComesThrough) {
    for (unsigned type = 0; type <= 0xFFFF; type += 257)
        if (type != wire::kEtherTypeEtherCat) {
            ASSERT_EQ(master.send(frame_of(60, chance, static_cast<std::uint16_t>(type))), SendStatus::sent);
        }
    auto tagged = frame_of(60, chance);
    const std::byte tag[] = {std::byte{0x81}, std::byte{0}, std::byte{0}, std::byte{5}};
    tagged.insert(tagged.begin() + 12, std::begin(tag), std::end(tag));
    ASSERT_EQ(master.send(tagged), SendStatus::sent);
    expect_quiet(master, segment);
}

TEST_F(PacketNicTest, HearsNeitherItselfNorItsNeighbour) {
    PacketNic neighbour;
    Cable::inside(cable.master_namespace(), [&] { ASSERT_TRUE(neighbour.open(Cable::kMaster).ok()); });
    ASSERT_EQ(master.send(frame_of(60, chance)), SendStatus::sent);
    ASSERT_EQ(neighbour.send(frame_of(60, chance)), SendStatus::sent);
    expect_quiet(segment, master);
    EXPECT_TRUE(master.hides_own_frames()) << "what comes is no echo, marked or not";
}

TEST_F(PacketNicTest, SegmentSeesAnyDestinationAndSource) {
    for (const int destination : {0xFF, 0x00, 0x02, 0x01, 0x33})
        for (const int source : {0x00, 0x01, 0x02, 0xFF}) {
            auto frame = frame_of(60, chance);
            frame[0] = static_cast<std::byte>(destination);
            frame[6] = static_cast<std::byte>(source);
            ASSERT_EQ(master.send(frame), SendStatus::sent);
            EXPECT_EQ(next(segment), frame) << destination << " " << source;
        }
}

TEST_F(PacketNicTest, SourceAddressHasTheMarkBitsClear) {
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " down"));
    ASSERT_TRUE(cable.ip(cable.master_namespace(),
                         std::string("link set ") + Cable::kMaster + " address 06:11:22:33:44:55 up"));
    PacketNic nic;
    Cable::inside(cable.master_namespace(), [&] { ASSERT_TRUE(nic.open(Cable::kMaster).ok()) << nic.problem(); });
    EXPECT_EQ(nic.source_mac(), (MacAddress{0x04, 0x11, 0x22, 0x33, 0x44, 0x55}));
}

TEST_F(PacketNicTest, LongFramesAreCutToTheBuffer) {
    const auto frame = frame_of(1000, chance);
    ASSERT_EQ(master.send(frame), SendStatus::sent);
    osal.wait(osal.now() + 5s, segment.wait_handle());
    Frame small(100);
    ASSERT_EQ(segment.receive(small), 100u);
    EXPECT_TRUE(std::equal(small.begin(), small.end(), frame.begin()));
    expect_quiet(master, segment);
}

TEST_F(PacketNicTest, AFrameEndsAWait) {
    std::thread later([&] {
        std::this_thread::sleep_for(5ms);
        EXPECT_EQ(segment.send(frame_of(60, chance)), SendStatus::sent);
    });
    const auto start = osal.now();
    osal.wait(start + 60s, master.wait_handle());
    EXPECT_LT(osal.now() - start, 50s);
    later.join();
    EXPECT_FALSE(next(master).empty());
}

TEST_F(PacketNicTest, AnUnpluggedCableIsSeenAndHeals) {
    EXPECT_EQ(master.link_state(), LinkState::up);
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("link set ") + Cable::kSegment + " down"));
    EXPECT_EQ(master.link_state(), LinkState::down);
    EXPECT_EQ(master.send(frame_of(60, chance)), SendStatus::failed);
    EXPECT_NE(master.last_error(), 0);
    Frame buffer(100);
    EXPECT_EQ(master.receive(buffer), 0u);
    // Opening works without a cable, too: the link can come up later.
    EXPECT_EQ(problem_of(Cable::kMaster), "");
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("link set ") + Cable::kSegment + " up"));
    EXPECT_EQ(master.link_state(), LinkState::up);
    // The socket of the far end got one report that its interface went down.
    EXPECT_EQ(segment.receive(buffer), 0u);
    EXPECT_EQ(segment.last_error(), ENETDOWN);
    expect_quiet(master, segment);
    expect_quiet(segment, master);
}

// The kernel's answer about the carrier may take long, so it is kept until a frame is sent.
TEST_F(PacketNicTest, TheCarrierIsAskedOnceForAnUnpluggedCable) {
    Interface interface;
    Cable::inside(cable.master_namespace(), [&] { ASSERT_TRUE(interface.open(Cable::kMaster).ok()); });
    const auto plug = [&](const char* state) {
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("link set ") + Cable::kSegment + state));
    };
    EXPECT_FALSE(interface.lacks_carrier()) << "a full queue";
    interface.note_sent();
    plug(" down");
    EXPECT_TRUE(interface.lacks_carrier());
    plug(" up");
    ASSERT_EQ(interface.link_state(), LinkState::up);
    for (unsigned n = 0; n < 100; ++n) EXPECT_TRUE(interface.lacks_carrier()) << "not asked again";
    interface.note_sent();
    EXPECT_FALSE(interface.lacks_carrier());
    // The cable is unplugged while the queue is full.
    plug(" down");
    unsigned refused = 1;
    while (refused < 100 && !interface.lacks_carrier()) ++refused;
    EXPECT_EQ(refused, 16U);
}

TEST_F(PacketNicTest, AnInterfaceThatIsPulledOutIsDownForGood) {
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link del ") + Cable::kMaster));
    for (auto* nic : {&master, &segment}) {
        EXPECT_EQ(nic->link_state(), LinkState::down);
        EXPECT_EQ(nic->send(frame_of(60, chance)), SendStatus::failed);
        Frame buffer(100);
        EXPECT_EQ(nic->receive(buffer), 0u);
    }
}

TEST_F(PacketNicTest, FramesThatNobodyFetchesAreCounted) {
    EXPECT_EQ(segment.overruns(), 0u);
    constexpr std::size_t kFlood = 20'000;
    const auto frame = frame_of(wire::kMaxFrameBytes, chance);
    for (std::size_t i = 0; i < kFlood; ++i) ASSERT_EQ(master.send(frame), SendStatus::sent);
    std::size_t received = 0;
    Frame buffer(2048);
    while (segment.receive(buffer) != 0) ++received;
    EXPECT_GE(received, 100u) << "a burst fits";
    EXPECT_LT(received, kFlood);
    EXPECT_EQ(received + segment.overruns(), kFlood);
    EXPECT_EQ(segment.overruns(), kFlood - received) << "asking twice does not forget";
    expect_quiet(master, segment);
}

TEST_F(PacketNicTest, SaysWhatKeepsItFromOpening) {
    EXPECT_EQ(problem_of("no-such-if").find("there is no interface \"no-such-if\"; there are:"), 0u);
    EXPECT_NE(problem_of("no-such-if").find(Cable::kMaster), std::string::npos) << "those that are there help";
    EXPECT_NE(problem_of(std::string(300, 'x')).find("there is no interface \"xxx"), std::string::npos);
    EXPECT_NE(problem_of("").find("there is no interface \"\""), std::string::npos);
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link set lo up"));
    EXPECT_NE(problem_of("lo").find("it is not an Ethernet interface"), std::string::npos);
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " mtu 1400"));
    EXPECT_EQ(problem_of(Cable::kMaster),
              "interface ecat-m: its MTU is too small for EtherCAT frames; widen it with: ip link set ecat-m "
              "mtu 1500");
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " mtu 1500 down"));
    EXPECT_EQ(problem_of(Cable::kMaster),
              "interface ecat-m: it is switched off; bring it up with: ip link set ecat-m up");
}

TEST_F(PacketNicTest, MissingPermissionIsNamedWithItsRemedy) {
    // In a child process, because a process that has dropped its capabilities does not get them back.
    int pipe[2];
    ASSERT_EQ(::pipe(pipe), 0);
    const auto child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        Cable::inside(cable.master_namespace(), [&] {
            __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
            __user_cap_data_struct none[2]{};
            if (::syscall(SYS_capset, &header, none) != 0) ::_exit(2);
            PacketNic nic;
            const auto opened = nic.open(Cable::kMaster);
            const auto said = nic.problem();
            if (::write(pipe[1], said.data(), said.size()) != static_cast<ssize_t>(said.size())) ::_exit(3);
            ::_exit(opened.ok() ? 1 : static_cast<int>(opened.error().actual) == EPERM ? 0 : 4);
        });
        ::_exit(5);
    }
    ::close(pipe[1]);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
    std::array<char, 1024> said{};
    const auto length = ::read(pipe[0], said.data(), said.size());
    ::close(pipe[0]);
    const std::string text(said.data(), static_cast<std::size_t>(std::max<ssize_t>(0, length)));
    EXPECT_NE(text.find("CAP_NET_RAW"), std::string::npos) << text;
    EXPECT_NE(text.find("sudo setcap cap_net_raw+ep /"), std::string::npos) << text;
    EXPECT_NE(text.find("test_process"), std::string::npos) << text;
}

TEST_F(PacketNicTest, OpensAgainAfterAFailure) {
    Cable::inside(cable.master_namespace(), [&] {
        EXPECT_FALSE(master.open("no-such-if").ok());
        EXPECT_EQ(master.send(frame_of(60, chance)), SendStatus::failed);
        EXPECT_EQ(master.link_state(), LinkState::down);
        ASSERT_TRUE(master.open(Cable::kMaster).ok());
        EXPECT_EQ(master.problem(), "");
    });
    expect_quiet(master, segment);
}

std::uint64_t realtime_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_REALTIME, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(now.tv_nsec);
}

// The kernel has taken the time between the time before the call and the time after the call. After receive() the error
// queue is empty, so a wait for frames does not return at once.
TEST_F(PacketNicTest, NotesWhenItHasSentAFrame) {
    auto frame = frame_of(80, chance);
    const auto head = [&frame] { return std::span<const std::byte>(frame).first(SendClock::kHeadBytes); };
    ASSERT_EQ(master.send(frame), SendStatus::sent);
    EXPECT_FALSE(master.send_time_ns(head())) << "not asked for";
    const auto stamping = master.stamp_frames(PacketNic::Stamps::software);
    ASSERT_TRUE(stamping.ok()) << master.problem();
    for (unsigned n = 0; n < 40; ++n) {
        frame[17] = static_cast<std::byte>(n);
        const std::uint64_t before = realtime_ns();
        ASSERT_EQ(master.send(frame), SendStatus::sent);
        const std::uint64_t after = realtime_ns();
        std::vector<std::byte> buffer(2048);
        EXPECT_EQ(master.receive(buffer), 0U);
        pollfd wait{master.wait_handle(), POLLIN, 0};
        EXPECT_EQ(::poll(&wait, 1, 0), 0) << wait.revents;
        const auto sent = master.send_time_ns(head());
        ASSERT_TRUE(sent) << n;
        EXPECT_GE(*sent, before);
        EXPECT_LE(*sent, after);
    }
    ASSERT_TRUE(master.stamp_frames(PacketNic::Stamps::off).ok());
    ASSERT_EQ(master.send(frame), SendStatus::sent);
    EXPECT_FALSE(master.send_time_ns(head()));
}

TEST_F(PacketNicTest, SaysWhenTheDriverHasNoTimeStamps) {
    const auto stamping = master.stamp_frames(PacketNic::Stamps::hardware);
    EXPECT_EQ(stamping.error().code, Errc::nic);
    EXPECT_EQ(std::string(master.problem()), "interface " + std::string(Cable::kMaster) +
                                                 ": its driver has no hardware time stamps of sent frames (Operation "
                                                 "not supported)");
    expect_quiet(master, segment);
    master.close();
    EXPECT_FALSE(master.stamp_frames(PacketNic::Stamps::software).ok());
}

}  // namespace
}  // namespace margay
