// Filters around a scripted NIC, in virtual time.
#include "oshw/filters/corrupt_nic.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/filters/duplicate_nic.hpp"
#include "oshw/filters/holding_nic.hpp"
#include "oshw/filters/trace_nic.hpp"
#include "scripted_nic.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <memory>
#include <string>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct FiltersTest : testing::Test {
    VirtualOsal clock{Time(1s)};
    ScriptedNic inner{clock};

    void arrive_now(int count) {
        for (int i = 0; i < count; ++i) inner.arrive(clock.now(), frame_of(i % 256));
    }
};

TEST_F(FiltersTest, APlainFilterPassesEverythingOn) {
    DropNic filter(inner, {});
    EXPECT_EQ(filter.source_mac(), inner.source_mac());
    EXPECT_EQ(filter.wait_handle(), 77);
    EXPECT_EQ(filter.last_error(), 99);
    inner.link = LinkState::down;
    EXPECT_EQ(filter.link_state(), LinkState::down);
    inner.arrive(Time(3s), frame_of(1));
    EXPECT_EQ(filter.next_arrival(), Time(3s));
    inner.status = SendStatus::busy;
    EXPECT_EQ(filter.send(frame_of(1)), SendStatus::busy);
    inner.status = SendStatus::failed;
    EXPECT_EQ(filter.send(frame_of(1)), SendStatus::failed);
    inner.status = SendStatus::sent;
    EXPECT_EQ(filter.send(frame_of(9)), SendStatus::sent);
    EXPECT_EQ(inner.sent, std::vector<Frame>{frame_of(9)});
}

TEST_F(FiltersTest, DropLosesAboutAsManyAsTold) {
    DropNic filter(inner, {.seed = 7, .sent = Rate::percent(10), .received = Rate::percent(30)});
    for (int i = 0; i < 10'000; ++i) ASSERT_EQ(filter.send(frame_of(0)), SendStatus::sent);
    EXPECT_NEAR(static_cast<double>(inner.sent.size()), 9000, 200);
    const auto lost_sending = filter.dropped();
    EXPECT_EQ(lost_sending + inner.sent.size(), 10'000u);
    arrive_now(10'000);
    const auto received = receive_all(filter).size();
    EXPECT_NEAR(static_cast<double>(received), 7000, 300);
    EXPECT_EQ(filter.dropped() - lost_sending + received, 10'000u);
}

TEST_F(FiltersTest, DropOfAllAndOfNothing) {
    DropNic all(inner, {.sent = Rate::always(), .received = Rate::always()});
    arrive_now(3);
    EXPECT_EQ(all.send(frame_of(0)), SendStatus::sent);
    EXPECT_TRUE(inner.sent.empty());
    EXPECT_TRUE(receive_all(all).empty());
    DropNic nothing(inner, {});
    arrive_now(100);
    EXPECT_EQ(receive_all(nothing).size(), 100u);
}

TEST_F(FiltersTest, TheSameSeedGivesTheSameRun) {
    const auto run = [&](std::uint64_t seed) {
        DropNic filter(inner, {.seed = seed, .received = Rate::percent(50)});
        arrive_now(200);
        return receive_all(filter);
    };
    EXPECT_EQ(run(3), run(3));
    EXPECT_NE(run(3), run(4));
}

TEST_F(FiltersTest, CorruptTurnsFewBitsOverAndSparesTheHeader) {
    CorruptNic filter(inner, {.seed = 5, .received = Rate::percent(50), .max_flips = 3, .from_octet = 14});
    for (int i = 0; i < 1000; ++i) inner.arrive(clock.now(), frame_of(0));
    std::uint64_t changed = 0;
    for (const auto& frame : receive_all(filter)) {
        ASSERT_EQ(frame.size(), 60u);
        int bits = 0;
        for (std::size_t i = 0; i < frame.size(); ++i) {
            bits += std::popcount(std::to_integer<unsigned>(frame[i]));
            if (i < 14) {
                ASSERT_EQ(frame[i], std::byte{0});
            }
        }
        ASSERT_LE(bits, 3);
        changed += bits != 0 ? 1u : 0u;  // two flips of the same bit cancel each other
    }
    EXPECT_NEAR(static_cast<double>(changed), 500, 80);
    EXPECT_LE(changed, filter.corrupted());
}

TEST_F(FiltersTest, CorruptLeavesTheFrameOfTheSenderAlone) {
    CorruptNic filter(inner, {.sent = Rate::always()});
    const auto frame = frame_of(0x55);
    EXPECT_EQ(filter.send(frame), SendStatus::sent);
    EXPECT_EQ(frame, frame_of(0x55));
    ASSERT_EQ(inner.sent.size(), 1u);
    EXPECT_NE(inner.sent[0], frame);
}

TEST_F(FiltersTest, CorruptSurvivesFramesOfEveryLength) {
    CorruptNic filter(inner, {.sent = Rate::always(), .received = Rate::always(), .cut = Rate::percent(50)});
    for (std::size_t size = 0; size <= 1600; ++size) {
        ASSERT_EQ(filter.send(frame_of(1, size)), SendStatus::sent);
        ASSERT_LE(inner.sent.back().size(), size);
        if (size == 0) continue;
        inner.arrive(clock.now(), frame_of(1, size));
        const auto received = receive_all(filter);
        ASSERT_EQ(received.size(), 1u) << "a cut to nothing would read as no frame";
        ASSERT_LE(received[0].size(), size);
    }
}

TEST_F(FiltersTest, DuplicateDeliversTwiceInARow) {
    DuplicateNic filter(inner, {.sent = Rate::always(), .received = Rate::always()});
    inner.arrive(clock.now(), frame_of(1));
    inner.arrive(clock.now() + 1s, frame_of(2));
    Frame buffer(1518);
    ASSERT_EQ(filter.receive(buffer), 60u);
    EXPECT_LE(filter.next_arrival(), clock.now());
    ASSERT_EQ(filter.receive(buffer), 60u);
    EXPECT_EQ(buffer[0], std::byte{1});
    EXPECT_EQ(filter.receive(buffer), 0u);
    EXPECT_EQ(filter.next_arrival(), clock.now() + 1s);
    EXPECT_EQ(filter.send(frame_of(3)), SendStatus::sent);
    EXPECT_EQ(inner.sent, (std::vector<Frame>{frame_of(3), frame_of(3)}));
    EXPECT_EQ(filter.duplicated(), 2u);
}

TEST_F(FiltersTest, DelayKeepsTheOrderAndTheBounds) {
    std::array<HeldFrame, 64> memory;
    DelayNic filter(inner, clock, memory, {.seed = 9, .delay = 100us, .jitter = 50us});
    for (int i = 0; i < 50; ++i) inner.arrive(clock.now() + i * 10us, frame_of(i));
    const auto start = clock.now();
    const auto all = run_dry(filter, clock);
    ASSERT_EQ(all.size(), 50u);
    bool jittered = false;
    for (int i = 0; i < 50; ++i) {
        const auto& [at, frame] = all[static_cast<std::size_t>(i)];
        EXPECT_EQ(frame, frame_of(i));
        EXPECT_GE(at - start, i * 10us + 100us);
        EXPECT_LE(at - start, i * 10us + 150us);
        jittered = jittered || at - start != i * 10us + 100us;
    }
    EXPECT_TRUE(jittered);
    EXPECT_EQ(filter.lost(), 0u);
}

TEST_F(FiltersTest, DelayWithoutRoomLosesAndCounts) {
    std::array<HeldFrame, 2> memory;
    DelayNic filter(inner, clock, memory, {.delay = 1ms});
    arrive_now(5);
    EXPECT_TRUE(receive_all(filter).empty());
    EXPECT_EQ(filter.lost(), 3u);
    const auto all = run_dry(filter, clock);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[1].second, frame_of(1));
}

TEST_F(FiltersTest, ReorderLetsOthersOvertake) {
    std::array<HeldFrame, 256> memory;
    ReorderNic filter(inner, clock, memory, {.seed = 2, .rate = Rate::percent(20), .hold = 35us});
    for (int i = 0; i < 200; ++i) inner.arrive(clock.now() + i * 10us, frame_of(i));
    std::vector<int> order;
    for (const auto& [at, frame] : run_dry(filter, clock)) order.push_back(std::to_integer<int>(frame[0]));
    EXPECT_NEAR(static_cast<double>(filter.held()), 40, 20);
    EXPECT_FALSE(std::is_sorted(order.begin(), order.end()));
    std::sort(order.begin(), order.end());
    for (int i = 0; i < 200; ++i) EXPECT_EQ(order[static_cast<std::size_t>(i)], i);  // all frames, each once
    EXPECT_EQ(order.size(), 200u);
}

struct Lines final : TraceSink {
    void line(std::string_view text) noexcept override { all.emplace_back(text); }
    std::vector<std::string> all;
};

TEST_F(FiltersTest, TraceShowsEveryDatagramOnce) {
    Lines lines;
    TraceNic filter(inner, clock, lines);
    std::array<std::byte, 100> buffer{};
    wire::FrameBuilder builder(buffer, {1, 1, 1, 1, 1, 1});
    (void)builder.append(wire::Command::BRD, 1, wire::DatagramAddress(0), 1);
    builder.append(wire::Command::FPWR, 2, {StationAddress{0x1001}, 0x0120}, 2)[0] = std::byte{4};
    const auto built = builder.finish();
    const Frame frame(built.begin(), built.end());
    ASSERT_EQ(filter.send(frame), SendStatus::sent);
    clock.advance(1500ns);
    inner.arrive(clock.now(), frame);
    inner.arrive(clock.now(), Frame(frame.begin(), frame.begin() + 20));
    EXPECT_EQ(receive_all(filter).size(), 2u);
    ASSERT_EQ(lines.all.size(), 5u);
    EXPECT_EQ(lines.all[0], "1.000000000 tx 1 0x01 BRD  0:0x0000 type                      n1 wkc 0 : 00");
    EXPECT_EQ(lines.all[1], "1.000000000 tx 1 0x02 FPWR 0x1001:0x0120 AL control           n2 wkc 0 : 04 00");
    EXPECT_EQ(lines.all[2].substr(0, 16), "1.000001500 rx 1");
    EXPECT_EQ(lines.all[4], "1.000001500 rx 2 20 octets: a length points past the end");
    inner.status = SendStatus::busy;
    EXPECT_EQ(filter.send(frame), SendStatus::busy);
    EXPECT_EQ(lines.all[5].substr(0, 21), "1.000001500 tx busy 2");
}

TEST_F(FiltersTest, TraceSurvivesNoiseOfEveryLength) {
    Lines lines;
    TraceNic filter(inner, clock, lines);
    Chance chance(11);
    for (std::size_t size = 0; size <= 1600; ++size) {
        Frame noise(size);
        for (auto& octet : noise) octet = static_cast<std::byte>(chance.next());
        if (size > 14) noise[12] = std::byte{0x88}, noise[13] = std::byte{0xA4};
        const auto before = lines.all.size();
        ASSERT_EQ(filter.send(noise), SendStatus::sent);
        ASSERT_GT(lines.all.size(), before);
        ASSERT_EQ(inner.sent.back(), noise);
    }
}

TEST_F(FiltersTest, FiltersStack) {
    // Four filters around one NIC, as in a stress test: every frame that is not dropped arrives, duplicates included.
    std::array<HeldFrame, 512> late;
    std::array<HeldFrame, 512> mixed;
    DropNic drop(inner, {.seed = 1, .received = Rate::percent(5)});
    DuplicateNic twice(drop, {.seed = 2, .received = Rate::percent(5)});
    DelayNic delay(twice, clock, late, {.seed = 3, .delay = 20us, .jitter = 5us});
    ReorderNic reorder(delay, clock, mixed, {.seed = 4, .rate = Rate::percent(5), .hold = 100us});
    for (int i = 0; i < 200; ++i) inner.arrive(clock.now() + i * 1us, frame_of(i));
    const auto all = run_dry(reorder, clock);
    EXPECT_EQ(all.size(), 200 - drop.dropped() + twice.duplicated());
    EXPECT_GT(drop.dropped(), 0u);
    EXPECT_GT(twice.duplicated(), 0u);
}

}  // namespace
}  // namespace margay
