// Frames that were recorded twice, by two taps or a mirror port, and frames that only look like copies.
#include "analyse/twins.hpp"

#include <places.hpp>
#include "analyse/recording.hpp"
#include "oshw/pcap/packet_reader.hpp"
#include "oshw/pcap/pcapng.hpp"
#include "replay/files.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>

namespace margay::analyse::twins {
namespace {

using namespace std::chrono_literals;
using wire::Command;

// A cyclic frame of a master, or the reply to it. In a reply, the slaves have set the first octet.
Frame cycle_frame(bool reply, int index, std::uint8_t data = 0) {
    Frame buffer(wire::kMaxFrameBytes);
    wire::FrameBuilder builder(buffer, {static_cast<std::uint8_t>(reply ? 2 : 0), 0x11, 0x22, 0x33, 0x44, 0x55});
    (void)builder.append(Command::LRW, static_cast<std::uint8_t>(index), wire::DatagramAddress(0x10000), 8);
    if (reply) store_le<std::uint16_t>(MutableBytes(buffer), builder.size() - 2, 3);
    if (reply) buffer[wire::kFramePrefixBytes + wire::kDatagramHeaderBytes] = std::byte{data};
    buffer.resize(builder.finish().size());
    return buffer;
}

struct Packet {
    Duration at{};
    Frame bytes{};
    std::uint32_t interface = 0;
};
using Packets = std::vector<Packet>;

Packets operator+(Packets a, const Packets& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

Packets in_order(Packets all) {
    std::ranges::stable_sort(all, {}, &Packet::at);
    return all;
}

constexpr int kCycles = 200;

// Requests and replies with the cycle of a busy segment.
Packets cycles(std::uint8_t data = 0) {
    Packets all;
    for (int n = 0; n < kCycles; ++n) {
        all.push_back({1ms * n, cycle_frame(false, n)});
        all.push_back({1ms * n + 30us, cycle_frame(true, n, data)});
    }
    return all;
}

// The same packets, as another interface records them.
Packets tap(Packets all, std::uint32_t interface, Duration after) {
    for (auto& p : all) {
        p.interface = interface;
        p.at += after;
    }
    return all;
}

struct AnalyseTwins : testing::Test {
    TemporaryFolder folder;

    Analysis analyse(const Packets& packets) {
        const auto path = folder.file("twins.pcapng");
        PcapngWriter writer;
        const std::array<std::string_view, 3> names{"a", "b", "c"};
        EXPECT_TRUE(writer.open(path, names));
        for (const auto& p : packets) writer.write({.interface = p.interface}, 1s + p.at, p.bytes);
        EXPECT_TRUE(writer.close());
        return analyse_file(path);
    }
};

void expect_counts(const Analysis& a, std::uint64_t requests, std::uint64_t replies, std::uint64_t lost) {
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.requests, requests);
    EXPECT_EQ(a.frames.replies, replies);
    EXPECT_EQ(a.frames.lost, lost);
    EXPECT_EQ(a.frames.unasked + a.frames.late + a.frames.open, 0U);
    EXPECT_TRUE(a.remark.starts_with("each frame was recorded twice: the second one is left out")) << a.remark;
}

// A recorder of several interfaces writes the packets of one interface, then the packets of the other interface.
TEST_F(AnalyseTwins, TheOrderOfTheFileIsNotThatOfTheTime) {
    const auto first = cycles();
    for (const auto after : {1us, -1us}) {
        const auto second = tap(first, 1, after);
        for (const std::size_t batch : {3U, 8U, 100U, 1000U}) {
            SCOPED_TRACE(batch);
            Packets all;
            for (std::size_t n = 0; n < first.size(); n += batch)
                for (const auto* part : {&first, &second})
                    for (std::size_t k = n; k < std::min(n + batch, first.size()); ++k) all.push_back((*part)[k]);
            expect_counts(analyse(all), kCycles, kCycles, 0);
        }
    }
}

TEST_F(AnalyseTwins, ALateCopyIsNoFrameOfItsOwn) {
    for (const std::uint32_t late : {0U, 1U}) {
        Packets all = cycles() + tap(cycles(), 1, 2us);
        for (std::size_t n = 0; n < all.size(); ++n)
            if (all[n].interface == late && n % 100 == 60 + late) all[n].at += 50us;
        expect_counts(analyse(in_order(all)), kCycles, kCycles, 0);
    }
}

// The file has no interfaces.
TEST_F(AnalyseTwins, ALateCopyOfAMirrorPortIsNoFrameOfItsOwn) {
    Packets all = cycles() + tap(cycles(), 0, 2us);
    for (std::size_t n = kCycles * 2; n < all.size(); n += 53) all[n].at += 50us;
    expect_counts(analyse(in_order(all)), kCycles, kCycles, 0);
}

TEST_F(AnalyseTwins, WhatIsReallyLostIsLost) {
    auto first = cycles();
    first.erase(first.begin() + 2 * 100 + 1);  // a reply that no tap has seen
    auto second = tap(first, 1, 1us);
    first.erase(first.begin() + 2 * 50);  // a reply that only one tap has recorded is not lost
    second.erase(second.begin() + 2 * 70 + 1);
    expect_counts(analyse(in_order(first + second)), kCycles, kCycles - 1, 1);
    expect_counts(analyse(first + second), kCycles, kCycles - 1, 1);
}

TEST_F(AnalyseTwins, ARequestThatWasSentAgainIsNoCopy) {
    auto first = cycles();
    for (int n = 0; n < kCycles; n += 20) {
        // Only the second tap gets the reply.
        first[static_cast<std::size_t>(2 * n + 1)].at += 300us;
        first.push_back({1ms * n + 300us, cycle_frame(false, n)});
    }
    const auto again = static_cast<std::uint64_t>(kCycles / 20);
    const auto alone = analyse(in_order(first));
    EXPECT_EQ(alone.remark, "");
    for (const auto& a : {alone, analyse(in_order(first + tap(first, 1, 3us))), analyse(first + tap(first, 1, 3us))}) {
        EXPECT_TRUE(a.others.empty());
        EXPECT_EQ(a.frames.requests, kCycles + again);
        EXPECT_EQ(a.frames.replies, std::uint64_t{kCycles});
        EXPECT_EQ(a.frames.lost + a.frames.open, again);
    }
}

// One tap begins while the other tap is recording, and ends after it.
TEST_F(AnalyseTwins, TapsMayHaveDifferentTimes) {
    const auto whole = cycles();
    const Packets begin(whole.begin(), whole.begin() + kCycles * 4 / 3);
    const Packets end(whole.begin() + kCycles * 2 / 3, whole.end());
    const auto a = analyse(in_order(begin + tap(end, 1, 1us)));
    EXPECT_TRUE(a.others.empty());
    EXPECT_EQ(a.frames.requests, std::uint64_t{kCycles});
    EXPECT_EQ(a.frames.replies, std::uint64_t{kCycles});
    EXPECT_EQ(a.frames.lost + a.frames.unasked, 0U);
}

// One tap has an interface for each direction, and there is another tap beside it. A request alone has no working
// counter.
TEST_F(AnalyseTwins, ATapOfEachDirectionBesideAnotherOne) {
    auto first = cycles();
    for (std::size_t n = 1; n < first.size(); n += 2) first[n].interface = 1;
    expect_counts(analyse(first + tap(cycles(), 2, 1us)), kCycles, kCycles, 0);
}

// The same program works on two interfaces. The requests are equal, and most of the replies are equal.
TEST_F(AnalyseTwins, TwoLikeSegmentsAreTwoMasters) {
    for (const int every : {1, 10}) {
        Packets second;
        for (int n = 0; n < kCycles; ++n) {
            second.push_back({1ms * n + 10us, cycle_frame(false, n), 1});
            second.push_back({1ms * n + 40us, cycle_frame(true, n, n % every == 0 ? 7 : 0), 1});
        }
        const auto a = analyse(in_order(cycles() + second));
        EXPECT_EQ(a.remark, "") << every;
        ASSERT_EQ(a.others.size(), 1U) << every;
        for (const auto* one : {&a, &a.others[0]}) {
            EXPECT_EQ(one->frames.requests, std::uint64_t{kCycles});
            EXPECT_EQ(one->frames.replies, std::uint64_t{kCycles});
            EXPECT_EQ(one->frames.lost + one->frames.unasked, 0U);
        }
    }
}

// Both NICs have one address. In a closed ring, a frame of the second NIC arrives at the first NIC unchanged. In a
// broken ring, each NIC gets the answers of some slaves.
TEST_F(AnalyseTwins, BothNicsOfARingAreNoTaps) {
    for (const bool broken : {false, true}) {
        Packets all;
        for (int n = 0; n < kCycles; ++n) {
            all.push_back({1ms * n, cycle_frame(false, n), 0});
            all.push_back({1ms * n + 2us, cycle_frame(false, n), 1});
            all.push_back({1ms * n + 30us, cycle_frame(true, n, 1), broken ? 0U : 1U});
            all.push_back({1ms * n + 32us, broken ? cycle_frame(true, n, 2) : cycle_frame(false, n), broken ? 1U : 0U});
        }
        Twins twins;
        for (std::size_t n = 0; n < all.size(); ++n) twins.look(n + 1, all[n].at, all[n].bytes, all[n].interface);
        twins.decide();
        EXPECT_EQ(twins.common(1), 1U) << broken;
        EXPECT_EQ(twins.copies(), 0U) << broken;
    }
}

// A VLAN tag, padding and a check sequence do not matter for the comparison. A copy in a long file may be in the next
// part of the file.
TEST(Twins, ALongFileIsLookedAtInParts) {
    const auto first = cycles();
    for (const bool in_time : {true, false}) {
        auto all = first;
        for (auto& p : all) p.at *= 100;  // 20 frames per second
        all = all + tap(all, 1, 1us);
        if (in_time) all = in_order(all);
        for (auto& p : all)
            if (p.interface == 1) p.bytes.resize(p.bytes.size() + 4, std::byte{0x5A});
        Twins twins(100);
        for (std::size_t n = 0; n < all.size(); ++n) twins.look(n + 1, all[n].at, all[n].bytes, all[n].interface);
        twins.decide();
        EXPECT_EQ(twins.common(1), in_time ? 0U : 1U);
        EXPECT_EQ(twins.copies(), in_time ? first.size() : 0U);
        EXPECT_EQ(twins.missed() == 0, in_time);
        for (std::size_t n = 0; in_time && n < all.size(); ++n)
            EXPECT_EQ(twins.is_left_out(n + 1), all[n].interface == 1) << n;
    }
}

// Recordings of real segments, with an added second interface that has the same frames.
TEST_F(AnalyseTwins, RealRecordingsWithASecondTapAreTheSame) {
    if (std::string(MARGAY_CAPTURES_DIR).empty()) GTEST_SKIP() << "no captures of real segments";
    std::size_t checked = 0;
    for (const auto& entry : std::filesystem::directory_iterator(MARGAY_CAPTURES_DIR)) {
        if (entry.path().extension() != ".pcapng") continue;
        SCOPED_TRACE(entry.path().filename());
        const auto alone = analyse_file(entry.path());
        if (alone.slaves.empty()) continue;  // frames that no slave has processed do not show copies
        Packets first, second;
        std::mt19937 chance(1);
        PacketReader reader;
        ASSERT_TRUE(reader.open(entry.path()));
        while (const auto p = reader.next()) {
            first.push_back({p->at, {p->bytes.begin(), p->bytes.end()}});
            second.push_back({p->at + 1us * (chance() % 100 == 0 ? 50 : chance() % 12), first.back().bytes, 1});
        }
        for (const auto& both : {first + second, in_order(first + second)}) {
            const auto a = analyse(both);
            EXPECT_EQ(a.frames.requests, alone.frames.requests);
            EXPECT_EQ(a.frames.replies, alone.frames.replies);
            EXPECT_EQ(a.frames.lost, alone.frames.lost);
            EXPECT_EQ(a.frames.unasked, alone.frames.unasked);
            EXPECT_EQ(a.frames.late, alone.frames.late);
            EXPECT_EQ(a.others.size(), alone.others.size());
            EXPECT_EQ(a.slaves.size(), alone.slaves.size());
            EXPECT_EQ(a.conversations.items.size(), alone.conversations.items.size());
        }
        ++checked;
    }
    EXPECT_GT(checked, 0U);
}

}  // namespace
}  // namespace margay::analyse::twins
