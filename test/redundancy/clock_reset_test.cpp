// Slaves behind a break lose their power while frames are lost. The time with which a clock begins after a loss of
// power becomes neither the system time nor the time of another clock. All 64 bits are compared, because the difference
// register has only 32 bits.
#include "redundancy/clock_ring.hpp"

#include <random>

namespace margay {
namespace {

struct ResetBus : ClockRingBus {
    static constexpr unsigned kSlaves = 6;
    std::mt19937 random;
    std::int64_t zero_ns = 0;
    unsigned most_rest = 1200;                                    // cycles after a loss of power
    std::vector<bool> fresh = std::vector<bool>(kSlaves, false);  // the master may not know of the loss of power yet
    unsigned wrong = 0;

    unsigned below(unsigned count) { return static_cast<unsigned>(random() % count); }
    // How far a time is from the time that all clocks had at the beginning. The oscillators differ by 100 ppm at most.
    [[nodiscard]] bool is_far(std::uint64_t time_ns) {
        const auto away = static_cast<std::int64_t>(time_ns) - (osal.now() - Time{}).count() - zero_ns;
        return std::abs(away) > 100'000'000;
    }
    void look() {
        for (std::uint16_t n = 1; n <= kSlaves; ++n) {
            const AlState state = ctx->slave(n).al.state;
            if (state <= AlState::init) fresh[n - 1U] = false;
            if (state < AlState::safeop || fresh[n - 1U] || !segment.powered(at[n - 1U])) continue;
            if (is_far(segment.slave(at[n - 1U]).clock().copy(osal.now())) && ++wrong == 1)
                ADD_FAILURE() << "the clock of slave " << n << "\n" << joined(events());
        }
        if (is_far(clock_status(*ctx, osal.now()).system_time_ns) && ++wrong == 1)
            ADD_FAILURE() << "system time\n" << joined(events());
    }
    void go(unsigned count) {
        for (unsigned n = 0; n < count && wrong == 0; ++n) {
            (void)cycle();
            look();
        }
    }
    void power(unsigned n, bool on) {
        segment.set_power(at[n], on, osal.now());
        fresh[n] = on && ctx->slave(n + 1).al.state > AlState::init;
    }
    // Some of the slaves behind the break lose their power, and perhaps one before the break.
    void switch_off_and_on(unsigned front) {
        std::vector<unsigned> off;
        for (unsigned n = front; n < kSlaves; ++n)
            if (below(3) != 0) off.push_back(n);
        if (below(4) == 0) off.push_back(below(front));
        for (const unsigned n : off) {
            power(n, false);
            if (below(2) == 0) go(below(60));
        }
        if (below(2) == 0) go(below(300));
        for (std::size_t n = off.size(); n > 1; --n) std::swap(off[n - 1], off[below(static_cast<unsigned>(n))]);
        for (const unsigned n : off) {
            power(n, true);
            if (below(2) == 0) go(below(400));
        }
        go(below(most_rest));
    }
};

// A ring whose slaves have clocks that have run for different times, some of them for years.
void bring_up(ResetBus& bus, unsigned seed) {
    bus.random.seed(seed);
    for (unsigned n = 0; n < ResetBus::kSlaves; ++n) {
        const std::uint64_t began = (std::uint64_t{bus.random()} << 32 | bus.random()) >> (3 + bus.below(30));
        (void)bus.add_to_ring(ClockRingBus::clocked(static_cast<std::int32_t>(bus.below(200'001)) - 100'000, began));
    }
    bus.close_ring();
    bus.bring_up();
    bus.zero_ns = static_cast<std::int64_t>(clock_status(*bus.ctx, bus.osal.now()).system_time_ns) -
                  (bus.osal.now() - Time{}).count();
    bus.segment.set_noise({.lost = 0.02, .seed = seed});
}

class ClockReset : public testing::TestWithParam<unsigned> {};

TEST_P(ClockReset, LeadsNoOtherClock) {
    ResetBus bus;
    bring_up(bus, GetParam());
    for (unsigned n = 0; n < 4 && bus.wrong == 0; ++n) {
        const unsigned front = 1 + bus.below(ResetBus::kSlaves - 1);
        bus.cable(bus.ring_cables[front], false);
        bus.go(300 + bus.below(1500));
        for (unsigned times = 0; times < 4; ++times) bus.switch_off_and_on(front);
        bus.cable(bus.ring_cables[front], true);
        bus.go(1000);
    }
    bus.segment.set_noise({});
    EXPECT_EQ(bus.wrong, 0U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, ClockReset, testing::Values(5U, 7U, 10U, 12U, 34U));

class ClockResetInChanges : public testing::TestWithParam<unsigned> {};

// The cable is repaired for some cycles while the way from one part of the ring to the other one is measured.
TEST_P(ClockResetInChanges, LeadsNoOtherClock) {
    ResetBus bus;
    bring_up(bus, GetParam());
    bus.most_rest = 400;
    for (unsigned n = 0; n < 4 && bus.wrong == 0; ++n) {
        const unsigned front = 1 + bus.below(ResetBus::kSlaves - 1);
        bus.cable(bus.ring_cables[front], false);
        bus.go(300 + bus.below(1500));
        for (unsigned times = 0; times < 6; ++times) {
            bus.switch_off_and_on(front);
            bus.cable(bus.ring_cables[front], true);
            bus.go(1 + bus.below(60));
            bus.cable(bus.ring_cables[front], false);
            bus.go(1 + bus.below(400));
        }
        bus.cable(bus.ring_cables[front], true);
        bus.go(1000);
    }
    bus.segment.set_noise({});
    EXPECT_EQ(bus.wrong, 0U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, ClockResetInChanges, testing::Values(6U, 11U, 15U, 26U, 28U, 41U, 51U, 54U, 56U));

}  // namespace
}  // namespace margay
