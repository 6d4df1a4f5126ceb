// Recordings of both NICs of a ring: the analyser merges copies into one frame, and parts of a reply into one reply.
#include "analyse/ring_copies.hpp"

#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <vector>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;
using Direction = PacketOrigin::Direction;

constexpr std::byte kFirst{0x59};
constexpr std::byte kSecond{0x58};

// A frame with one datagram of four octets: LRW, index, address 0x01000000, data, working counter.
std::vector<std::byte> frame(std::byte mac, bool marked, std::uint8_t index, std::vector<std::uint8_t> data,
                             std::uint16_t wkc) {
    std::vector<std::byte> all(60);
    for (std::size_t n = 0; n < 6; ++n) all[n] = std::byte{0xFF};
    all[6] = marked ? std::byte{2} : std::byte{0};
    all[11] = mac;
    all[12] = std::byte{0x88};
    all[13] = std::byte{0xA4};
    store_le<std::uint16_t>(all, 14, 0x1000 | 16);
    all[16] = std::byte{0x0C};
    all[17] = std::byte{index};
    store_le<std::uint32_t>(all, 18, 0x0100'0000);
    store_le<std::uint16_t>(all, 22, 4);
    for (std::size_t n = 0; n < data.size(); ++n) all[26 + n] = std::byte{data[n]};
    store_le<std::uint16_t>(all, 30, wkc);
    return all;
}

struct Ring {
    std::vector<std::vector<std::byte>> out{};
    std::vector<Duration> at{};
    RingCopies copies{[this](Moment when, Bytes packet, std::size_t) {
        out.emplace_back(packet.begin(), packet.end());
        at.push_back(when.at);
    }};
    Duration now{0};
    std::uint64_t number = 0;
    void see(std::uint32_t interface, Direction direction, const std::vector<std::byte>& bytes, Duration after = 10us) {
        now += after;
        copies.packet({.interface = interface, .direction = direction}, {++number, now}, bytes, bytes.size());
    }
    void send(std::uint8_t index, const std::vector<std::uint8_t>& data) {
        see(0, Direction::sent, frame(kFirst, false, index, data, 0));
        see(1, Direction::sent, frame(kSecond, false, index, data, 0));
    }
};

TEST(RingCopies, InAWholeRingTheFirstCopyHasTheReply) {
    Ring ring;
    ring.send(7, {1, 2, 0, 0});
    ring.see(0, Direction::received, frame(kSecond, false, 7, {1, 2, 0, 0}, 0));
    ring.see(1, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 4}, 6));
    ring.copies.finish();
    ASSERT_EQ(ring.out.size(), 2U);
    EXPECT_EQ(ring.out[0], frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
    EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 4}, 6));
    EXPECT_EQ(ring.copies.merged(), 2U);
}

TEST(RingCopies, InABrokenRingBothPartsAreOneReply) {
    for (const bool second_first : {false, true}) {
        Ring ring;
        ring.send(7, {1, 2, 0, 0});
        const auto first = [&] { ring.see(0, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 0}, 3)); };
        const auto second = [&] { ring.see(1, Direction::received, frame(kSecond, true, 7, {1, 2, 0, 4}, 6)); };
        second_first ? second() : first();
        EXPECT_EQ(ring.out.size(), 0U) << "the other part may come";
        second_first ? first() : second();
        ASSERT_EQ(ring.out.size(), 2U);
        EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 4}, 9));
    }
}

// The analyser waits for the other part until the index is used again, because the master may wait for the part, too.
TEST(RingCopies, APartWhoseOtherPartIsLostIsTheReply) {
    Ring ring;
    ring.send(7, {1, 2, 0, 0});
    ring.see(0, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 0}, 3));
    ring.send(8, {1, 2, 0, 0});
    ring.see(0, Direction::received, frame(kFirst, true, 8, {1, 2, 3, 0}, 3), 600us);
    EXPECT_TRUE(ring.out.empty()) << "it may still come";
    ring.see(1, Direction::received, frame(kSecond, true, 8, {1, 2, 0, 4}, 6), 10ms);
    for (unsigned n = 9; n < 9 + 256; ++n) ring.send(static_cast<std::uint8_t>(n), {1, 2, 0, 0});
    ASSERT_GE(ring.out.size(), 4U);
    EXPECT_EQ(ring.out[0], frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
    EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 0}, 3));
    EXPECT_EQ(ring.out[2], frame(kFirst, false, 8, {1, 2, 0, 0}, 0));
    EXPECT_EQ(ring.out[3], frame(kFirst, true, 8, {1, 2, 3, 4}, 9)) << "its part has come late";
}

// A master repeats a frame that does not come back, and later all of these frames come back.
TEST(RingCopies, RepeatedFramesHaveTheirReplies) {
    Ring ring;
    for (int n = 0; n < 3; ++n) ring.see(0, Direction::sent, frame(kFirst, false, 7, {1, 2, 0, 0}, 0), 20ms);
    for (int n = 0; n < 3; ++n) ring.see(1, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 4}, 6));
    ring.send(8, {1, 2, 0, 0});
    ring.copies.finish();
    ASSERT_EQ(ring.out.size(), 7U);
    for (std::size_t n = 0; n < 3; ++n) {
        EXPECT_EQ(ring.out[n], frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
        EXPECT_EQ(ring.out[n + 3], frame(kFirst, true, 7, {1, 2, 3, 4}, 6));
    }
}

TEST(RingCopies, PartsThatComeFarApartAreOneReplyInItsOrder) {
    Ring ring;
    ring.send(7, {1, 2, 0, 0});
    ring.see(0, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 0}, 3));
    ring.see(1, Direction::received, frame(kSecond, true, 7, {1, 2, 0, 4}, 6), 4ms);
    ASSERT_EQ(ring.out.size(), 2U);
    EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 4}, 9));
    EXPECT_EQ(ring.at[1], 4ms + 30us);
}

// The cable of the first NIC is broken: only the second NIC reaches the slaves.
TEST(RingCopies, ASecondCopyThatComesBackAloneAnswersTheRequest) {
    Ring ring;
    for (std::uint8_t index = 1; index <= 3; ++index) {
        ring.send(index, {1, 2, 0, 0});
        ring.see(1, Direction::received, frame(kSecond, true, index, {1, 2, 3, 4}, 9));
    }
    ring.copies.finish();
    ASSERT_EQ(ring.out.size(), 6U);
    for (std::uint8_t index = 1; index <= 3; ++index) {
        EXPECT_EQ(ring.out[2U * index - 2], frame(kFirst, false, index, {1, 2, 0, 0}, 0));
        EXPECT_EQ(ring.out[2U * index - 1], frame(kFirst, true, index, {1, 2, 3, 4}, 9));
    }
    EXPECT_TRUE(std::ranges::is_sorted(ring.at));
}

// The program was interrupted between sending the two copies.
TEST(RingCopies, CopiesThatAreSentFarApartAreOneRequest) {
    Ring ring;
    ring.see(0, Direction::sent, frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
    ring.see(1, Direction::sent, frame(kSecond, false, 7, {1, 2, 0, 0}, 0), 50ms);
    ring.see(1, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 4}, 9));
    ring.copies.finish();
    EXPECT_EQ(ring.out.size(), 2U);
}

// The first NIC is at the end of the ring, and its copy may be sent after the other copy.
TEST(RingCopies, TheSecondNicCanBeTheBeginningOfTheRing) {
    for (const bool second_first : {false, true}) {
        Ring ring;
        const auto first = [&] { ring.see(0, Direction::sent, frame(kFirst, false, 7, {1, 2, 0, 0}, 0)); };
        const auto second = [&] { ring.see(1, Direction::sent, frame(kSecond, false, 7, {1, 2, 0, 0}, 0)); };
        second_first ? second() : first();
        second_first ? first() : second();
        ring.see(1, Direction::received, frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
        ring.see(0, Direction::received, frame(kSecond, true, 7, {1, 2, 3, 4}, 9));
        ASSERT_EQ(ring.out.size(), 2U);
        EXPECT_EQ(ring.out[0], frame(kFirst, false, 7, {1, 2, 0, 0}, 0));
        EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 4}, 9));
    }
}

// The broadcast counts the slaves on both sides. Only the first copy carries the time.
TEST(RingCopies, PositionsAreAddedAndTheTimeIsThatOfOneCopy) {
    const auto of = [](std::byte mac, bool marked, wire::Command clock, std::array<std::uint16_t, 4> values) {
        std::vector<std::byte> all(wire::kMaxFrameBytes);
        wire::FrameBuilder builder(
            all, {static_cast<std::uint8_t>(marked ? 2 : 0), 0, 0, 0, 0, std::to_integer<std::uint8_t>(mac)});
        const auto [passed, state, time, wkc] = values;
        const auto status = builder.append(wire::Command::BRD, 7, wire::DatagramAddress(passed, 0x0130), 2);
        store_le(status, 0, state);
        store_le(MutableBytes(all), builder.size() - 2, passed);
        const auto now = builder.append(clock, 7, wire::DatagramAddress(0x1001, 0x0910), 4);
        store_le(now, 0, time);
        store_le(MutableBytes(all), builder.size() - 2, wkc);
        all.resize(builder.finish().size());
        return all;
    };
    using wire::Command;
    Ring ring;
    ring.see(0, Direction::sent, of(kFirst, false, Command::FRMW, {0, 0, 0, 0}));
    ring.see(1, Direction::sent, of(kSecond, false, Command::NOP, {0, 0, 0, 0}));
    ring.see(0, Direction::received, of(kFirst, true, Command::FRMW, {2, 0x0008, 77, 2}));
    ring.see(1, Direction::received, of(kSecond, true, Command::NOP, {6, 0x0004, 0, 0}));
    // The cable of the first NIC is broken, so the second copy carries the time.
    ring.see(0, Direction::sent, of(kFirst, false, Command::NOP, {0, 0, 0, 0}));
    ring.see(1, Direction::sent, of(kSecond, false, Command::FRMW, {0, 0, 0, 0}));
    ring.see(1, Direction::received, of(kSecond, true, Command::FRMW, {8, 0x0004, 99, 8}));
    ring.copies.finish();
    ASSERT_EQ(ring.out.size(), 4U);
    EXPECT_EQ(ring.out[1], of(kFirst, true, Command::FRMW, {8, 0x000C, 77, 2}));
    EXPECT_EQ(ring.out[2], of(kFirst, false, Command::FRMW, {0, 0, 0, 0}));
    EXPECT_EQ(ring.out[3], of(kFirst, true, Command::FRMW, {8, 0x0004, 99, 8}));
}

TEST(RingCopies, OneNicAloneAndOtherTrafficPass) {
    Ring ring;
    ring.see(0, Direction::sent, frame(kFirst, false, 7, {1}, 0));
    ring.see(0, Direction::received, frame(kFirst, true, 7, {1}, 3));
    ring.see(1, Direction::sent, frame(kSecond, false, 8, {1}, 0));
    ring.see(1, Direction::received, frame(kSecond, true, 8, {1}, 3));
    const std::vector<std::byte> other(60);
    ring.see(0, Direction::received, other);
    ring.see(1, Direction::refused, frame(kSecond, false, 9, {1}, 0));
    ring.copies.finish();
    EXPECT_EQ(ring.out.size(), 5U);
    EXPECT_EQ(ring.copies.merged(), 1U);
    EXPECT_TRUE(RingCopies::is_ring({{0, Direction::sent}, {1, Direction::sent}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::sent}, {0, Direction::sent}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::unknown}, {1, Direction::unknown}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::sent}, {1, Direction::sent}, {2, Direction::received}}));
}

}  // namespace
}  // namespace margay::analyse
