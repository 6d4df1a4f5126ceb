// Files with frames of one master or of several masters: how the analyser distinguishes masters, and how it handles
// packets that are not in order of time.
#include "analyse/recording.hpp"

#include "oshw/pcap/pcapng.hpp"
#include "replay/files.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <thread>

#include <sys/stat.h>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;
using wire::Command;
using Direction = PacketOrigin::Direction;

// A cyclic frame of a master, or the reply to it.
Frame cycle_frame(std::uint8_t master, bool reply, std::uint8_t index, std::uint8_t first_octet = 0) {
    Frame buffer(wire::kMaxFrameBytes);
    const auto octet = static_cast<std::uint8_t>(first_octet | (reply ? 2U : 0U));
    wire::FrameBuilder builder(buffer, {octet, 0x11, 0x22, 0x33, 0x44, master});
    (void)builder.append(Command::LRW, index, wire::DatagramAddress(0x10000), 8);
    if (reply) store_le<std::uint16_t>(MutableBytes(buffer), builder.size() - 2, 3);
    buffer.resize(builder.finish().size());
    return buffer;
}

struct Packet {
    Duration at{};
    Frame bytes{};
    PacketOrigin origin{};
};

// The cycles of a master: each with a request and its reply.
std::vector<Packet> cycles_of(std::uint8_t master, Duration begin, Duration cycle, int count,
                              std::uint32_t interface = 0) {
    std::vector<Packet> all;
    for (int n = 0; n < count; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        all.push_back({begin + cycle * n, cycle_frame(master, false, index), {.interface = interface}});
        all.push_back({begin + cycle * n + 30us, cycle_frame(master, true, index), {.interface = interface}});
    }
    return all;
}

std::vector<Packet> operator+(std::vector<Packet> a, const std::vector<Packet>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

std::vector<Packet> in_order(std::vector<Packet> all) {
    std::ranges::stable_sort(all, {}, &Packet::at);
    return all;
}

struct AnalyseFile : testing::Test {
    TemporaryFolder folder;

    std::string pcap(const std::vector<Packet>& packets) {
        auto content = pcap_header();
        for (const auto& p : packets) content += pcap_packet(1, static_cast<std::uint32_t>(p.at.count()), p.bytes);
        return folder.write("file.pcap", content);
    }
    std::string pcapng(const std::vector<Packet>& packets) {
        const auto path = folder.file("file.pcapng");
        PcapngWriter writer;
        const std::array<std::string_view, 3> names{"a", "b", "c"};
        EXPECT_TRUE(writer.open(path, names));
        for (const auto& p : packets) writer.write(p.origin, 1s + p.at, p.bytes);
        EXPECT_TRUE(writer.close());
        return path;
    }
};

TEST_F(AnalyseFile, SaysWhatIsWrongAndReadsAFileThatEndsEarly) {
    EXPECT_NE(analyse_file(folder.file("none")).problem.find("No such file"), std::string::npos);
    EXPECT_EQ(analyse_file(folder.write("x", pcap_header())).problem, "it holds no EtherCAT frame");
    const auto request = cycle_frame(1, false, 1);
    const auto reply = cycle_frame(1, true, 1);
    const auto content = pcap_header() + pcap_packet(1, 0, request) + pcap_packet(1, 30'000, reply);
    const auto cut = analyse_file(folder.write("y", content + pcap_packet(1, 60'000, request).substr(0, 40)));
    EXPECT_EQ(cut.problem, "");
    EXPECT_NE(cut.remark.find("behind packet 2"), std::string::npos) << cut.remark;
    EXPECT_EQ(cut.frames.replies, 1u);
}

void expect_cycle(const Analysis& a, Duration cycle, std::uint64_t count) {
    EXPECT_EQ(a.frames.requests, count);
    EXPECT_EQ(a.frames.replies, count);
    EXPECT_EQ(a.frames.lost + a.frames.late + a.frames.unasked, 0u);
    ASSERT_EQ(a.cyclic.size(), 1u);
    EXPECT_EQ(a.cyclic[0].intervals.median, cycle);
    EXPECT_EQ(a.cyclic[0].intervals.most, cycle);
}

// An interface "any" of Linux beside Ethernet interfaces, before or after them in the file.
TEST_F(AnalyseFile, InterfacesThatAreNotEthernetAreLeftOutAndNamed) {
    for (const std::uint32_t cooked : {0U, 1U, 2U}) {
        std::vector<Packet> packets;
        std::vector<std::uint32_t> others;
        for (std::uint32_t n = 0; n < 3; ++n)
            if (n != cooked) others.push_back(n);
        for (const auto& p : in_order(cycles_of(1, 0us, 1ms, 40, others[0]) + cycles_of(1, 10us, 2ms, 20, others[1]))) {
            packets.push_back(p);
            packets.push_back({p.at, Frame(70, std::byte{0x88}), {.interface = cooked}});
        }
        auto content = read_file(pcapng(packets));
        std::size_t at = 28;  // behind the section header
        for (std::uint32_t n = 0; n < cooked; ++n) at += static_cast<unsigned char>(content[at + 4]);
        content[at + 8] = 113;
        const auto a = analyse_file(folder.write("mixed.pcapng", content));
        EXPECT_EQ(a.problem, "");
        EXPECT_EQ(a.remark, std::string("left out is what is not Ethernet: interface ") + "012"[cooked] + " (" +
                                "abc"[cooked] + ", link type Linux cooked v1, 120 packets)");
        EXPECT_EQ(a.frames.packets, 240U);
        EXPECT_EQ(a.frames.ethercat, 80U);
        expect_cycle(a, 1ms, 40);
        EXPECT_EQ(a.interface, others[0]);
        EXPECT_EQ(a.cyclic.at(0).first.frame, 1U);
        EXPECT_EQ(a.cyclic.at(0).last.frame, 237U);
        ASSERT_EQ(a.others.size(), 1U);
        EXPECT_EQ(a.others[0].interface, others[1]);
        expect_cycle(a.others[0], 2ms, 20);
    }
}

// The analyser recognises the NICs of a ring although an interface before them is left out.
TEST_F(AnalyseFile, ARingBesideAnInterfaceThatIsLeftOut) {
    std::vector<Packet> packets;
    for (int n = 0; n < 40; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        packets.push_back({1ms * n, cycle_frame(1, false, index), {1, Direction::sent}});
        packets.push_back({1ms * n + 2us, cycle_frame(2, false, index), {2, Direction::sent}});
        packets.push_back({1ms * n + 30us, cycle_frame(1, true, index), {2, Direction::received}});
        packets.push_back({1ms * n + 32us, cycle_frame(2, false, index), {1, Direction::received}});
    }
    auto content = read_file(pcapng(packets));
    content[28 + 8] = 113;
    const auto a = analyse_file(folder.write("mixed.pcapng", content));
    EXPECT_TRUE(a.ring);
    expect_cycle(a, 1ms, 40);
    EXPECT_TRUE(a.remark.starts_with("left out is what is not Ethernet: interface 0 (a,")) << a.remark;
}

TEST_F(AnalyseFile, TwoMastersAreToldByTheirAddresses) {
    const auto a = analyse_file(pcap(in_order(cycles_of(1, 0us, 1ms, 40) + cycles_of(2, 10us, 2ms, 20))));
    EXPECT_EQ(a.problem + a.remark, "");
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.master.addresses, std::vector<std::string>{"00:11:22:33:44:01"});
    ASSERT_EQ(a.others.size(), 1u);
    expect_cycle(a.others[0], 2ms, 20);
    EXPECT_EQ(a.others[0].master.addresses, std::vector<std::string>{"00:11:22:33:44:02"});
    EXPECT_EQ(a.frames.packets, 120u);
    EXPECT_FALSE(a.interface) << "the addresses differ";
}

TEST_F(AnalyseFile, TwoMastersWithOneAddressAreToldByTheirInterfaces) {
    const auto a = analyse_file(pcapng(in_order(cycles_of(1, 0us, 1ms, 40, 0) + cycles_of(1, 10us, 2ms, 20, 2))));
    EXPECT_EQ(a.problem + a.remark, "");
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.interface, 0u);
    ASSERT_EQ(a.others.size(), 1u);
    expect_cycle(a.others[0], 2ms, 20);
    EXPECT_EQ(a.others[0].interface, 2u);
}

TEST_F(AnalyseFile, ATapHasAnInterfaceForEachDirection) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    for (auto& p : packets)
        p.origin.interface = (p.bytes[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    const auto a = analyse_file(pcapng(packets));
    expect_cycle(a, 1ms, 40);
    EXPECT_TRUE(a.others.empty());
    EXPECT_FALSE(a.interface);
}

std::vector<Packet> with_replies_behind(std::vector<Packet> packets, Duration behind) {
    for (auto& p : packets)
        if ((p.bytes[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0}) {
            p.origin.interface = 1;
            p.at -= behind;
        }
    return in_order(std::move(packets));
}

constexpr std::string_view kMoved = "replies are stamped before their requests";

// Each index is used again after 256 frames.
TEST_F(AnalyseFile, RepliesOfATapWhoseClockIsBehindAreMoved) {
    for (const Duration behind : {0us, 25us, 100us, 230us, 500us, 5500us, 20'000us}) {
        const auto a = analyse_file(pcapng(with_replies_behind(cycles_of(1, 1s, 1ms, 1000), behind)));
        expect_cycle(a, 1ms, 1000);
        EXPECT_TRUE(a.losses_known);
        EXPECT_EQ(a.frames.open, 0U) << behind.count();
        EXPECT_EQ(a.remark.starts_with(kMoved), behind > 25us) << behind.count() << a.remark;
        EXPECT_EQ(a.frames.longest_trip, behind > 25us ? 0us : 30us - behind) << behind.count();
    }
}

// The replies need two different times, and some replies are before their requests in the file.
TEST_F(AnalyseFile, RepliesOfWhichSomeAreBeforeTheirRequests) {
    auto packets = cycles_of(1, 1s, 1ms, 1000);
    for (std::size_t n = 1; n < packets.size(); n += 8) packets[n].at += 50us;
    const auto a = analyse_file(pcapng(with_replies_behind(packets, 60us)));
    expect_cycle(a, 1ms, 1000);
    EXPECT_TRUE(a.remark.starts_with(kMoved)) << a.remark;
}

TEST_F(AnalyseFile, LossesBesideAClockThatIsBehindAreTold) {
    auto packets = cycles_of(1, 1s, 1ms, 1000);
    for (const std::size_t cycle : {900U, 500U, 499U, 20U})
        packets.erase(packets.begin() + static_cast<std::ptrdiff_t>(2 * cycle + 1));
    const auto a = analyse_file(pcapng(with_replies_behind(packets, 200us)));
    EXPECT_TRUE(a.remark.starts_with(kMoved)) << a.remark;
    EXPECT_EQ(a.frames.replies, 996U);
    EXPECT_EQ(a.frames.lost, 4U);
    EXPECT_EQ(a.frames.late + a.frames.unasked, 0U);
}

// The master waits for each reply, and sends the next request soon after the reply.
TEST_F(AnalyseFile, ALongRoundTripIsNoClockThatIsBehind) {
    for (const unsigned indices : {1U, 3U, 256U})
        for (const Duration trip : {300us, 1500us, 1990us})
            for (const bool loses : {false, true}) {
                std::vector<Packet> packets;
                for (unsigned n = 0; n < 400; ++n) {
                    const auto index = static_cast<std::uint8_t>(n % indices);
                    packets.push_back({2ms * n, cycle_frame(1, false, index)});
                    if (!loses || n % 40 != 20) packets.push_back({2ms * n + trip, cycle_frame(1, true, index)});
                }
                const auto a = analyse_file(pcapng(packets));
                EXPECT_EQ(a.remark, "") << indices << " " << trip.count();
                EXPECT_TRUE(a.losses_known);
                EXPECT_EQ(a.frames.lost, loses ? 10U : 0U) << indices << " " << trip.count();
                EXPECT_EQ(a.frames.longest_trip, trip);
            }
}

// The recorder has not recorded some requests and replies.
TEST_F(AnalyseFile, PacketsThatTheRecorderHasMissedAreNoClockThatIsBehind) {
    std::vector<Packet> packets;
    for (int n = 0; n < 400; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        if (n % 20 != 7) packets.push_back({2ms * n, cycle_frame(1, false, index)});
        if (n % 20 != 13) packets.push_back({2ms * n + 1900us, cycle_frame(1, true, index)});
    }
    const auto a = analyse_file(pcapng(packets));
    EXPECT_EQ(a.remark, "");
    EXPECT_EQ(a.frames.lost + a.frames.open, 20U);
    EXPECT_EQ(a.frames.unasked, 20U);
}

// Two files were concatenated. Each of them is in order of time, so the analyser does not sort.
TEST_F(AnalyseFile, TheFilesOfTwoMastersOneBehindTheOther) {
    const auto a = analyse_file(pcap(cycles_of(1, 50ms, 1ms, 40) + cycles_of(2, 0us, 2ms, 20)));
    EXPECT_EQ(a.remark, "");
    expect_cycle(a, 1ms, 40);
    ASSERT_EQ(a.others.size(), 1u);
    EXPECT_EQ(a.others[0].remark, "");
    expect_cycle(a.others[0], 2ms, 20);
}

TEST_F(AnalyseFile, PacketsOfOneMasterAreSortedByTime) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    std::ranges::stable_sort(packets, {}, [](const Packet& p) { return p.bytes[wire::kSourceMacOffset]; });
    const auto a = analyse_file(pcap(packets));
    EXPECT_NE(a.remark.find("not in order of time (1 time, first at packet #41) and were sorted"), std::string::npos)
        << a.remark;
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.frames.longest_trip, 30us);
}

// In such a file the packet numbers do not give the order of time.
TEST_F(AnalyseFile, TheSecondHalfOfAFileBeforeTheFirst) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    std::ranges::rotate(packets, packets.begin() + 41);
    const auto a = analyse_file(pcap(packets));
    EXPECT_NE(a.remark.find("were sorted"), std::string::npos) << a.remark;
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.cyclic[0].last.at - a.cyclic[0].first.at, 39ms);
}

// Both NICs of a ring send each frame. Two masters on two interfaces do not.
TEST_F(AnalyseFile, ARingIsOneMasterAndTwoMastersAreNoRing) {
    for (const bool ring : {true, false}) {
        std::vector<Packet> packets;
        for (int n = 0; n < 40; ++n) {
            const auto index = static_cast<std::uint8_t>(n);
            const auto at = 1ms * n;
            const auto after = ring ? 2us : 400us;
            packets.push_back({at, cycle_frame(1, false, index), {0, Direction::sent}});
            packets.push_back({at + after, cycle_frame(2, false, index), {1, Direction::sent}});
            packets.push_back({at + 30us, cycle_frame(1, true, index), {ring ? 1U : 0U, Direction::received}});
            packets.push_back({at + after + 30us, cycle_frame(2, !ring, index), {ring ? 0U : 1U, Direction::received}});
        }
        const auto a = analyse_file(pcapng(in_order(packets)));
        EXPECT_EQ(a.ring, ring);
        expect_cycle(a, 1ms, 40);
        EXPECT_EQ(a.others.size(), ring ? 0u : 1u);
    }
}

// The same ring, as its master records it. The copy of the second NIC is `later` than the copy of the first NIC.
// `broken`: the ring is broken after the first slave.
std::vector<Packet> ring_of_nics(int count, Duration later, bool broken) {
    std::vector<Packet> all;
    for (int n = 0; n < count; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        const auto at = 1ms * n;
        auto first = cycle_frame(1, true, index);
        auto second = cycle_frame(2, broken, index);
        if (broken) store_le<std::uint16_t>(MutableBytes(first), first.size() - 2, 1);
        if (broken) store_le<std::uint16_t>(MutableBytes(second), second.size() - 2, 2);
        all.push_back({at, cycle_frame(1, false, index), {0, Direction::sent}});
        all.push_back({at + later, cycle_frame(2, false, index), {1, Direction::sent}});
        all.push_back({at + 30us, first, {broken ? 0U : 1U, Direction::received}});
        all.push_back({at + later + 30us, second, {broken ? 1U : 0U, Direction::received}});
    }
    return in_order(all);
}

void expect_ring_of_nics(const Analysis& a) {
    EXPECT_TRUE(a.ring) << a.remark;
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.lost, 0U);
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.cyclic.at(0).datagrams.at(0).wkcs, (std::map<std::uint16_t, std::uint64_t>{{3, 40}}));
}

// Recorders of two interfaces write their packets in batches. Either interface can be the one that sends first.
TEST_F(AnalyseFile, ARingOfNicsIsOneMasterInAnyOrder) {
    for (const bool broken : {false, true}) {
        auto packets = ring_of_nics(40, 2us, broken);
        const auto a = analyse_file(pcapng(packets));
        EXPECT_EQ(a.remark, "");
        expect_ring_of_nics(a);
        std::ranges::stable_sort(packets, {},
                                 [](const Packet& p) { return std::pair(p.at / 8ms, p.origin.interface); });
        const auto lots = analyse_file(pcapng(packets));
        EXPECT_NE(lots.remark.find(" and were sorted"), std::string::npos) << lots.remark;
        expect_ring_of_nics(lots);
        std::ranges::stable_sort(packets, {}, [](const Packet& p) { return p.origin.interface; });
        expect_ring_of_nics(analyse_file(pcapng(packets)));
        for (auto& p : packets) p.origin.interface = 1 - p.origin.interface;
        expect_ring_of_nics(analyse_file(pcapng(in_order(packets))));
    }
}

TEST_F(AnalyseFile, AnUnsureRingOfNicsIsSaid) {
    const auto skewed = analyse_file(pcapng(ring_of_nics(40, 200us, true)));
    EXPECT_FALSE(skewed.ring);
    EXPECT_NE(skewed.remark.find("if they are the NICs of a broken ring, they are one master"), std::string::npos);
    auto packets = ring_of_nics(40, 2us, false);
    std::erase_if(packets, [](const Packet& p) { return p.origin.interface != 0; });
    const auto one = analyse_file(pcapng(packets));
    EXPECT_NE(one.remark.find("this looks like a part of a ring"), std::string::npos) << one.remark;
    EXPECT_FALSE(one.losses_known);
}

// A ring, as taps record it without directions: the copies with the addresses 1 and 2 at the interfaces 0 and 1. The
// ring is whole in two thirds of the cycles, and broken between the slaves in the last third.
std::vector<Packet> ring_of_taps(int count, bool breaks) {
    std::vector<Packet> all;
    for (int n = 0; n < count; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        const auto at = 1ms * n;
        const bool broken = breaks && 3 * n >= 2 * count;
        all.push_back({at, cycle_frame(1, false, index), {.interface = 0}});
        all.push_back({at + 10us, cycle_frame(2, false, index), {.interface = 1}});
        auto first = cycle_frame(1, true, index);
        auto second = cycle_frame(2, broken, index);
        if (broken) store_le<std::uint16_t>(MutableBytes(first), first.size() - 2, 1);
        if (broken) store_le<std::uint16_t>(MutableBytes(second), second.size() - 2, 2);
        all.push_back({at + 40us, first, {.interface = broken ? 0U : 1U}});
        all.push_back({at + (broken ? 700us : 45us), second, {.interface = broken ? 1U : 0U}});
    }
    return all;
}

void expect_ring_of_taps(const Analysis& a, std::uint64_t count = 90) {
    EXPECT_TRUE(a.ring);
    EXPECT_TRUE(a.losses_known);
    EXPECT_EQ(
        a.remark,
        "the file has no directions of packets; frames that come by twice show that it is of both NICs of a ring");
    EXPECT_TRUE(a.others.empty());
    expect_cycle(a, 1ms, count);
    EXPECT_EQ(a.cyclic.at(0).datagrams.at(0).wkcs, (std::map<std::uint16_t, std::uint64_t>{{3, count}}));
    EXPECT_TRUE(a.shortfalls.items.empty());
}

// Some masters give all cyclic frames one index. Other masters send additional datagrams, so they soon have used all
// 256 indices.
TEST_F(AnalyseFile, ARingOfTapsWhoseIndexComesAnewInEachCycle) {
    auto packets = ring_of_taps(450, false);
    for (auto& p : packets) {
        p.bytes[wire::kFramePrefixBytes + 1] = std::byte{7};
        p.bytes[wire::kFramePrefixBytes + wire::kDatagramHeaderBytes] = static_cast<std::byte>(p.at / 1ms);
    }
    expect_ring_of_taps(analyse_file(pcapng(packets)), 450);
    // Without interfaces, a copy that passes the tap again looks like a frame with the same index.
    EXPECT_NE(analyse_file(pcap(packets))
                  .remark.find("if the master uses an index again so soon, they are frames that are missing here"),
              std::string::npos);
}

TEST_F(AnalyseFile, ARingOfTapsThatIsNotInOrderIsSortedAndThatIsSaid) {
    auto packets = ring_of_taps(90, false);
    std::rotate(packets.begin(), packets.begin() + 100, packets.end());
    auto a = analyse_file(pcapng(packets));
    constexpr std::string_view kOrder =
        "; the packets are not in order of time (1 time, first at packet #261) and were sorted; if the clock of the "
        "recorder was set back, replies and times near there are wrong";
    ASSERT_TRUE(a.remark.ends_with(kOrder)) << a.remark;
    a.remark.resize(a.remark.size() - kOrder.size());
    expect_ring_of_taps(a);
}

TEST_F(AnalyseFile, ARingWithoutDirectionsIsOneMaster) {
    for (const bool breaks : {false, true}) {
        auto packets = ring_of_taps(90, breaks);
        expect_ring_of_taps(analyse_file(pcapng(packets)));
        expect_ring_of_taps(analyse_file(pcap(packets)));
        // A third tap is between the first NIC and the ring.
        for (const auto& p : ring_of_taps(90, breaks))
            if (p.origin.interface == 0) packets.push_back({p.at + 3us, p.bytes, {.interface = 2}});
        packets = in_order(packets);
        const auto a = analyse_file(pcapng(packets));
        EXPECT_TRUE(a.ring && a.losses_known && a.others.empty());
        expect_cycle(a, 1ms, 90);
    }
}

// At a tap between the slaves, one copy has passed some of the slaves, and the other copy passes again.
std::vector<Packet> ring_of_taps_with_middle(std::uint32_t interface) {
    auto packets = ring_of_taps(90, false);
    for (int n = 0; n < 90; ++n) {
        auto first = cycle_frame(1, true, static_cast<std::uint8_t>(n));
        store_le<std::uint16_t>(MutableBytes(first), first.size() - 2, 1);
        packets.push_back({1ms * n + 20us, first, {.interface = interface}});
        packets.push_back(
            {1ms * n + 25us, cycle_frame(2, false, static_cast<std::uint8_t>(n)), {.interface = interface}});
    }
    return in_order(packets);
}

TEST_F(AnalyseFile, ATapInTheMiddleOfARingBesideItsNicsChangesNothing) {
    for (const auto& path : {pcapng(ring_of_taps_with_middle(2)), pcap(ring_of_taps_with_middle(2))}) {
        const auto a = analyse_file(path);
        expect_ring_of_taps(a);
        EXPECT_EQ(a.frames.shortest_trip, 40us);
    }
}

TEST_F(AnalyseFile, AnInterfaceWithSeveralPlacesOfARingIsSaid) {
    auto packets = ring_of_taps_with_middle(1);
    for (auto& p : packets)
        if (p.at % 1ms != 20us && p.at % 1ms != 25us) p.origin.interface = 0;
    EXPECT_NE(analyse_file(pcapng(packets)).remark.find("90 packets were there again soon at their interface"),
              std::string::npos)
        << analyse_file(pcapng(packets)).remark;
}

// At the break, one copy was sent into the whole ring, and the following copy into the broken ring.
TEST_F(AnalyseFile, ACopyThatHasPassedTheWholeRingIsTheReplyAlone) {
    auto packets = ring_of_taps(90, true);
    for (auto& p : packets)
        if (p.at == 60ms + 40us) p = {p.at, cycle_frame(1, true, 60), {.interface = 1}};
    expect_ring_of_taps(analyse_file(pcapng(packets)));
}

// While the ring is whole, the replies arrive at the other NIC.
TEST_F(AnalyseFile, APartOfARingShowsNoLosses) {
    for (const bool breaks : {false, true}) {
        auto packets = ring_of_taps(90, breaks);
        std::erase_if(packets, [](const Packet& p) { return p.origin.interface != 0; });
        const auto a = analyse_file(pcap(packets));
        EXPECT_FALSE(a.ring || a.losses_known);
        EXPECT_NE(a.remark.find("looks like a part of a ring, and is counted as one master"), std::string::npos);
        EXPECT_TRUE(a.others.empty());
        EXPECT_EQ(a.frames.requests, 90U);
        EXPECT_EQ(a.frames.replies, breaks ? 30U : 0U);
        EXPECT_EQ(a.frames.lost, 0U);
        EXPECT_EQ(a.cyclic.at(0).lost, 0U);
        EXPECT_EQ(a.cyclic.at(0).intervals.median, 1ms);
        packets = ring_of_taps(90, breaks);
        std::erase_if(packets, [](const Packet& p) { return p.origin.interface != 1; });
        const auto other = analyse_file(pcap(packets));
        EXPECT_FALSE(other.losses_known);
        EXPECT_NE(other.remark.find("looks like a part of a ring, and its NICs are shown as masters"),
                  std::string::npos);
        ASSERT_EQ(other.others.size(), 1U);
        EXPECT_FALSE(other.others[0].losses_known);
        EXPECT_EQ(other.frames.lost + other.others[0].frames.lost, 0U);
    }
}

// One program has two masters, whose segments are alike.
TEST_F(AnalyseFile, TwoMastersInStepAreNoRing) {
    const auto a = analyse_file(pcap(in_order(cycles_of(1, 0us, 1ms, 40) + cycles_of(2, 10us, 1ms, 40))));
    EXPECT_FALSE(a.ring);
    EXPECT_TRUE(a.losses_known);
    EXPECT_NE(a.remark.find("two masters send the same frames at the same time: if they are"), std::string::npos);
    expect_cycle(a, 1ms, 40);
    ASSERT_EQ(a.others.size(), 1U);
    expect_cycle(a.others[0], 1ms, 40);
    // The frames of the second master have another index, or come later.
    for (const auto begin : {11'010us, 1'500us})
        EXPECT_EQ(analyse_file(pcap(in_order(cycles_of(1, 0us, 1ms, 40) + cycles_of(2, begin, 1ms, 40)))).remark, "");
}

// A mirror port copies both directions; or a recorder records a bridge and its port.
TEST_F(AnalyseFile, FramesThatWereRecordedTwiceAreTakenOnce) {
    for (const std::uint32_t second : {0U, 1U}) {
        std::vector<Packet> packets;
        for (const auto& p : cycles_of(1, 0us, 1ms, 40)) {
            packets.push_back(p);
            packets.push_back({p.at + 1us, p.bytes, {.interface = second}});
        }
        const auto a = analyse_file(pcapng(packets));
        EXPECT_EQ(a.remark, "each frame was recorded twice: the second one is left out");
        expect_cycle(a, 1ms, 40);
        EXPECT_TRUE(a.others.empty());
    }
}

// A second tap, on an interface that has no frames of its own, has a part of the frames.
TEST_F(AnalyseFile, ATapThatHasOnlyCopiesIsNoOtherMaster) {
    std::vector<Packet> packets;
    for (const auto& p : cycles_of(1, 0us, 1ms, 40)) {
        packets.push_back(p);
        if (p.at / 1ms % 3 == 0) packets.push_back({p.at + 1us, p.bytes, {.interface = 1}});
    }
    const auto a = analyse_file(pcapng(packets));
    EXPECT_EQ(a.remark, "28 frames were recorded twice: the second one is left out");
    expect_cycle(a, 1ms, 40);
    EXPECT_TRUE(a.others.empty());
}

// Two taps record one segment, and either tap can be the first that records a frame.
TEST_F(AnalyseFile, TwoTapsAreOneMasterWhicheverIsFirst) {
    const auto cycles = cycles_of(1, 10us, 1ms, 40);
    const auto two_taps = [&](auto has_second, auto is_first) {
        std::vector<Packet> packets;
        for (std::size_t n = 0; n < cycles.size(); ++n) {
            packets.push_back(cycles[n]);
            if (has_second(n))
                packets.push_back({cycles[n].at + (is_first(n) ? -1us : 1us), cycles[n].bytes, {.interface = 1}});
        }
        return analyse_file(pcapng(in_order(packets)));
    };
    const auto all = [](std::size_t) { return true; };
    for (const std::size_t every : {1U, 2U, 3U, 20U}) {
        const auto a = two_taps(all, [&](std::size_t n) { return n % every == 0; });
        EXPECT_EQ(a.remark, "each frame was recorded twice: the second one is left out") << every;
        EXPECT_TRUE(a.others.empty()) << every;
        EXPECT_EQ(a.frames.requests, 40U) << every;
        EXPECT_EQ(a.frames.replies, 40U) << every;
        EXPECT_EQ(a.frames.lost + a.frames.late + a.frames.unasked, 0U) << every;
        EXPECT_FALSE(a.interface.has_value()) << every;
    }
    // The second tap records a third of the frames, and is the first for each of them.
    const auto a = two_taps([](std::size_t n) { return n / 2 % 3 == 0; }, all);
    EXPECT_EQ(a.remark, "28 frames were recorded twice: the second one is left out");
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.requests, 40U);
    EXPECT_EQ(a.frames.lost + a.frames.late + a.frames.unasked, 0U);
}

TEST_F(AnalyseFile, ThreeTapsAreThreeTimes) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    for (const std::uint32_t tap : {1U, 2U})
        for (auto p : cycles_of(1, 1us * tap, 1ms, 40)) {
            p.origin.interface = tap;
            packets.push_back(p);
        }
    const auto a = analyse_file(pcapng(in_order(packets)));
    EXPECT_EQ(a.remark, "160 copies of 80 frames, which were recorded up to 3 times, are left out");
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.requests, 40U);
    EXPECT_EQ(a.frames.lost + a.frames.late + a.frames.unasked, 0U);
}

// A kernel stamps the packets of a NIC in batches: several frames come before their copies.
TEST_F(AnalyseFile, CopiesBehindSeveralFramesAreFound) {
    std::vector<Packet> packets;
    for (int n = 0; n < 40; n += 4)
        for (const std::uint32_t interface : {0U, 1U})
            for (int frame = n; frame < n + 4; ++frame)
                for (const bool reply : {false, true})
                    packets.push_back({1ms * n + 1us * (frame - n) + 5us * interface,
                                       cycle_frame(1, reply, static_cast<std::uint8_t>(frame)),
                                       {.interface = interface}});
    const auto a = analyse_file(pcapng(packets));
    EXPECT_EQ(a.remark, "each frame was recorded twice: the second one is left out");
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.requests, 40U);
    EXPECT_EQ(a.frames.replies, 40U);
    EXPECT_EQ(a.frames.lost + a.frames.late + a.frames.unasked, 0U);
}

// The recording of the second tap was appended to the recording of the first tap. The copies are adjacent only in order
// of time.
TEST_F(AnalyseFile, CopiesBehindTheWholeRecordingAreFound) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    for (const auto& p : cycles_of(1, 1us, 1ms, 40)) packets.push_back(p);
    const auto a = analyse_file(pcap(packets));
    EXPECT_EQ(a.remark, "each frame was recorded twice: the second one is left out");
    expect_cycle(a, 1ms, 40);
}

// A recorder has a coarse clock, or two files were concatenated.
TEST_F(AnalyseFile, ARequestBehindItsReplyWithTheSameTimeIsNotLost) {
    for (const unsigned first_octet : {0U, 2U}) {  // 2: replies have no mark of their own
        std::vector<Packet> packets;
        for (int n = 0; n < 40; ++n) {
            const auto frame = [&](bool reply) {
                return cycle_frame(1, reply, static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(first_octet));
            };
            // The frames of two cycles have the same time, in any order.
            packets.insert(packets.begin() + n / 2 * 4 + (n % 2 == 0 ? 0 : n % 3), {1ms * (n / 2), frame(true)});
            packets.push_back({1ms * (n / 2), frame(false)});
        }
        const auto a = analyse_file(pcap(packets));
        EXPECT_EQ(a.remark, "") << first_octet;
        EXPECT_EQ(a.frames.requests, 40U) << first_octet;
        EXPECT_EQ(a.frames.replies, 40U) << first_octet;
        EXPECT_EQ(a.frames.answered, 40U) << first_octet;
        EXPECT_EQ(a.frames.lost + a.frames.unasked + a.frames.open, 0U) << first_octet;
    }
    // There are two taps, and the clock of one of them is some microseconds ahead.
    auto ahead = cycles_of(1, 10us, 1ms, 40);
    for (std::size_t n = 1; n < ahead.size(); n += 2) ahead[n].at = ahead[n - 1].at - 2us;
    const auto early = analyse_file(pcap(in_order(ahead)));
    EXPECT_EQ(early.frames.replies, 40U);
    EXPECT_EQ(early.frames.lost + early.frames.unasked, 0U);
    EXPECT_EQ(early.frames.shortest_trip, 0us);
    // A reply to a request before the recording has the same time as another request.
    const auto a = analyse_file(
        pcap({{0us, cycle_frame(1, true, 9)}, {0us, cycle_frame(1, false, 1)}, {30us, cycle_frame(1, true, 1)}}));
    EXPECT_EQ(a.frames.requests, 1U);
    EXPECT_EQ(a.frames.replies, 2U);
    EXPECT_EQ(a.frames.unasked, 1U);
    EXPECT_EQ(a.frames.lost, 0U);
}

// A few equal frames beside many other frames are not copies, and they still belong to a master.
TEST_F(AnalyseFile, FramesOfAnotherInterfaceAreNotLost) {
    std::vector<Packet> packets;
    for (const auto& p : cycles_of(1, 0us, 1ms, 40)) {
        packets.push_back(p);
        if (p.at / 1ms == 20) packets.push_back({p.at + 1us, p.bytes, {.interface = 1}});
    }
    const auto a = analyse_file(pcapng(packets));
    EXPECT_EQ(a.remark, "");
    ASSERT_EQ(a.others.size(), 1U);
    EXPECT_EQ(a.frames.ethercat + a.others[0].frames.ethercat, packets.size());
}

// Frames come back unchanged: from a loop without slaves, or to a master with a locally administered address, whose
// replies have no other mark.
TEST_F(AnalyseFile, FramesThatNobodyHasProcessedAreNotRecordedTwice) {
    for (const unsigned first_octet : {0U, 2U}) {
        std::vector<Packet> packets;
        for (int n = 0; n < 40; ++n) {
            const auto request =
                cycle_frame(1, false, static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(first_octet));
            packets.push_back({1ms * n, request});
            packets.push_back({1ms * n + 5us, request});
        }
        const auto a = analyse_file(pcap(packets));
        EXPECT_EQ(a.remark, "");
        EXPECT_EQ(a.frames.ethercat, packets.size());
    }
}

// The frames of a master are alike: their index and their data do not change.
TEST_F(AnalyseFile, EqualFramesOfACycleAreNotTakenForCopies) {
    std::vector<Packet> packets;
    for (int n = 0; n < 40; ++n) {
        packets.push_back({50us * n, cycle_frame(1, false, 0)});
        packets.push_back({50us * n + 10us, cycle_frame(1, true, 0)});
    }
    const auto a = analyse_file(pcap(packets));
    EXPECT_EQ(a.remark, "");
    expect_cycle(a, 50us, 40);
}

TEST_F(AnalyseFile, DamagedFramesAreNoMasters) {
    auto packets = cycles_of(1, 0us, 1ms, 40);
    auto damaged = cycle_frame(9, false, 1);
    damaged[22] = std::byte{0xFF};  // the length of the datagram
    packets.push_back({45ms, damaged});
    const auto a = analyse_file(pcap(packets));
    expect_cycle(a, 1ms, 40);
    EXPECT_EQ(a.frames.damaged, 1u);
    EXPECT_TRUE(a.others.empty());
}

// TwinCAT sends some frames with the address of the NIC, and the recorder sees only the replies to them.
TEST_F(AnalyseFile, FewFramesOfAnotherAddressAreOfTheSameMaster) {
    auto packets = cycles_of(1, 1ms, 1ms, 40);
    packets.insert(packets.begin(), {0us, cycle_frame(9, true, 200)});
    const auto a = analyse_file(pcap(packets));
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.replies, 41u);
    EXPECT_EQ(a.frames.unasked, 1u);
}

TEST_F(AnalyseFile, MastersBeyondTheLimitAreRemarked) {
    std::vector<Packet> packets;
    for (int n = 0; n < static_cast<int>(kMostMasters) + 2; ++n)
        packets = packets + cycles_of(static_cast<std::uint8_t>(n), 1ms * n, 1ms, 1);
    const auto a = analyse_file(pcap(packets));
    EXPECT_EQ(a.others.size(), kMostMasters - 1);
    EXPECT_NE(a.remark.find("frames of more than 16 masters: 4 are not analysed"), std::string::npos) << a.remark;
}

// dumpcap writes these statistics after the packets. The last statistics of an interface are used.
TEST_F(AnalyseFile, SaysWhatTheRecorderHasDropped) {
    const auto path = pcapng(cycles_of(1, 0ms, 1ms, 20));
    EXPECT_EQ(analyse_file(path).remark, "");
    const auto statistics = [&](std::uint32_t interface, std::uint64_t by_interface, std::uint64_t by_system) {
        std::vector<std::byte> block(60);
        store_le(MutableBytes(block), 0, std::uint32_t{5});
        store_le(MutableBytes(block), 4, std::uint32_t{60});
        store_le(MutableBytes(block), 8, interface);
        store_le(MutableBytes(block), 20, std::uint32_t{8 << 16 | 4});  // received
        store_le(MutableBytes(block), 24, std::uint64_t{1'000'000});
        store_le(MutableBytes(block), 32, std::uint32_t{8 << 16 | 5});
        store_le(MutableBytes(block), 36, by_interface);
        store_le(MutableBytes(block), 44, std::uint32_t{8 << 16 | 7});
        store_le(MutableBytes(block), 48, by_system);
        store_le(MutableBytes(block), 56, std::uint32_t{60});  // the options end with the block
        std::ofstream(path, std::ios::binary | std::ios::app)
            .write(reinterpret_cast<const char*>(block.data()), static_cast<std::streamsize>(block.size()));
    };
    statistics(0, 0, 0);
    statistics(1, 0, 0);
    EXPECT_EQ(analyse_file(path).frames.dropped, 0U);
    EXPECT_EQ(analyse_file(path).remark, "");
    statistics(0, 3, 1);
    statistics(1, 0x1'0000'0000, 0);
    statistics(0, 5, 1);
    const auto a = analyse_file(path);
    EXPECT_EQ(a.frames.dropped, 0x1'0000'0006U);
    EXPECT_EQ(a.remark, "the recorder has dropped 4294967302 packets: what seems to be lost may have been on the wire");
    EXPECT_EQ(a.frames.requests, 20U);
}

TEST_F(AnalyseFile, APipeIsReadAsAWhole) {
    const auto path = pcapng(cycles_of(1, 0us, 1ms, 400));
    const auto pipe = folder.file("pipe");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    std::thread writer([&] { std::ofstream(pipe, std::ios::binary) << std::ifstream(path, std::ios::binary).rdbuf(); });
    const auto a = analyse_file(pipe);
    writer.join();
    EXPECT_EQ(a.problem, "");
    EXPECT_EQ(a.frames.packets, 800u);
    EXPECT_NE(analyse_file("/dev/zero").problem, "") << "it has no end";
}

}  // namespace
}  // namespace margay::analyse
