// context_bytes() is exact: init() succeeds with exactly this size of memory, and the arena is as large as the limits
// require. With one octet less, init() fails with a text.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/segment.hpp"

#include <margay/features.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/redundancy.hpp>
#include <margay/run.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <random>
#include <string>

namespace margay {
namespace {

// A context in memory of exactly this size that begins `offset` octets behind aligned memory.
class SizedContext : public Context {
  public:
    SizedContext(const Limits& limits, std::size_t bytes, std::size_t offset)
        : SizedContext(std::make_unique<std::byte[]>(offset + bytes), limits, bytes, offset) {}
    ~SizedContext() { close(); }

  private:
    SizedContext(std::unique_ptr<std::byte[]> memory, const Limits& limits, std::size_t bytes, std::size_t offset)
        : Context({memory.get() + offset, bytes}, limits), owned_(std::move(memory)) {}
    std::unique_ptr<std::byte[]> owned_;  // AddressSanitizer reports a write beyond its end
};

// Random limits, most of them small.
Limits any_limits(std::mt19937& random) {
    const auto below = [&](unsigned end) { return static_cast<std::uint16_t>(random() % end); };
    const auto from_1 = [&](unsigned end) { return static_cast<std::uint16_t>(1 + below(end)); };
    Limits limits;
    limits.slaves = from_1(40);
    limits.tasks = below(3) == 0 ? std::uint16_t{0} : from_1(50);
    limits.frames = from_1(20);
    limits.groups = from_1(5);
    limits.process_frames = from_1(7);
    limits.emergencies = below(4);
    limits.errors = below(6);
    limits.events = below(6);
    limits.guests = below(8);
    limits.arena_bytes = below(3) == 0 ? 0U : static_cast<std::uint32_t>(1U + random() % 30000U);
    limits.clocks = below(2) == 0;
    limits.redundancy = below(3) == 0;
    return limits;
}

// The size of the arena according to the comments of Limits, in whole blocks of 64 octets.
std::size_t wanted_arena(const Limits& limits) {
    const std::size_t tasks = limits.tasks == 0 ? limits.slaves : std::min(limits.tasks, limits.slaves);
    const std::size_t bytes = limits.arena_bytes != 0 ? limits.arena_bytes : (tasks + 4) * 1024 * sizeof(void*);
    return (bytes + 63) / 64 * 64;
}

std::string text_of(const Limits& l) {
    std::string text;
    for (const unsigned value :
         {unsigned{l.slaves}, unsigned{l.tasks}, unsigned{l.frames}, unsigned{l.groups}, unsigned{l.process_frames},
          unsigned{l.emergencies}, unsigned{l.errors}, unsigned{l.events}, unsigned{l.guests}, unsigned{l.arena_bytes},
          unsigned{l.clocks}, unsigned{l.redundancy}})
        text += std::to_string(value) + " ";
    return text;
}

class ContextMemory : public testing::Test {
  protected:
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    SimulatedNic second{segment, osal};

    Result<> begin(Context& ctx, bool both) {
        return both ? init_redundant(ctx, wire, second, osal) : init(ctx, wire, osal);
    }
    void expect_exact(const Limits& limits, std::size_t offset) {
        // `new` aligns memory as std::max_align_t requires.
        const std::size_t unused = (alignof(std::max_align_t) - offset) % alignof(std::max_align_t);
        const std::size_t needed = context_bytes(limits) + unused;
        SCOPED_TRACE(text_of(limits) + "offset " + std::to_string(offset));
        SizedContext exact(limits, needed, offset);
        const auto begun = begin(exact, limits.redundancy);
        ASSERT_TRUE(begun) << words(begun.error());
        EXPECT_EQ(exact.arena_bytes(), wanted_arena(limits));
        SizedContext less(limits, needed - 1, offset);
        const auto refused = begin(less, limits.redundancy);
        ASSERT_FALSE(refused);
        EXPECT_EQ(words(refused.error()),
                  "opening the network interface: not enough memory: the memory of the "
                  "context (needed " +
                      std::to_string(needed) + ", there is room for " + std::to_string(needed - 1) + ")");
        EXPECT_TRUE(less.slaves().empty());
        EXPECT_EQ(less.arena_bytes(), 0U);
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
};

TEST_F(ContextMemory, ExactlyContextBytesAreNeeded) {
    std::mt19937 random(12);
    expect_exact({}, 0);
    expect_exact({.redundancy = true}, 0);
    expect_exact({.slaves = 1,
                  .frames = 1,
                  .groups = 1,
                  .process_frames = 1,
                  .emergencies = 0,
                  .errors = 0,
                  .events = 0,
                  .guests = 0,
                  .arena_bytes = 1,
                  .clocks = false},
                 0);
    for (int n = 0; n < 400 && !HasFailure(); ++n) expect_exact(any_limits(random), 0);
}

TEST_F(ContextMemory, OctetsBeforeTheFirstAlignedOneAreNotUsed) {
    std::mt19937 random(13);
    for (std::size_t offset = 1; offset <= alignof(std::max_align_t) && !HasFailure(); ++offset)
        for (int n = 0; n < 20; ++n) expect_exact(any_limits(random), offset);
}

TEST_F(ContextMemory, MemoryOfAlmostNoOctetsIsRefused) {
    for (std::size_t bytes = 0; bytes < 40; ++bytes)
        for (std::size_t offset = 0; offset < 16; ++offset) {
            SizedContext tiny({.redundancy = true}, bytes, offset);
            EXPECT_EQ(init(tiny, wire, osal).error().code, Errc::capacity);
            EXPECT_EQ(init_redundant(tiny, wire, second, osal).error().code, Errc::capacity);
        }
}

TEST_F(ContextMemory, WhatIsMoreIsForTheArena) {
    const Limits limits{.slaves = 4, .arena_bytes = 4096};
    SizedContext more(limits, context_bytes(limits) + 10 * 65, 0);
    ASSERT_TRUE(init(more, wire, osal));
    EXPECT_EQ(more.arena_bytes(), 4096U + 10 * 64);
    HostContext unused_cables({.slaves = 4, .arena_bytes = 4096, .redundancy = true});
    ASSERT_TRUE(init(unused_cables, wire, osal));
    EXPECT_GT(unused_cables.arena_bytes(), 4096U + 3088);
}

// All tables are full: a segment as large as the limits reaches OP in exactly this size of memory.
TEST_F(ContextMemory, ASegmentAsLargeAsTheLimitsReachesOp) {
    constexpr std::uint16_t kSlaves = 6;
    for (unsigned n = 0; n < kSlaves; ++n) {
        const auto number = segment.add(sim::make_device(n == 0 ? "coupler" : "digital_out_8").value().assemble());
        if (number == 0)
            ASSERT_TRUE(segment.connect_master({0, 0}));
        else
            ASSERT_TRUE(segment.connect({number - 1, 1}, {number, 0}));
    }
    segment.power_up(osal.now());
    osal.advance(std::chrono::milliseconds(1));
    const Limits limits{.slaves = kSlaves,
                        .frames = 2,
                        .groups = 1,
                        .process_frames = 1,
                        .emergencies = 1,
                        .errors = 1,
                        .events = 1,
                        .guests = 0};
    SizedContext exact(limits, context_bytes(limits), 0);
    ASSERT_TRUE(init(exact, wire, osal));
    const auto found = config_init(exact);
    ASSERT_TRUE(found) << words(found.error());
    EXPECT_EQ(*found, kSlaves);
    std::array<std::byte, 16> image{};
    const auto mapped = config_map(exact, image);
    ASSERT_TRUE(mapped) << words(mapped.error());
    EXPECT_EQ(exact.slave(kSlaves).al.state, AlState::safeop);
    const auto reached = reach(exact, AlState::op, std::chrono::seconds(10));
    EXPECT_TRUE(reached) << words(reached.error());
    EXPECT_LE(exact.arena_peak_bytes(), exact.arena_bytes());
}

}  // namespace
}  // namespace margay
