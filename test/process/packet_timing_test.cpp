// The times of frames with PacketNic over a veth pair: the times of receiving, and frames that leave at a given time.
#include "netns.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "wire/ethernet.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;
using process::Cable;
using Stamps = PacketNic::Stamps;
using Stamped = PacketNic::Stamped;

std::uint64_t wall_clock_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_REALTIME, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(now.tv_nsec);
}

struct PacketTimingTest : testing::Test {
    Cable cable;
    PacketNic master;
    PacketNic segment;
    LinuxOsal osal;
    std::vector<std::byte> buffer = std::vector<std::byte>(2048);

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        Cable::inside(cable.master_namespace(),
                      [&] { ASSERT_TRUE(master.open(Cable::kMaster).ok()) << master.problem(); });
        Cable::inside(cable.segment_namespace(), [&] {
            ASSERT_TRUE(segment.open(Cable::kSegment, PacketNic::Side::segment).ok()) << segment.problem();
        });
    }
    static std::vector<std::byte> frame_of(unsigned index) {
        std::vector<std::byte> frame(60, std::byte{0xFF});
        frame[12] = std::byte{wire::kEtherTypeEtherCat >> 8};
        frame[13] = std::byte{wire::kEtherTypeEtherCat & 0xFF};
        frame[17] = static_cast<std::byte>(index);
        return frame;
    }
    static std::span<const std::byte> head_of(const std::vector<std::byte>& frame) {
        return std::span(frame).first(SendClock::kHeadBytes);
    }
    // The index of the next frame; -1: no frame arrived.
    int next(PacketNic& nic) {
        const Time until = osal.now() + 5s;
        while (osal.now() < until) {
            if (nic.receive(buffer) != 0) return static_cast<int>(buffer[17]);
            osal.wait(until, nic.wait_handle());
        }
        return -1;
    }
    Result<> allow(unsigned priority = 3) {
        Result<> allowed;
        Cable::inside(cable.master_namespace(), [&] { allowed = master.allow_send_at(priority); });
        return allowed;
    }
    bool tc(const std::string& arguments) {
        return process::run("ip netns exec " + cable.master_namespace() + " tc " + arguments);
    }
    // The kernel enables the time stamps of received frames with a delay. Earlier frames have no time stamp.
    void await_receive_times(PacketNic& from, PacketNic& to) {
        const auto frame = frame_of(254);
        for (const Time until = osal.now() + 5s; osal.now() < until && !to.receive_time_ns(head_of(frame));) {
            ASSERT_EQ(from.send(frame), SendStatus::sent);
            ASSERT_EQ(next(to), 254);
        }
    }
    // Sends a frame that leaves `in` from now, and expects it at this time.
    void expect_at_its_time(unsigned index, Duration in) {
        const Time at = osal.now() + in;
        master.set_send_time(at);
        EXPECT_EQ(master.send(frame_of(index)), SendStatus::sent) << std::strerror(master.last_error());
        master.set_send_time(TimedSend::kAtOnce);
        EXPECT_EQ(next(segment), static_cast<int>(index));
        EXPECT_GE(osal.now(), at - 1ms) << "the delta of etf is shorter";
    }
};

// The kernel has taken the time between the time before sending and the time after receiving.
TEST_F(PacketTimingTest, NotesWhenItHasReceivedAFrame) {
    EXPECT_EQ(segment.timing().received, nullptr);
    ASSERT_TRUE(segment.stamp_frames(Stamps::software, Stamped::received).ok()) << segment.problem();
    EXPECT_EQ(segment.timing().received, &segment);
    EXPECT_EQ(segment.timing().sent, nullptr);
    await_receive_times(master, segment);
    for (unsigned n = 0; n < 50; ++n) {
        const auto frame = frame_of(n);
        const std::uint64_t before = wall_clock_ns();
        ASSERT_EQ(master.send(frame), SendStatus::sent);
        ASSERT_EQ(next(segment), static_cast<int>(n));
        const std::uint64_t after = wall_clock_ns();
        const auto received = segment.receive_time_ns(head_of(frame));
        ASSERT_TRUE(received) << n;
        EXPECT_GE(*received, before);
        EXPECT_LE(*received, after);
    }
    EXPECT_FALSE(segment.receive_time_ns(head_of(frame_of(255)))) << "never sent";
    EXPECT_FALSE(segment.send_time_ns(head_of(frame_of(1)))) << "not asked for";
    ASSERT_TRUE(segment.stamp_frames(Stamps::off).ok());
    ASSERT_EQ(master.send(frame_of(3)), SendStatus::sent);
    ASSERT_EQ(next(segment), 3);
    EXPECT_FALSE(segment.receive_time_ns(head_of(frame_of(3))));
}

// The far end sends the frame back. The time of receiving is later than the time of sending; both are of the same
// clock.
TEST_F(PacketTimingTest, BothTimesGiveTheRoundTrip) {
    ASSERT_TRUE(master.stamp_frames(Stamps::software, Stamped::both).ok()) << master.problem();
    await_receive_times(segment, master);
    for (unsigned n = 0; n < 100; ++n) {
        const auto frame = frame_of(n);
        const std::uint64_t before = wall_clock_ns();
        ASSERT_EQ(master.send(frame), SendStatus::sent);
        ASSERT_EQ(next(segment), static_cast<int>(n));
        ASSERT_EQ(segment.send(frame), SendStatus::sent);
        ASSERT_EQ(next(master), static_cast<int>(n));
        const std::uint64_t after = wall_clock_ns();
        const auto sent = master.send_time_ns(head_of(frame));
        const auto received = master.receive_time_ns(head_of(frame));
        ASSERT_TRUE(sent && received) << n;
        EXPECT_LE(before, *sent);
        EXPECT_LT(*sent, *received);
        EXPECT_LE(*received, after);
    }
    EXPECT_EQ(master.receive(buffer), 0U);
}

TEST_F(PacketTimingTest, SaysWhichTimeStampsTheDriverDoesNotHave) {
    ASSERT_TRUE(master.stamp_frames(Stamps::software, Stamped::both).ok());
    EXPECT_FALSE(master.stamp_frames(Stamps::hardware, Stamped::received).ok());
    EXPECT_EQ(std::string(master.problem()), "interface " + std::string(Cable::kMaster) +
                                                 ": its driver has no hardware time stamps of received frames "
                                                 "(Operation not supported)");
    EXPECT_EQ(master.timing().received, nullptr) << "a failure leaves it off";
    EXPECT_EQ(master.timing().sent, nullptr);
    ASSERT_EQ(master.send(frame_of(1)), SendStatus::sent);
    EXPECT_FALSE(master.send_time_ns(head_of(frame_of(1))));
}

TEST_F(PacketTimingTest, SendAtIsRefusedWhereTheQueueingDisciplineSendsAtOnce) {
    const auto allowed = allow();
    EXPECT_EQ(allowed.error().code, Errc::nic);
    EXPECT_EQ(static_cast<int>(allowed.error().actual), EOPNOTSUPP);
    EXPECT_EQ(
        std::string(master.problem()),
        "interface ecat-m: no frame can leave at a time by its queueing discipline noqueue: it sends them at once; "
        "mend it with: tc qdisc replace dev ecat-m root etf clockid CLOCK_TAI delta 200000");
    EXPECT_EQ(master.timing().send_at, nullptr);
    // A program sets a send time nevertheless: the frame leaves at once, and is counted.
    const Time at = osal.now() + 60s;
    master.set_send_time(at);
    EXPECT_EQ(master.send(frame_of(1)), SendStatus::sent);
    master.set_send_time(TimedSend::kAtOnce);
    EXPECT_EQ(next(segment), 1);
    EXPECT_LT(osal.now(), at);
    EXPECT_EQ(master.missed(), 1U);
    ASSERT_TRUE(tc("qdisc replace dev ecat-m root tbf rate 1gbit burst 100kb latency 1ms"));
    EXPECT_FALSE(allow().ok());
    EXPECT_NE(master.problem().find("its queueing discipline tbf: it sends them at once"), std::string_view::npos)
        << master.problem();
    master.close();
    EXPECT_FALSE(master.allow_send_at().ok());
}

// When this kernel has etf or fq, frames leave at their time. When it lacks them, problem() has the reason.
TEST_F(PacketTimingTest, FramesLeaveAtTheirTimeOrTheReasonIsTold) {
    for (const std::string kind : {"etf clockid CLOCK_TAI delta 300000", "fq"}) {
        SCOPED_TRACE(kind);
        (void)tc("qdisc del dev ecat-m root");
        const bool there = tc("qdisc replace dev ecat-m root " + kind);
        RecordProperty(kind.substr(0, 3), there ? "there" : "this kernel does not have it");
        const auto allowed = allow();
        ASSERT_EQ(allowed.ok(), there) << master.problem();
        if (!there) {
            EXPECT_NE(master.problem().find("no frame can leave at a time by its queueing discipline noqueue"),
                      std::string_view::npos)
                << master.problem();
            continue;
        }
        EXPECT_EQ(master.timing().send_at, &master);
        ASSERT_TRUE(master.stamp_frames(Stamps::software).ok());
        for (unsigned n = 0; n < 5; ++n) expect_at_its_time(n, 30ms);
        EXPECT_TRUE(master.send_time_ns(head_of(frame_of(4))));
        EXPECT_EQ(master.missed(), 0U);
        ASSERT_TRUE(master.stamp_frames(Stamps::off).ok());
    }
}

// The second socket, for frames with send times. No queueing discipline of this interface reads the times.
TEST_F(PacketTimingTest, ASocketWithTimesSendsWholeFrames) {
    TimedSocket socket;
    const TimedWay way{.holder = TimedWay::Holder::qdisc, .clock = CLOCK_TAI};
    Interface interface;
    Cable::inside(cable.master_namespace(), [&] {
        ASSERT_TRUE(interface.open(Cable::kMaster).ok());
        EXPECT_EQ(socket.open(interface.index(), way, 3), "") << std::strerror(errno);
        EXPECT_EQ(TimedSocket().open(interface.index(), {.clock = 99}, 3), "send times were refused (SO_TXTIME)");
        EXPECT_EQ(TimedSocket().open(1'000'000, way, 3), "the second socket cannot be bound to it");
    });
    EXPECT_TRUE(socket.is_late(osal.now()));
    EXPECT_FALSE(socket.is_late(osal.now() + 1s));
    for (unsigned n = 0; n < 10; ++n) {
        ASSERT_TRUE(socket.send(frame_of(n), osal.now() + 50ms)) << std::strerror(errno);
        EXPECT_EQ(next(segment), static_cast<int>(n));
        EXPECT_EQ(std::vector(buffer.begin(), buffer.begin() + 60), frame_of(n));
    }
    EXPECT_EQ(socket.dropped(), 0U);
}

}  // namespace
}  // namespace margay
