// Recordings of both NICs of a ring: copies become one frame, and parts of a reply one reply.
#include "analyse/ring_copies.hpp"

#include "wire/datagram.hpp"

#include <gtest/gtest.h>

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
    RingCopies copies{[this](Moment, Bytes packet, std::size_t) { out.emplace_back(packet.begin(), packet.end()); }};
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
        EXPECT_EQ(ring.out.size(), 1U);
        second_first ? first() : second();
        ASSERT_EQ(ring.out.size(), 2U);
        EXPECT_EQ(ring.out[1], frame(kFirst, true, 7, {1, 2, 3, 4}, 9));
    }
}

TEST(RingCopies, APartWhoseOtherPartIsLostIsTheReply) {
    Ring ring;
    ring.send(7, {1, 2, 0, 0});
    ring.see(0, Direction::received, frame(kFirst, true, 7, {1, 2, 3, 0}, 3));
    ring.send(8, {1, 2, 0, 0});
    EXPECT_EQ(ring.out.size(), 2U) << "it may still come";
    ring.see(0, Direction::received, frame(kFirst, true, 8, {1, 2, 3, 0}, 3), 600us);
    ASSERT_EQ(ring.out.size(), 3U);
    EXPECT_EQ(ring.out[2], frame(kFirst, true, 7, {1, 2, 3, 0}, 3));
    ring.see(1, Direction::received, frame(kSecond, true, 7, {1, 2, 0, 4}, 6));
    EXPECT_EQ(ring.out.size(), 3U) << "a part behind its reply";
    ring.copies.finish();
    ASSERT_EQ(ring.out.size(), 4U);
    EXPECT_EQ(ring.out[3], frame(kFirst, true, 8, {1, 2, 3, 0}, 3));
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
    EXPECT_EQ(ring.out.size(), 5U);
    EXPECT_EQ(ring.copies.merged(), 1U);
    EXPECT_TRUE(RingCopies::is_ring({{0, Direction::sent}, {1, Direction::sent}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::sent}, {0, Direction::sent}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::unknown}, {1, Direction::unknown}}));
    EXPECT_FALSE(RingCopies::is_ring({{0, Direction::sent}, {1, Direction::sent}, {2, Direction::received}}));
}

}  // namespace
}  // namespace margay::analyse
