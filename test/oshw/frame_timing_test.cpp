// The parts of FrameTiming: when a frame was sent, when it was received, and sending at a given time. The simulated NIC
// has all three. Other NICs pass them on or have none.
#include "oshw/filters/corrupt_nic.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/filters/duplicate_nic.hpp"
#include "oshw/filters/holding_nic.hpp"
#include "oshw/pcap/recorder.hpp"
#include "oshw/pcap/replay.hpp"
#include "oshw/pcap/ring_recorder.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "scripted_nic.hpp"
#include "sim/devices.hpp"
#include "wire/ethernet.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(ArrivalTimesTest, FindsTheNewestFrameByItsHead) {
    ArrivalTimes stamps;
    std::array<std::byte, 64> frame{};
    const auto head = Bytes(frame).first(ReceiveClock::kHeadBytes);
    EXPECT_FALSE(stamps.find(head));
    stamps.add(frame, 100);
    frame[14] = std::byte{5};  // the length changes with the datagrams that travel in the frame
    frame[18] = std::byte{3};  // each slave increments the position
    EXPECT_EQ(stamps.find(head), 100U);
    stamps.add(frame, 200);
    EXPECT_EQ(stamps.find(head), 200U);
    stamps.add(frame, std::nullopt);
    EXPECT_FALSE(stamps.find(head)) << "the time of an older frame is not that of this one";
    stamps.add(frame, 300);
    for (const std::size_t octet : {std::size_t{6}, std::size_t{16}, std::size_t{17}}) {  // mark, command, index
        frame[octet] ^= std::byte{2};
        EXPECT_FALSE(stamps.find(head)) << octet;
        frame[octet] ^= std::byte{2};
    }
    stamps.add(Bytes(frame).first(10), 400);
    EXPECT_EQ(stamps.find(head), 300U) << "a short frame is not kept";
    EXPECT_FALSE(stamps.find(head.first(10)));
    for (unsigned n = 0; n < ArrivalTimes::kMost; ++n) {
        frame[17] = static_cast<std::byte>(100 + n);
        stamps.add(frame, n);
    }
    frame[17] = std::byte{100};
    EXPECT_EQ(stamps.find(head), 0U);
    stamps.add(frame, 1000);
    frame[17] = std::byte{101};
    EXPECT_EQ(stamps.find(head), 1U);
}

struct FrameTimingTest : testing::Test {
    VirtualOsal osal{Time(1s)};
    sim::Segment segment;

    void SetUp() override {
        auto device = sim::make_device("digital_io_16");
        segment.add(std::move(*device).assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
    }
    // A BRD of one octet.
    static Frame read_frame(int index, std::size_t size = 60) {
        Frame frame(size, std::byte{0});
        std::fill_n(frame.begin(), 6, std::byte{0xFF});
        frame[12] = std::byte{0x88};
        frame[13] = std::byte{0xA4};
        frame[14] = std::byte{13};
        frame[15] = std::byte{0x10};
        frame[16] = std::byte{7};
        frame[17] = static_cast<std::byte>(index);
        frame[22] = std::byte{1};
        return frame;
    }
    static Bytes head_of(const Frame& frame) { return Bytes(frame).first(SendClock::kHeadBytes); }
    // Waits as a master does. Returns the index and the time of each frame that arrives.
    std::vector<std::pair<int, Time>> all_until(Nic& nic, Time until) {
        std::vector<std::pair<int, Time>> all;
        Frame buffer(1600);
        while (osal.now() < until) {
            osal.wait(std::min(until, nic.next_arrival()), -1);
            while (nic.receive(buffer) != 0) all.emplace_back(static_cast<int>(buffer[17]), osal.now());
        }
        return all;
    }
};

TEST_F(FrameTimingTest, TheSimulatedNicHasWhatItsOptionsSay) {
    SimulatedNic plain(segment, osal);
    EXPECT_EQ(plain.timing().sent, nullptr);
    EXPECT_EQ(plain.timing().received, nullptr);
    EXPECT_EQ(plain.timing().send_at, nullptr);
    SimulatedNic all(segment, osal, {.time_stamps = true, .timed_frames = 1});
    EXPECT_EQ(all.timing().sent, &all);
    EXPECT_EQ(all.timing().received, &all);
    EXPECT_EQ(all.timing().send_at, &all);
    // `plain` has no memory for frames that wait. It sends the frame at once and counts it in missed().
    plain.set_send_time(osal.now() + 1ms);
    EXPECT_EQ(plain.send(read_frame(1)), SendStatus::sent);
    EXPECT_EQ(plain.missed(), 1U);
    EXPECT_EQ(all_until(plain, osal.now() + 900us).size(), 1U);
}

TEST_F(FrameTimingTest, FramesLeaveInTheOrderOfTheirTimes) {
    SimulatedNic nic(segment, osal, {.round_trip = 0us, .time_stamps = true, .timed_frames = 3});
    const Time start = osal.now();
    const auto send = [&](int index, Time at) {
        nic.set_send_time(at);
        const auto status = nic.send(read_frame(index));
        nic.set_send_time(TimedSend::kAtOnce);
        return status;
    };
    EXPECT_EQ(send(1, start + 300us), SendStatus::sent);
    EXPECT_EQ(send(2, start + 100us), SendStatus::sent);
    EXPECT_EQ(send(3, start + 300us), SendStatus::sent);
    EXPECT_EQ(send(4, start + 50us), SendStatus::busy) << "there is memory for three frames";
    EXPECT_EQ(send(5, TimedSend::kAtOnce), SendStatus::sent);
    EXPECT_EQ(nic.frames_sent(), 1U) << "the others wait";
    EXPECT_LE(nic.next_arrival(), start + 100us);
    const auto came = all_until(nic, start + 1ms);
    ASSERT_EQ(came.size(), 4U);
    std::vector<int> order;
    for (const auto& one : came) order.push_back(one.first);
    EXPECT_EQ(order, (std::vector<int>{5, 2, 1, 3}));
    for (const auto& [index, at] : {std::pair{5, start}, {2, start + 100us}, {1, start + 300us}, {3, start + 300us}}) {
        const auto sent = nic.send_time_ns(head_of(read_frame(index)));
        EXPECT_EQ(sent, static_cast<std::uint64_t>(at.time_since_epoch().count())) << index;
    }
    EXPECT_EQ(nic.missed(), 0U);
    EXPECT_EQ(send(6, osal.now()), SendStatus::sent);
    EXPECT_EQ(nic.missed(), 0U) << "now is in time";
    EXPECT_EQ(send(7, osal.now() - 1ns), SendStatus::sent);
    EXPECT_EQ(nic.missed(), 1U);
}

TEST_F(FrameTimingTest, TimesAreThoseOfTheWire) {
    SimulatedNic nic(
        segment, osal,
        {.round_trip = 500us, .wire_time = true, .time_stamps = true, .clock_start_ns = 7, .timed_frames = 2});
    const Time at = osal.now() + 1ms;
    nic.set_send_time(at);
    EXPECT_EQ(nic.send(read_frame(1, 1000)), SendStatus::sent);
    EXPECT_EQ(nic.send(read_frame(2)), SendStatus::sent);
    (void)all_until(nic, at + 2ms);
    const auto first = nic.send_time_ns(head_of(read_frame(1)));
    const auto second = nic.send_time_ns(head_of(read_frame(2)));
    EXPECT_EQ(first, static_cast<std::uint64_t>(at.time_since_epoch().count()) + 7);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(*second - *first, wire::bytes_on_the_wire(1000) * 80) << "one after the other on the wire";
    auto reply = read_frame(1);
    reply[6] = std::byte{2};
    const auto received = nic.receive_time_ns(head_of(reply));
    ASSERT_TRUE(received);
    EXPECT_GT(*received, *first);
    EXPECT_LT(*received, *first + 5000) << "the delay of the host is not in it, nor the length of the frame";
    EXPECT_FALSE(nic.receive_time_ns(head_of(read_frame(1)))) << "an echo did not arrive";
}

TEST_F(FrameTimingTest, BothEndsOfARingSendInTheOrderOfTheirTimes) {
    ASSERT_TRUE(segment.connect_master({0, 1}, 1));
    SimulatedNic first(segment, osal, {.round_trip = 0us, .time_stamps = true, .timed_frames = 4});
    SimulatedNic second(segment, osal, {.round_trip = 0us, .master_port = 1, .time_stamps = true, .timed_frames = 4});
    first.set_other_end(&second);
    second.set_other_end(&first);
    TimedPair both(first, second);
    both.set_send_time(osal.now() + 100us);
    EXPECT_EQ(first.send(read_frame(1)), SendStatus::sent);
    EXPECT_EQ(second.send(read_frame(2)), SendStatus::sent);
    both.set_send_time(osal.now() - 1us);
    EXPECT_EQ(second.send(read_frame(3)), SendStatus::sent);
    EXPECT_EQ(both.missed(), 1U);
    osal.advance(1ms);
    Frame buffer(100);
    EXPECT_NE(first.receive(buffer), 0U);  // the frame that was sent at once
    EXPECT_EQ(buffer[17], std::byte{3});
    EXPECT_NE(first.receive(buffer), 0U) << "the other end's frame has left too";
    EXPECT_EQ(buffer[17], std::byte{2});
    EXPECT_NE(second.receive(buffer), 0U);
    EXPECT_EQ(buffer[17], std::byte{1});
    EXPECT_EQ(first.send_time_ns(head_of(read_frame(1))), second.send_time_ns(head_of(read_frame(2))));
}

TEST_F(FrameTimingTest, ACableThatIsPulledLosesTheFramesThatWait) {
    SimulatedNic nic(segment, osal, {.timed_frames = 4});
    nic.set_send_time(osal.now() + 100us);
    EXPECT_EQ(nic.send(read_frame(1)), SendStatus::sent);
    segment.set_cable({0, 0}, false);
    EXPECT_TRUE(all_until(nic, osal.now() + 1ms).empty());
    EXPECT_EQ(nic.frames_lost(), 1U);
    segment.set_cable({0, 0}, true);
    nic.set_send_time(TimedSend::kAtOnce);
    EXPECT_EQ(nic.send(read_frame(2)), SendStatus::sent);
    EXPECT_EQ(all_until(nic, osal.now() + 1ms).size(), 1U);
}

TEST_F(FrameTimingTest, FiltersAndRecordersPassThemOn) {
    SimulatedNic nic(segment, osal, {.time_stamps = true, .timed_frames = 4});
    DropNic drop(nic, {});
    CorruptNic corrupt(drop, {});
    DuplicateNic duplicate(corrupt, {});
    PcapRecorder recorder(duplicate, osal);
    PcapRingRecorder ring(recorder, nic, osal);
    for (Nic* outer : {static_cast<Nic*>(&drop), static_cast<Nic*>(&recorder), &ring.first(), &ring.second()}) {
        EXPECT_EQ(outer->timing().sent, &nic);
        EXPECT_EQ(outer->timing().received, &nic);
        EXPECT_EQ(outer->timing().send_at, &nic);
    }
    const Time at = osal.now() + 1ms;
    ring.first().timing().send_at->set_send_time(at);
    EXPECT_EQ(ring.first().send(read_frame(1)), SendStatus::sent);
    EXPECT_EQ(all_until(ring.first(), at + 1ms).size(), 1U);
    EXPECT_EQ(ring.first().timing().sent->send_time_ns(head_of(read_frame(1))),
              static_cast<std::uint64_t>(at.time_since_epoch().count()));
}

TEST_F(FrameTimingTest, NicsThatHaveNoneSaySo) {
    SimulatedNic nic(segment, osal, {.time_stamps = true, .timed_frames = 4});
    std::array<HeldFrame, 2> memory;
    DelayNic delay(nic, osal, memory, {.delay = 1ms});
    EXPECT_EQ(delay.timing().sent, &nic);
    EXPECT_EQ(delay.timing().received, nullptr) << "the frame is delivered later than the inner NIC has noted";
    EXPECT_EQ(delay.timing().send_at, &nic);
    PcapReplayNic replay(osal);
    PcapStrictReplayNic strict(osal);
    ScriptedNic scripted(osal);
    for (Nic* without : {static_cast<Nic*>(&replay), static_cast<Nic*>(&strict), static_cast<Nic*>(&scripted)}) {
        EXPECT_EQ(without->timing().sent, nullptr);
        EXPECT_EQ(without->timing().received, nullptr);
        EXPECT_EQ(without->timing().send_at, nullptr);
    }
}

}  // namespace
}  // namespace margay
