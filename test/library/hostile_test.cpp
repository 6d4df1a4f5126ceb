// A master that writes any value to any register. The simulation must continue, and its work for a second of simulated
// time must stay below a bound that does not depend on the registers. The test counts work, not time.
#include "hand.hpp"

#include "wire/esc.hpp"

#include <random>

namespace margay::sim::test {
namespace {

constexpr std::uint64_t kMost = 1'300'000;  // Esc::work() per second

std::uint64_t work_of_a_second(Hand& hand) {
    const auto before = hand.esc().work();
    hand.wait(1s);
    return hand.esc().work() - before;
}

void start_sync(Hand& hand, std::uint32_t cycle0, std::uint32_t cycle1) {
    const auto start = hand.esc().clock().copy(hand.rig.now) + 1'000'000;
    hand.rig.put<std::uint8_t>(0, reg::kSyncActivation.address, 0);
    hand.rig.put<std::uint64_t>(0, reg::kSyncStartTime.address, start);
    hand.rig.put<std::uint32_t>(0, reg::kSync0CycleTime.address, cycle0);
    hand.rig.put<std::uint32_t>(0, reg::kSync1CycleTime.address, cycle1);
    hand.rig.put<std::uint8_t>(0, reg::kSyncActivation.address, 0x07);
}

constexpr std::string_view kDevices[] = {"soe_drive", "drive", "encoder", "digital_io_16", "pulse_axis", "odd_device"};

TEST(HostileMaster, SyncCyclesOfNanosecondsAreBounded) {
    for (const auto name : {"soe_drive", "pulse_axis"}) {
        Hand hand(name);
        EXPECT_EQ(hand.to(AlState::op).state, AlState::op);
        for (const std::uint32_t cycle0 : {1U, 7U, 1000U, 9999U, 10'000U})
            for (const std::uint32_t cycle1 : {0U, 1U, 3U, 0xFFFFFFFFU}) {
                start_sync(hand, cycle0, cycle1);
                EXPECT_LE(work_of_a_second(hand), kMost / 2) << name << " " << cycle0 << " " << cycle1;
            }
    }
}

// The clock is set forwards and backwards while SYNC is active.
TEST(HostileMaster, JumpsOfTheClockAreBounded) {
    Hand hand("soe_drive");
    EXPECT_EQ(hand.to(AlState::op).state, AlState::op);
    std::mt19937_64 random(1);
    for (int n = 0; n < 20; ++n) {
        start_sync(hand, n % 2 == 0 ? 1'000'000 : 1, 500);
        hand.wait(5ms);
        const auto before = hand.esc().work();
        hand.rig.put<std::uint64_t>(0, reg::kSystemTimeOffset.address, random());
        hand.wait(100ms);
        EXPECT_LE(hand.esc().work() - before, kMost / 10);
    }
}

// For example watchdogs of 80 ns.
TEST(HostileMaster, AnyRegisterMayHaveAnyValue) {
    constexpr std::uint16_t kTargets[] = {0x0100, 0x0101, 0x0103, 0x0120, 0x0200, 0x0204, 0x0400, 0x0410, 0x0420,
                                          0x0500, 0x0502, 0x0504, 0x0510, 0x0600, 0x0610, 0x0800, 0x0808, 0x0810,
                                          0x0818, 0x0900, 0x0910, 0x0920, 0x0928, 0x0930, 0x0934, 0x0980, 0x0981,
                                          0x0990, 0x09A0, 0x09A4, 0x09A8, 0x09A9, 0x0F00, 0x1000, 0x1100};
    constexpr std::uint64_t kValues[] = {0,    1,     2,      3,          7,          0x7F,
                                         0xFF, 0x100, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, ~std::uint64_t{0}};
    for (const auto name : kDevices) {
        for (unsigned seed = 1; seed <= 6; ++seed) {
            Hand hand(name);
            if (seed % 2 == 0) (void)hand.to(AlState::op);
            std::mt19937_64 random(seed);
            for (int n = 0; n < 200; ++n) {
                const auto target = kTargets[random() % std::size(kTargets)];
                const auto value = random() % 3 == 0 ? random() : kValues[random() % std::size(kValues)];
                hand.rig.put<std::uint64_t>(
                    0, static_cast<std::uint16_t>(target + (random() % 4 == 0 ? random() % 8 : 0)), value);
            }
            EXPECT_LE(work_of_a_second(hand), kMost) << name << ", seed " << seed;
            for (unsigned at = 0; at < 0x1000; at += 0x40) (void)hand.esc().peek(static_cast<std::uint16_t>(at), 0x40);
        }
    }
}

}  // namespace
}  // namespace margay::sim::test
