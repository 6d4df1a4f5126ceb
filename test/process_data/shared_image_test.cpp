// An image for another thread, and copies from slave to slave.
#include "process_data/bus.hpp"
#include "util/bits.hpp"

#include <algorithm>
#include <atomic>
#include <random>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Two threads without pauses: the reader always reads the data of one publication, and never older data than before.
TEST(SharedImage, NeverShowsHalfOfACycle) {
    std::vector<std::byte> memory(SharedImage::memory_bytes(0, 256));
    TripleBuffer shared;
    shared.attach(memory, 256);
    std::atomic<bool> done{false};
    std::thread writer([&] {
        std::array<std::byte, 256> image{};
        for (std::uint32_t n = 1; n <= 200'000; ++n) {
            for (std::size_t at = 0; at < image.size(); at += 4) store_le<std::uint32_t>(image, at, n);
            std::ranges::copy(image, shared.back().begin());
            shared.publish();
        }
        done = true;
    });
    std::uint32_t last = 0;
    std::uint32_t seen = 0;
    bool last_round = false;
    do {
        last_round = done;
        if (!shared.refresh()) continue;
        const auto first = load_le<std::uint32_t>(shared.front(), 0);
        for (std::size_t at = 4; at < 256; at += 4) ASSERT_EQ(load_le<std::uint32_t>(shared.front(), at), first);
        ASSERT_GT(first, last);
        last = first;
        ++seen;
    } while (!last_round);
    writer.join();
    EXPECT_EQ(last, 200'000U);
    EXPECT_GT(seen, 0U);
}

TEST(SharedImage, GoesThroughTheCycle) {
    Bus bus;
    bus.add(16, 16);
    bus.start();
    std::vector<std::byte> image(64);
    std::vector<std::byte> memory(SharedImage::memory_bytes(2, 2));
    SharedImage shared(memory);
    bus.ctx->group(0).config.shared = &shared;
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    shared.outputs()[0] = std::byte{0x12};
    shared.outputs()[1] = std::byte{0x34};
    bus.device(1).inputs()[1] = std::byte{0x56};
    bus.device(1).poke();
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(bus.device(1).outputs()[0], std::byte{0}) << "not published yet";
    EXPECT_TRUE(shared.refresh_inputs());
    EXPECT_EQ(shared.inputs()[1], std::byte{0x56});
    EXPECT_FALSE(shared.refresh_inputs()) << "no cycle since";
    shared.publish_outputs();
    ASSERT_TRUE(bus.cycle().ok());
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(bus.device(1).outputs()[0], std::byte{0x12});
    EXPECT_EQ(bus.device(1).outputs()[1], std::byte{0x34});
    (void)shared.refresh_inputs();
    bus.segment.lose_next({0, 0});
    EXPECT_FALSE(bus.cycle().ok());
    EXPECT_FALSE(shared.refresh_inputs()) << "a cycle that was lost brings nothing";
}

TEST(SharedImage, TooLittleMemoryIsNamed) {
    Bus bus;
    bus.add(16, 16);
    bus.start();
    std::vector<std::byte> image(64);
    std::vector<std::byte> memory(SharedImage::memory_bytes(2, 2) - 1);
    SharedImage shared(memory);
    bus.ctx->group(0).config.shared = &shared;
    const auto mapped = config_map(*bus.ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::capacity);
    EXPECT_EQ(mapped.error().expected, 12U);
    bus.ctx->group(0).config.shared = nullptr;
    EXPECT_TRUE(config_map(*bus.ctx, image).ok()) << "the context is still usable";
}

TEST(SlaveToSlave, BitsGoWhereTheyShall) {
    Bus bus;
    bus.add(16, 16);
    bus.add(24, 24);
    bus.start();
    std::vector<std::byte> image(64);
    const SlaveToSlave copies[] = {{.from_slave = 1, .to_slave = 2, .from_bit = 3, .to_bit = 9, .bits = 11},
                                   {.from_slave = 2, .to_slave = 1, .from_bit = 0, .to_bit = 0, .bits = 8}};
    bus.ctx->group(0).config.copies = copies;
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    std::mt19937 random(3);
    for (int round = 0; round < 50; ++round) {
        for (std::size_t n = 1; n <= 2; ++n) {
            for (auto& octet : bus.device(n).inputs()) octet = static_cast<std::byte>(random());
            bus.device(n).poke();
        }
        bus.ctx->slave(2).image.outputs.bytes[0] = static_cast<std::byte>(round);
        for (int n = 0; n < 3; ++n) ASSERT_TRUE(bus.cycle().ok());
        const auto in = load_le<std::uint16_t>(Bytes(bus.device(1).inputs()));
        const auto out = load_le<std::uint16_t>(bus.device(2).outputs(), 1);
        EXPECT_EQ((out >> 1) & 0x7FF, (in >> 3) & 0x7FF);
        EXPECT_EQ(bus.device(2).outputs()[0], static_cast<std::byte>(round))
            << "what is not copied is the application's";
        EXPECT_EQ(bus.device(1).outputs()[0], bus.device(2).inputs()[0]);
    }
}

TEST(SlaveToSlave, WhatDoesNotFitIsNamed) {
    Bus bus;
    bus.add(16, 16);
    bus.start();
    std::vector<std::byte> image(64);
    SlaveToSlave copy{.from_slave = 1, .to_slave = 2, .bits = 8};
    bus.ctx->group(0).config.copies = {&copy, 1};
    EXPECT_EQ(config_map(*bus.ctx, image).error().code, Errc::unknown_slave);
    copy = {.from_slave = 1, .to_slave = 1, .from_bit = 9, .bits = 8};
    EXPECT_EQ(config_map(*bus.ctx, image).error().code, Errc::invalid_argument);
    copy.from_bit = 8;
    EXPECT_TRUE(config_map(*bus.ctx, image).ok());
}

TEST(CopyBits, AgreesWithOneBitAtATime) {
    std::mt19937 random(5);
    for (int round = 0; round < 2000; ++round) {
        std::array<std::byte, 16> from{};
        std::array<std::byte, 16> to{};
        for (auto& octet : from) octet = static_cast<std::byte>(random());
        for (auto& octet : to) octet = static_cast<std::byte>(random());
        auto expected = to;
        const auto bits = static_cast<unsigned>(random() % 65);
        const auto a = static_cast<unsigned>(random() % (128 - bits));
        const auto b = static_cast<unsigned>(random() % (128 - bits));
        for (unsigned n = 0; n < bits; ++n) {
            const auto bit = (from[(a + n) / 8] >> ((a + n) % 8)) & std::byte{1};
            const auto mask = std::byte{1} << ((b + n) % 8);
            expected[(b + n) / 8] = (expected[(b + n) / 8] & ~mask) | (bit << ((b + n) % 8));
        }
        copy_bits(to, b, from, a, bits);
        ASSERT_EQ(to, expected) << a << " to " << b << ", " << bits;
    }
}

}  // namespace
}  // namespace margay
