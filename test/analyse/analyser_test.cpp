// Tests with recordings made octet by octet: directions, VLAN tags, UDP, lost and late frames, working counters, and
// octets that no master sends.
#include "analyse/made_recording.hpp"

#include "wire/coe.hpp"
#include "wire/esc.hpp"

#include <gtest/gtest.h>

#include <random>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;
using wire::Command;

const Part kCyclic{Command::LRW, wire::DatagramAddress(0x10000), std::vector<std::byte>(8), 3};

Part cyclic(std::uint16_t wkc) {
    auto part = kCyclic;
    part.wkc = wkc;
    return part;
}

wire::DatagramAddress at(std::uint16_t adp, wire::Register place) { return {adp, place.address}; }

// The headers announce an EtherCAT frame, but the packet ends after the headers or inside the frame header.
TEST(FrameFinderTest, ATaggedPacketWithoutAFrameHeaderHoldsNoFrame) {
    auto packet = octets_of({0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 2, 2, 2, 2, 2, 2, 0x81, 0, 0, 1, 0x88, 0xA4});
    FrameFinder finder;
    EXPECT_FALSE(finder.find(packet));
    packet.push_back(std::byte{0x10});
    EXPECT_FALSE(finder.find(packet)) << "half of a frame header";
    packet.push_back(std::byte{0x10});
    const auto whole = finder.find(packet);
    ASSERT_TRUE(whole);
    EXPECT_TRUE(whole->vlan);
    EXPECT_EQ(whole->bytes.size(), wire::kEthernetHeaderBytes + wire::kFrameHeaderBytes);
    for (std::size_t size = 0; size < packet.size(); ++size) {
        const std::vector<std::byte> part(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_FALSE(finder.find(part)) << size;
    }
}

TEST_F(AnalyserTest, MeasuresTheCycleAndCountsLostAndLateFrames) {
    for (int i = 0; i < 100; ++i) {
        const auto at = 1ms * i;
        const auto index = static_cast<std::uint8_t>(i);
        packet(at, frame_of({kCyclic}, false, index));
        if (i == 51) packet(at + 10us, frame_of({kCyclic}, true, 50));  // behind the next request
        if (i == 40 || i == 50) continue;
        packet(at + 30us, frame_of({kCyclic}, true, index));
    }
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::marked);
    EXPECT_EQ(a.frames.requests, 100u);
    EXPECT_EQ(a.frames.replies, 99u);
    EXPECT_EQ(a.frames.lost, 1u);
    EXPECT_EQ(a.frames.late, 1u);
    EXPECT_EQ(a.frames.longest_trip, 1010us);
    ASSERT_EQ(a.cyclic.size(), 1u);
    EXPECT_EQ(a.cyclic[0].count, 100u);
    EXPECT_EQ(a.cyclic[0].lost, 1u);
    EXPECT_EQ(a.cyclic[0].late, 1u);
    const auto& intervals = a.cyclic[0].intervals;
    EXPECT_EQ(intervals.median, 1ms) << "a steady cycle is not rounded: its median is one of its intervals";
    EXPECT_EQ(intervals.low_1, 1ms);
    EXPECT_EQ(a.shortfalls.items.size(), 0u);
}

// The master sent the lost requests in time, too.
TEST_F(AnalyserTest, AnIntervalEndsWithARequestThatIsLost) {
    for (int i = 0; i < 600; ++i) {
        packet(1ms * i, frame_of({kCyclic}, false, static_cast<std::uint8_t>(i)));
        if (i % 5 != 0) packet(1ms * i + 30us, frame_of({kCyclic}, true, static_cast<std::uint8_t>(i)));
    }
    const auto a = analyser.finish();
    ASSERT_EQ(a.cyclic.size(), 1U);
    EXPECT_EQ(a.cyclic[0].count, 600U);
    EXPECT_EQ(a.cyclic[0].intervals.count, 599U);
    EXPECT_EQ(a.cyclic[0].intervals.most, 1ms);
    EXPECT_EQ(a.cyclic[0].intervals.late, 0U);
    EXPECT_EQ(a.frames.lost, 116U);
    EXPECT_EQ(a.frames.open, 4U) << "of the last 20 ms";
}

// One master has two frames on the wire at the same time; another master sends a burst of frames to the clocks.
TEST_F(AnalyserTest, FramesThatOverlapAreNotLate) {
    for (int i = 0; i < 100; ++i) {
        const auto index = static_cast<std::uint8_t>(i);
        packet(1ms * i, frame_of({kCyclic}, false, index));
        if (i >= 1) packet(1ms * i + 500us, frame_of({kCyclic}, true, static_cast<std::uint8_t>(i - 1)));
    }
    const auto other = Part{Command::LRW, wire::DatagramAddress(0x20000), std::vector<std::byte>(8), 3};
    packet(200ms, frame_of({other}, false, 1));
    packet(201ms, frame_of({other}, false, 2));
    packet(202ms, frame_of({other}, true, 1));
    packet(203ms, frame_of({other}, true, 2));
    const auto a = analyser.finish();
    ASSERT_EQ(a.cyclic.size(), 2U);
    EXPECT_TRUE(a.cyclic[0].overlapping);
    EXPECT_EQ(a.cyclic[0].late, 0U);
    EXPECT_FALSE(a.cyclic[1].overlapping);
    EXPECT_EQ(a.cyclic[1].late, 1U);
    EXPECT_EQ(a.frames.late, 1U);
}

TEST_F(AnalyserTest, SaysWhenAWorkingCounterFellShort) {
    for (int i = 0; i < 30; ++i) exchange(1ms * i, {cyclic(i < 5 ? 1 : i >= 10 && i < 14 ? 2 : i >= 28 ? 0 : 3)});
    const auto a = analyser.finish();
    ASSERT_EQ(a.shortfalls.items.size(), 2u) << "the first cycles are no shortfall: nothing was complete before";
    const auto& first = a.shortfalls.items[0];
    EXPECT_EQ(first.begin.at, 10ms + 30us);
    ASSERT_TRUE(first.end);
    EXPECT_EQ(first.end->at, 14ms + 30us);
    EXPECT_EQ(first.expected, 3);
    EXPECT_EQ(first.least, 2);
    EXPECT_EQ(first.frames, 4u);
    EXPECT_FALSE(a.shortfalls.items[1].end);
    EXPECT_EQ(a.shortfalls.items[1].least, 0);
    EXPECT_EQ(a.cyclic.at(0).datagrams.at(0).wkcs.at(3), 19u);
}

TEST_F(AnalyserTest, ReadsRepliesOnly) {
    // The position in a reply is the position in the request plus the number of slaves that the frame has passed.
    packet(0ms, frame_of({{Command::BRD, wire::DatagramAddress(4, 0x0130), octets_of({2, 0}), 4}}, true));
    packet(1ms, frame_of({{Command::APWR, wire::DatagramAddress(3, 0x0010), octets_of({0x02, 0x10}), 1}}, true));
    packet(2ms,
           frame_of({{Command::FPRD, wire::DatagramAddress(0x1002, 0x0130), octets_of({0x12, 0, 0, 0, 0x1B, 0}), 1}},
                    true));
    for (int i = 0; i < 10; ++i) packet(3ms + 1ms * i, frame_of({kCyclic}, true));
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::replies_only);
    EXPECT_EQ(a.frames.lost, 0u);
    ASSERT_EQ(a.slaves.size(), 1u);
    EXPECT_EQ(a.slaves[0].position, 1) << "4 slaves: 3 - 4 is position 1";
    EXPECT_EQ(a.slaves[0].station, 0x1002);
    EXPECT_EQ(a.slaves[0].state, (AlStatus{AlState::preop, true, 0x1B}));
    ASSERT_EQ(a.cyclic.size(), 1u);
    EXPECT_EQ(a.cyclic[0].intervals.median / 100us, 10);
}

TEST_F(AnalyserTest, ATapBetweenSlavesTellsNoCounters) {
    const Part status{Command::BRD, wire::DatagramAddress(2, 0x0130), octets_of({8, 0}), 2};
    for (int i = 0; i < 600; ++i) {
        const auto index = static_cast<std::uint8_t>(i);
        for (const std::uint16_t wkc : {std::uint16_t{1}, std::uint16_t{3}})
            packet(1ms * i + 10us * wkc, frame_of({cyclic(wkc)}, true, index));
    }
    packet(600ms, frame_of({status}, true));
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::replies_only);
    EXPECT_TRUE(a.passes_twice);
    EXPECT_TRUE(a.shortfalls.items.empty());
    EXPECT_TRUE(a.ring_sizes.items.empty());
    ASSERT_EQ(a.cyclic.size(), 1u);
    EXPECT_EQ(a.cyclic[0].intervals.count, 0u);
    EXPECT_TRUE(a.cyclic[0].datagrams.at(0).wkcs.empty());
}

TEST_F(AnalyserTest, ATapBetweenSlavesIsNoticedWithManyFramesInACycle) {
    for (int i = 0; i < 40; ++i)
        for (const std::uint16_t wkc : {std::uint16_t{1}, std::uint16_t{3}})
            for (int n = 0; n < 20; ++n)
                packet(1ms * i + 100us * wkc + 5us * n,
                       frame_of({cyclic(wkc)}, true, static_cast<std::uint8_t>(20 * i + n)));
    EXPECT_TRUE(analyser.finish().passes_twice);
}

// Each cycle has twenty frames. Each frame has its own index, which is the same in all cycles.
TEST_F(AnalyserTest, RepliesOfManyFramesInACycleAreNoTapBetweenSlaves) {
    for (int i = 0; i < 40; ++i)
        for (int n = 0; n < 20; ++n)
            packet(1ms * i + 5us * n, frame_of({cyclic(i % 2 == 0 ? 1 : 2)}, true, static_cast<std::uint8_t>(n)));
    EXPECT_FALSE(analyser.finish().passes_twice);
}

// The working counter is too small in some cycles, and the index is always the same.
TEST_F(AnalyserTest, RepliesOnlyOfAMasterTellTheirCounters) {
    for (int i = 0; i < 600; ++i)
        packet(1ms * i, frame_of({cyclic(i % 8 < 7 ? std::uint16_t{3} : std::uint16_t{2})}, true, 5));
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::replies_only);
    EXPECT_FALSE(a.passes_twice);
    EXPECT_EQ(a.cyclic.at(0).intervals.count, 599u);
    EXPECT_FALSE(a.shortfalls.items.empty());
}

// All replies have the same index, and a slave answers in every second cycle.
TEST_F(AnalyserTest, RepliesOfEveryCycleAreNoTapBetweenSlaves) {
    for (int i = 0; i < 600; ++i) packet(1ms * i + 7us * (i % 5), frame_of({cyclic(i % 2 == 0 ? 1 : 2)}, true));
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::replies_only);
    EXPECT_FALSE(a.passes_twice);
    ASSERT_EQ(a.cyclic.size(), 1U);
    EXPECT_EQ(a.cyclic[0].datagrams[0].wkcs.size(), 2U);
}

// The recording does not show whether the replies were lost or were not recorded.
TEST_F(AnalyserTest, LossesAreNotKnownWithoutReplies) {
    for (int i = 0; i < 600; ++i) packet(1ms * i, frame_of({kCyclic}, false, static_cast<std::uint8_t>(i)));
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::requests_only);
    EXPECT_FALSE(a.losses_known);
    EXPECT_EQ(a.frames.requests, 600u);
    EXPECT_EQ(a.frames.lost, 0u);
    EXPECT_EQ(a.cyclic.at(0).count, 600u);
    EXPECT_EQ(a.cyclic.at(0).lost, 0u);
}

// The cable was connected during the recording.
TEST_F(AnalyserTest, RequestsBeforeTheFirstReplyAreLost) {
    for (int i = 0; i < 900; ++i) {
        packet(1ms * i, frame_of({kCyclic}, false, static_cast<std::uint8_t>(i)));
        if (i >= 800) packet(1ms * i + 30us, frame_of({kCyclic}, true, static_cast<std::uint8_t>(i)));
    }
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::marked);
    EXPECT_TRUE(a.losses_known);
    EXPECT_EQ(a.frames.replies, 100u);
    EXPECT_EQ(a.frames.lost, 800u);
    EXPECT_EQ(a.cyclic.at(0).lost, 800u);
}

TEST_F(AnalyserTest, ReadsAMasterWithALocalAddress) {
    for (int i = 0; i < 20; ++i) {
        packet(1ms * i, frame_of({kCyclic}, false, 7, 0x02));
        packet(1ms * i + 30us, frame_of({kCyclic}, true, 7, 0x02));
    }
    const auto a = analyser.finish();
    EXPECT_EQ(a.directions, Directions::same_address);
    EXPECT_EQ(a.frames.requests, 20u);
    EXPECT_EQ(a.frames.replies, 20u);
    EXPECT_EQ(a.frames.lost + a.frames.open, 0u);
    EXPECT_EQ(a.cyclic.at(0).intervals.median / 100us, 10);
}

Frame tagged(const Frame& frame) {
    auto out = frame;
    const auto tag = octets_of({0x81, 0x00, 0x00, 0x05});
    out.insert(out.begin() + 12, tag.begin(), tag.end());
    return out;
}

Frame in_udp(const Frame& frame) {
    Frame out(frame.begin(), frame.begin() + 12);
    const auto payload = frame.size() - 14;
    const auto udp = static_cast<unsigned>(payload + 8);
    const auto ip = udp + 20;
    const auto head =
        octets_of({0x08, 0x00, 0x45, 0,   ip >> 8, ip & 0xFF, 0,   0,    0,    0,    64,   17,       0,          0, 10,
                   0,    0,    1,    255, 255,     255,       255, 0x12, 0x34, 0x88, 0xA4, udp >> 8, udp & 0xFF, 0, 0});
    out.insert(out.end(), head.begin(), head.end());
    out.insert(out.end(), frame.begin() + 14, frame.end());
    return out;
}

TEST_F(AnalyserTest, LooksIntoVlanTagsAndUdp) {
    for (int i = 0; i < 4; ++i) {
        const auto index = static_cast<std::uint8_t>(i);
        const auto wrap = [&](const Frame& f) { return i % 2 == 0 ? tagged(f) : in_udp(f); };
        packet(1ms * i, wrap(frame_of({kCyclic}, false, index)));
        packet(1ms * i + 30us, wrap(frame_of({kCyclic}, true, index)));
    }
    const auto a = analyser.finish();
    EXPECT_EQ(a.frames.ethercat, 8u);
    EXPECT_EQ(a.frames.vlan, 4u);
    EXPECT_EQ(a.frames.udp, 4u);
    EXPECT_EQ(a.cyclic.at(0).datagrams.at(0).wkcs.at(3), 4u);
}

// The recording begins while the slaves are in OP, and the master scans later. A slave that was seen only by its
// station address is the slave whose position gets this address in the scan.
struct AnalyserRescan : AnalyserTest {
    Duration now{};
    void one(const Part& part) { exchange(now += 1ms, {part}); }
    void state(Command command, std::uint16_t adp, unsigned state) {
        one({command, at(adp, wire::reg::kAlStatus), octets_of({state, 0}), 1});
    }
    void in_operation() {
        state(Command::FPRD, 0x1001, 8);
        state(Command::FPRD, 0x1002, 8);
    }
    void station(Command command, std::uint16_t adp, unsigned low) {
        one({command, at(adp, wire::reg::kStationAddress), octets_of({low, 0x10}), 1});
    }
    void expect_two_slaves_in(AlState wanted) {
        const auto a = analyser.finish();
        ASSERT_EQ(a.slaves.size(), 2u);
        for (std::uint16_t n = 0; n < 2; ++n) {
            EXPECT_EQ(a.slaves[n].station, 0x1001 + n);
            EXPECT_EQ(a.slaves[n].position, n);
            ASSERT_TRUE(a.slaves[n].state);
            EXPECT_EQ(a.slaves[n].state->state, wanted) << n;
        }
        for (const auto& event : a.states.items) EXPECT_LT(event.slave.value_or(0), 2u);
        EXPECT_EQ(a.states.items.back().slave, 1u);
    }
};

TEST_F(AnalyserRescan, ASlaveThatGetsItsStationAddressAgainIsOneSlave) {
    in_operation();
    station(Command::APWR, 0, 1);
    station(Command::APWR, 0xFFFF, 2);
    state(Command::FPRD, 0x1001, 2);
    state(Command::APRD, 0xFFFF, 2);
    expect_two_slaves_in(AlState::preop);
}

TEST_F(AnalyserRescan, TheAddressesAreClearedAndTheSlavesReadByPositionBefore) {
    in_operation();
    one({Command::BWR, at(0, wire::reg::kStationAddress), octets_of({0, 0}), 2});
    state(Command::APRD, 0, 1);
    state(Command::APRD, 0xFFFF, 1);
    station(Command::APWR, 0, 1);
    station(Command::APWR, 0xFFFF, 2);
    state(Command::FPRD, 0x1001, 2);
    state(Command::FPRD, 0x1002, 2);
    expect_two_slaves_in(AlState::preop);
}

TEST_F(AnalyserRescan, TheAddressesAreReadByPosition) {
    in_operation();
    station(Command::APRD, 0, 1);
    station(Command::APRD, 0xFFFF, 2);
    state(Command::APRD, 0, 4);
    state(Command::APRD, 0xFFFF, 4);
    expect_two_slaves_in(AlState::safeop);
}

// Two slaves have changed places. Each of them had a position before.
TEST_F(AnalyserRescan, ASlaveWithAnotherPositionIsAnotherSlave) {
    station(Command::APWR, 0, 1);
    in_operation();
    station(Command::APWR, 0xFFFF, 1);
    const auto a = analyser.finish();
    ASSERT_EQ(a.slaves.size(), 3u);
    EXPECT_EQ(a.slaves[0].position, 0);
    EXPECT_EQ(a.slaves[1].station, 0x1002);
    EXPECT_EQ(a.slaves[2].position, 1);
}

TEST_F(AnalyserTest, DamagedAndCutFramesAreCounted) {
    exchange(0ms, {kCyclic});
    auto damaged = frame_of({kCyclic}, false);
    damaged[22] = std::byte{0xFF};  // the length of the datagram
    packet(1ms, damaged);
    const auto whole = frame_of({kCyclic}, false);
    analyser.packet({++number, 2ms}, Bytes(whole).first(30), whole.size());
    packet(3ms, Frame(5));
    const auto a = analyser.finish();
    EXPECT_EQ(a.frames.packets, 5u);
    EXPECT_EQ(a.frames.ethercat, 2u);
    EXPECT_EQ(a.frames.damaged, 1u);
    EXPECT_EQ(a.frames.cut, 1u);
}

TEST_F(AnalyserTest, CountsPacketsThatAreNotInOrderOfTime) {
    exchange(0ms, {kCyclic});
    exchange(2ms, {kCyclic});
    EXPECT_EQ(analyser.steps_back(), 0u);
    exchange(1ms, {kCyclic});
    exchange(3ms, {kCyclic});
    EXPECT_EQ(analyser.steps_back(), 1u);
    EXPECT_EQ(analyser.first_step_back(), 5u);
}

// Some masters write only the command and the low half of the address, and read status and data by separate datagrams.
TEST_F(AnalyserTest, TheSiiIsReadByTheLowHalfOfTheAddress) {
    const wire::DatagramAddress control(0x1001, 0x0502);
    const wire::DatagramAddress data(0x1001, 0x0508);
    auto when = 1ms;
    for (const unsigned word : {8U, 10U}) {
        exchange(when, {{Command::FPWR, control, octets_of({0, 1, word, 0}), 1}});
        exchange(when + 1ms, {{Command::FPRD, control, octets_of({0, 0}), 1}});
        exchange(when + 2ms, {{Command::FPRD, data, octets_of({word, 2, 3, 4}), 1}});
        when += 10ms;
    }
    const auto slave = analyser.finish().slaves.at(0);
    EXPECT_EQ(slave.vendor, 0x0403'0208U);
    EXPECT_EQ(slave.product, 0x0403'020AU);
    EXPECT_EQ(slave.sii_octets, 8U);
}

TEST_F(AnalyserTest, ABroadcastSwitchesSyncOffAndMakesNoClock) {
    const auto exchange_all = [&](Duration when, std::vector<std::byte> data) {
        packet(when, frame_of({{Command::BWR, {0, 0x0980}, data, 0}}, false));
        packet(when + 30us, frame_of({{Command::BWR, {2, 0x0980}, data, 2}}, true));
    };
    exchange(1ms, {{Command::FPWR, {0x1001, 0x0980}, octets_of({0, 3}), 1}});
    exchange(2ms, {{Command::FPRD, {0x1002, 0x0130}, octets_of({1, 0}), 1}});
    exchange_all(3ms, octets_of({0, 0}));
    const auto a = analyser.finish();
    ASSERT_EQ(a.slaves.size(), 2U);
    EXPECT_EQ(a.slaves[0].clock.activation, 0);
    EXPECT_FALSE(a.slaves[1].clock.seen()) << "it may have no clock";
}

TEST(AnalyseHostile, OctetsOfAnyKindAreAccepted) {
    std::mt19937 random(20261123);
    const auto number_to = [&](std::size_t most) {
        return std::uniform_int_distribution<std::size_t>(0, most)(random);
    };
    constexpr Command kCommands[] = {Command::APRD, Command::APWR, Command::FPRD, Command::FPWR, Command::BRD,
                                     Command::BWR,  Command::LRW,  Command::FRMW, Command::ARMW, Command::FPRW};
    constexpr std::uint16_t kAddresses[] = {0x0010, 0x0120, 0x0130, 0x0500, 0x0502, 0x0508, 0x0800,
                                            0x0808, 0x0910, 0x0920, 0x092C, 0x0980, 0x1000, 0x1040};
    std::size_t conversations = 0;
    for (int round = 0; round < 40; ++round) {
        Analyser analyser;
        std::uint64_t number = 0;
        std::uint64_t frames = 0;
        const std::vector<Part> mailboxes{{Command::FPWR, wire::DatagramAddress(0x1001, 0x0800),
                                           octets_of({0, 0x10, 80, 0, 0x26, 0, 1, 0, 0x40, 0x10, 80, 0, 0x22, 0, 1, 0}),
                                           1}};
        for (const bool reply : {false, true}) {
            const auto frame = frame_of(mailboxes, reply);
            analyser.packet({++number, 0us}, frame, frame.size());
            ++frames;
        }
        for (int i = 0; i < 600; ++i) {
            std::vector<Part> parts;
            for (std::size_t n = number_to(3) + 1; n > 0; --n) {
                Part part{.command = kCommands[number_to(9)],
                          .address = wire::DatagramAddress(static_cast<std::uint16_t>(number_to(1) == 0 ? 0 : 0x1001),
                                                           kAddresses[number_to(13)]),
                          .data = std::vector<std::byte>(number_to(80)),
                          .wkc = static_cast<std::uint16_t>(number_to(3))};
                for (auto& octet : part.data) octet = static_cast<std::byte>(number_to(2) == 0 ? number_to(255) : 0);
                if (number_to(2) == 0 && part.data.size() >= 16) {  // a plausible mailbox message
                    const bool sent = number_to(1) == 0;
                    part.command = sent ? Command::FPWR : Command::FPRD;
                    part.address = wire::DatagramAddress(0x1001, sent ? 0x1000 : 0x1040);
                    part.wkc = 1;
                    part.data[0] = static_cast<std::byte>(number_to(part.data.size()));
                    part.data[1] = part.data[4] = std::byte{0};
                    part.data[5] = static_cast<std::byte>(number_to(5) | number_to(7) << 4);
                    part.data[7] = static_cast<std::byte>(number_to(8) << 4);
                    if (number_to(1) == 0) part.data[8] = static_cast<std::byte>(number_to(4) << 5);
                }
                parts.push_back(std::move(part));
            }
            for (const bool reply : {false, true}) {
                auto frame = frame_of(parts, reply, static_cast<std::uint8_t>(i));
                if (number_to(3) == 0)
                    for (std::size_t n = number_to(5); n > 0; --n)
                        frame[number_to(frame.size() - 1)] = static_cast<std::byte>(number_to(255));
                if (number_to(9) == 0) frame.resize(number_to(frame.size()));
                if (number_to(9) == 0) frame = number_to(1) == 0 && frame.size() >= 14 ? in_udp(frame) : frame;
                // The buffer has exactly the size of the frame, so the sanitizers report a read beyond its end.
                analyser.packet({++number, 1us * static_cast<int>(number_to(1'000'000))}, frame, frame.size());
                ++frames;
            }
        }
        const auto a = analyser.finish();
        ASSERT_EQ(a.frames.packets, frames);
        ASSERT_EQ(a.frames.requests + a.frames.replies, a.frames.ethercat);
        ASSERT_LE(a.slaves.size(), kMostSlaves);
        for (const auto& event : a.states.items) ASSERT_TRUE(!event.slave || *event.slave < a.slaves.size());
        for (const auto& c : a.conversations.items) {
            ASSERT_LT(c.slave, a.slaves.size());
            ASSERT_LE(c.data.size(), Conversation::kKept);
        }
        conversations += a.conversations.items.size();
    }
    EXPECT_NE(conversations, 0u) << "the messages are of a likely form";
}

}  // namespace
}  // namespace margay::analyse
